"""MDS read back by a reader written from its documentation, and by the library where it is installed."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset
from dataset_builder.exporting.formats import mds_shards
from tests.ecosystem.pages import Truth, assert_same, of_split
from tests.exporting.formats.conftest import Export

DECODERS: dict[str, Any] = {"str": bytes.decode, "json": json.loads, "bytes": bytes}


def read_split(folder: Path) -> list[dict[str, Any]]:
    """All samples of `index.json` and its files, with sizes and hashes compared."""
    index, rows = json.loads((folder / "index.json").read_text()), list[dict[str, Any]]()
    assert index["version"] == 2
    for shard in index["shards"]:
        assert (shard["format"], shard["version"], shard["compression"], shard["zip_data"]) == ("mds", 2, None, None)
        raw = shard["raw_data"]
        data = (folder / raw["basename"]).read_bytes()
        assert len(data) == raw["bytes"] and sha256_file(folder / raw["basename"]) == raw["hashes"]["sha256"]
        count = int.from_bytes(data[:4], "little")
        offsets = np.frombuffer(data, "<u4", count + 1, 4)
        assert count == shard["samples"] and offsets[-1] == len(data)
        own = json.loads(data[4 * (count + 2):offsets[0]])
        assert own == {key: value for key, value in shard.items() if key not in ("raw_data", "samples", "zip_data")}
        rows += [sample(data[a:b], shard) for a, b in pairwise(offsets)]
    return rows


def sample(data: bytes, shard: dict[str, Any]) -> dict[str, Any]:
    names, row = shard["column_names"], {}
    assert names == sorted(names) and set(shard["column_sizes"]) == {None}
    sizes, start = np.frombuffer(data, "<u4", len(names)), 4 * len(names)
    for name, encoding, size in zip(names, shard["column_encodings"], sizes, strict=True):
        row[name] = DECODERS[encoding](data[start:start + size])
        start += size
    assert start == len(data)
    return row


@pytest.mark.parametrize("split", ["train", "test"])
def test_every_example_is_there(exported: Export, truth: Truth, split: str) -> None:
    rows, wanted = read_split(exported("mds") / split), of_split(truth, split)
    assert [row["key"] for row in rows] == sorted(wanted)
    assert_same({row["key"]: row for row in rows}, wanted, suffix="")
    assert all(row["label"] == wanted[row["key"]]["meta"] for row in rows)


def test_files_stay_small(exported: Export, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    """An example to each file where two are too many; none is lost at the seams."""
    monkeypatch.setattr(mds_shards, "FILE_BYTES", 12_000)
    folder = exported("mds") / "train"
    assert [path.name for path in sorted(folder.glob("*.mds"))] == [
        "shard.00000-01.mds", "shard.00000.mds", "shard.00001.mds"]
    assert [row["key"] for row in read_split(folder)] == ["00000000", "00000001", "00000002"]


def test_what_offsets_cannot_say_is_refused(dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mds_shards, "MOST_BYTES", 12_000)
    with pytest.raises(Exception, match=r"00000000: expected examples of less than 12,000 bytes"):
        export_dataset(DatasetExport(dataset=dataset, out=tmp_path / "out", kind="mds"))
    assert not [*(tmp_path / "out").rglob("*.mds*")]


@pytest.mark.filterwarnings("ignore")
def test_the_library_reads_it(exported: Export, truth: Truth) -> None:
    streaming = pytest.importorskip("streaming", reason="needs mosaicml-streaming")
    for split in ("train", "test"):
        local = streaming.LocalDataset(str(exported("mds")), split)
        assert_same({row["key"]: row for row in (local[k] for k in range(len(local)))}, of_split(truth, split), "")
