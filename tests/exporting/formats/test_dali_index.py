"""DALI's index, read as its loader reads it; DALI itself is not installable here (it wants a GPU's libraries)."""

from pathlib import Path
from typing import NamedTuple

import pytest

from dataset_builder.errors import ShardError, UserError
from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset
from tests.ecosystem.pages import Truth, assert_same
from tests.exporting.formats.conftest import Export


class Component(NamedTuple):
    ext: str
    offset: int
    size: int
    name: str


def read_index(path: Path) -> list[list[Component]]:
    """Samples of an index, with what DALI enforces: version, a positive count, whole records, offsets in blocks."""
    head, *lines = path.read_text(encoding="ascii").splitlines()
    version, count = head.split()
    assert version in ("v1.1", "v1.2") and int(count) == len(lines) > 0
    samples = []
    for line in lines:
        words = line.split(" ")
        assert words and len(words) % 4 == 0
        parts = [Component(ext, int(offset), int(size), name) for ext, offset, size, name in
                 zip(*[iter(words)] * 4, strict=True)]
        assert all(part.offset % 512 == 0 and part.name.partition(".")[2] == part.ext for part in parts)
        samples.append(parts)
    return samples


def test_seeking_finds_every_file(exported: Export, dataset: Path, truth: Truth) -> None:
    """Of every example: also of those that share files with an earlier one, which no other reader of the tar finds."""
    found: dict[str, dict[str, bytes]] = {}
    for index in exported("dali").glob("*.idx"):
        tar = (dataset / "shards" / f"{index.stem}.tar").read_bytes()
        for sample in read_index(index):
            key = next(part.name.partition(".")[0] for part in sample if part.ext == "json")
            found[key] = {part.ext: tar[part.offset:part.offset + part.size] for part in sample}
    assert_same(found, truth)


def test_the_dataset_is_as_it_was(exported: Export, dataset: Path) -> None:
    before = sorted(dataset.rglob("*"))
    assert exported("dali") and sorted(dataset.rglob("*")) == before


def test_a_header_that_changed_is_refused(dataset: Path, tmp_path: Path) -> None:
    """DALI would seek past it and never know."""
    tar = min((dataset / "shards").glob("*train*.tar"))
    tar.chmod(0o644)
    data = bytearray(tar.read_bytes())
    data[0] ^= 1
    tar.write_bytes(data)
    with pytest.raises(ShardError, match="expected another tar header at byte 0"):
        export_dataset(DatasetExport(dataset=dataset, out=tmp_path / "out", kind="dali"))


def test_layers_are_chosen_by_the_reader(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="expected no layers for an index"):
        export_dataset(DatasetExport(dataset=dataset, out=tmp_path / "out", kind="dali", layers=["i_t"]))
    assert not (tmp_path / "out").exists()
