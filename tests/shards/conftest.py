"""A fresh small dataset for every test that asks for one."""

from pathlib import Path

import pytest

from tests.shards.tiny_dataset import build


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Folder of a finished dataset of four examples in three shards."""
    build(tmp_path / "tiny")
    return tmp_path / "tiny"
