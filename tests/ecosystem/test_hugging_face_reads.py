"""Hugging Face datasets reads the folder as it is, and shards at an http address by split."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from benchmarks._file_server import Quiet, Ranges, serving
from tests.ecosystem.pages import Truth, assert_same, of_split, shards_of

hugging_face = pytest.importorskip("datasets", reason="needs datasets, which brings pyarrow")


def samples(rows: Iterable[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for row in rows:
        assert row["__key__"] not in found
        found[row["__key__"]] = row
    return found


@pytest.mark.parametrize("streaming", [False, True])
def test_the_folder_loads_by_split(dataset: Path, truth: Truth, streaming: bool, tmp_path: Path) -> None:
    for split in ("train", "test"):
        rows = hugging_face.load_dataset(str(dataset), split=split, streaming=streaming, cache_dir=str(tmp_path / "hf"))
        found = samples(rows)
        assert list(found) == sorted(of_split(truth, split))
        assert_same(found, of_split(truth, split))
        assert all(json.loads(json.dumps(row["json"])) == truth[key]["meta"] for key, row in found.items())
        assert all(row["preview.png"].size == (16, 6) for row in found.values())


def test_all_splits_are_those_of_the_manifest(dataset: Path, tmp_path: Path) -> None:
    found = hugging_face.load_dataset(str(dataset), streaming=True, cache_dir=str(tmp_path / "hf"))
    assert list(found) == ["train", "test"]


@pytest.mark.parametrize("handler", [Quiet, Ranges])
def test_a_split_streams_from_an_address(dataset: Path, truth: Truth, handler: type[Quiet], tmp_path: Path) -> None:
    """No hub: addresses of the shards of each split, as `dataset.json` lists them."""
    with serving(dataset, handler) as address:
        files = {split: [f"{address}/shards/{name}" for name in shards_of(dataset, split)] for split in
                 ("train", "test")}
        for split in files:
            rows = hugging_face.load_dataset("webdataset", data_files=files, split=split, streaming=True,
                                             cache_dir=str(tmp_path / "hf"))
            assert rows.num_shards == len(files[split])
            assert_same(samples(rows), of_split(truth, split))
