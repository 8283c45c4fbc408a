"""What is built once for all tests."""

import os
from pathlib import Path

import psutil
import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from dataset_builder.processes import cores
from tests.small_specs import run_build, write_spec

# Networks of tests are so small that threads of PyTorch would spend their time waiting for each other
os.environ.setdefault("OMP_NUM_THREADS", "1")

MEMORY = 3 * 2**30
"""Bytes that a process of tests may need: it imports every library there is."""
CLUSTERS = ("tests/engine/test_ray_", "tests/engine/test_local.py")
"""Files that start Ray clusters, each of several machines: one after the other, in one process."""
FIRST = (*CLUSTERS, "tests/test_docs.py", "tests/whole/", "tests/studies/", "tests/rendering/", "tests/lightnet/",
         "tests/engine/")
"""What starts first where several processes share the tests, so that none waits for another's long file at the end."""


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Processes of `-n auto`: one for each core, as far as memory goes; 0 (this one alone) for a single file."""
    one_file = len(config.args) == 1 and Path(config.args[0].partition("::")[0]).is_file()
    processes = min(cores(), psutil.virtual_memory().total // MEMORY)
    return 0 if one_file or processes < 2 else processes


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling:
    """A process takes whole files, and all that start clusters."""
    return _ByFile(config, log)


class _ByFile(LoadFileScheduling):
    def _split_scope(self, nodeid: str) -> str:
        return "clusters" if nodeid.startswith(CLUSTERS) else super()._split_scope(nodeid)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files that take long start first in processes that share the tests; alone, tests keep their order."""
    if hasattr(config, "workerinput"):
        items.sort(key=lambda item: [not item.nodeid.startswith(name) for name in FIRST])


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
