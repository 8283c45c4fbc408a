"""Two synthetic datasets for readers of others: a small one, and one of more shards and both precisions."""

from pathlib import Path

import pytest

from dataset_builder.shards.reader import open_dataset
from tests.ecosystem.pages import Truth, truth_of
from tests.shards.tiny_dataset import SHARDS, build, default_examples, make_example

WIDE = {("train", 0): (0, 1), ("train", 1): (2, 3), ("train", 2): (4, 5), ("train", 3): (6,), ("test", 0): (7, 8),
        ("test", 1): (9,)}
"""Examples of every shard."""


@pytest.fixture(autouse=True)
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No hub, and caches of the test's own."""
    monkeypatch.setattr("datasets.config.HF_DATASETS_OFFLINE", True)
    monkeypatch.setattr("datasets.config.HF_DATASETS_CACHE", tmp_path / "hf")
    monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", True)
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    monkeypatch.setenv("HF_DATASETS_OFFLINE", "1")


@pytest.fixture(scope="session", params=["tiny", "wide"])
def dataset(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished dataset: four examples in three shards, or ten in six with half precision. Not to be
    changed."""
    folder: Path = tmp_path_factory.mktemp("ecosystem") / request.param
    wide = {index: make_example(index, split="test" if index > 6 else "train") for index in range(10)}
    if request.param == "wide":
        build(folder, wide, shards=WIDE, dtype="float16")
    else:
        build(folder, default_examples(), shards=SHARDS)
    return folder


@pytest.fixture
def truth(dataset: Path) -> Truth:
    """What our reader makes of every example: layers and label by key."""
    return truth_of(open_dataset(dataset))
