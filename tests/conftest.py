"""What is built once for all tests."""

import os
from pathlib import Path

import pytest

from tests.small_specs import run_build, write_spec

# Networks of tests are so small that threads of PyTorch would spend their time waiting for each other
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def small_spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dataset file of the small dataset; not to be changed."""
    return write_spec(tmp_path_factory.mktemp("small_spec"))


@pytest.fixture(scope="session")
def small_dataset(small_spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small dataset, built in this process; not to be changed."""
    folder = tmp_path_factory.mktemp("small_dataset") / "small"
    run_build(small_spec, folder)
    return folder
