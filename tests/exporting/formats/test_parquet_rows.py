"""Parquet, read by pyarrow and by Hugging Face datasets, whole and by column."""

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from benchmarks._file_server import Ranges, serving
from dataset_builder.exporting.formats import parquet_rows
from tests.ecosystem.pages import Truth, assert_same, of_split
from tests.exporting.formats.conftest import Export

pq = pytest.importorskip("pyarrow.parquet", reason="needs pyarrow")


def rows(folder: Path, split: str, **options: Any) -> list[dict[str, Any]]:
    return [row for path in sorted((folder / "data").glob(f"{split}-*.parquet"))
            for row in pq.ParquetFile(path, page_checksum_verification=True).read(**options).to_pylist()]


@pytest.mark.parametrize("split", ["train", "test"])
def test_every_example_is_a_row(exported: Export, truth: Truth, split: str) -> None:
    found, wanted = rows(exported("parquet"), split), of_split(truth, split)
    assert [row["key"] for row in found] == sorted(wanted)
    assert_same({row["key"]: row for row in found}, wanted, suffix="")
    for row in found:
        label = wanted[row["key"]]["meta"]
        plan = label["plan"]
        assert json.loads(row["label"]) == label
        assert (row["object"], row["category"], row["scene"], row["light"], row["level"], row["level_name"]) == (
            plan["target"]["object"]["name"], plan["target"]["object"]["category"], plan["room"]["name"],
            plan["light"], plan["rough"]["level"], plan["rough"]["name"])


def test_groups_of_rows_stay_small(exported: Export, monkeypatch: pytest.MonkeyPatch) -> None:
    """And a reader of one column finds it alone."""
    monkeypatch.setattr(parquet_rows, "GROUP_BYTES", 12_000)
    folder = exported("parquet")
    first = pq.ParquetFile(folder / "data" / "train-00000-of-00002.parquet")
    assert first.metadata.num_rows == 2 and first.num_row_groups == 2
    assert [list(row) for row in rows(folder, "train", columns=["i_t"])] == [["i_t"]] * 3


def test_a_flipped_bit_is_noticed_by_readers_that_ask(exported: Export) -> None:
    path = exported("parquet") / "data" / "test-00000-of-00001.parquet"
    data = bytearray(path.read_bytes())
    at = data.index(b"v/1\x01")
    data[at + 200] ^= 1
    path.write_bytes(data)
    with pytest.raises(OSError, match="CRC"):
        rows(path.parents[1], "test")


@pytest.mark.parametrize("streaming", [False, True])
def test_hugging_face_loads_the_folder(exported: Export, truth: Truth, streaming: bool, tmp_path: Path,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    datasets = pytest.importorskip("datasets", reason="needs datasets")
    monkeypatch.setattr("datasets.config.HF_DATASETS_OFFLINE", True)
    folder = exported("parquet")
    for split in ("train", "test"):
        found = [*datasets.load_dataset(str(folder), split=split, streaming=streaming, cache_dir=str(tmp_path / "hf"))]
        assert_same({row["key"]: row for row in found}, of_split(truth, split), suffix="")
        assert all(row["preview"].size == (16, 6) for row in found)


def test_one_column_over_http(exported: Export, truth: Truth, tmp_path: Path) -> None:
    """By address, without the hub: only the columns that are asked for come."""
    datasets = pytest.importorskip("datasets", reason="needs datasets")
    with serving(exported("parquet"), Ranges) as address:
        found = [*datasets.load_dataset("parquet", data_files={"test": f"{address}/data/test-00000-of-00001.parquet"},
                                        split="test", streaming=True, columns=["key", "i_t"],
                                        cache_dir=str(tmp_path / "hf"))]
    assert [set(row) for row in found] == [{"key", "i_t"}] and found[0]["key"] in truth


def test_the_card_says_licence_and_splits(exported: Export) -> None:
    text = (exported("parquet") / "README.md").read_text()
    assert 'license: "cc0-1.0"' in text and 'split: "test"\n    path: "data/test-*.parquet"' in text


def test_previews_are_pictures(exported: Export) -> None:
    look = rows(exported("parquet"), "test")[0]["preview"]
    with Image.open(BytesIO(look["bytes"])) as picture:
        assert picture.format == "PNG" and look["path"] == "00000003.png"
