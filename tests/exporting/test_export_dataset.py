"""An export is whole or goes on, takes nothing damaged, and overwrites nothing of others."""

import json
from pathlib import Path

import pytest

from dataset_builder.cli.export_dataset import FORMATS
from dataset_builder.cli.main import main
from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.exporting import export_dataset as module
from dataset_builder.exporting.export_dataset import WRITERS, DatasetExport, ExportDone, export_dataset
from dataset_builder.exporting.export_record import ExportFormat, ExportRecord
from tests.shards.tiny_dataset import build, contents

KINDS = [*WRITERS]


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Four examples in three shards."""
    build(tmp_path / "tiny")
    return tmp_path / "tiny"


def export(dataset: Path, kind: ExportFormat = "mds", name: str = "out", **chosen: list[str]) -> ExportDone:
    return export_dataset(DatasetExport(dataset=dataset, out=dataset.parent / name, kind=kind, **chosen))


def flip(path: Path, at: int) -> None:
    path.chmod(0o644)
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def test_the_command_knows_every_format() -> None:
    assert [*FORMATS] == KINDS


@pytest.mark.parametrize("kind", KINDS)
def test_the_record_names_every_file(dataset: Path, kind: ExportFormat) -> None:
    done = export(dataset, kind)
    out = dataset.parent / "out"
    record = ExportRecord.model_validate_json((out / "export.json").read_bytes())
    files = [*(file for unit in record.units for file in unit.files), *record.heads]
    assert {file.name for file in files} == set(contents(out)) - {"export.json"}
    assert all(sha256_file(out / file.name) == file.sha256 for file in files)
    assert done.examples == record.examples == 4 and done.bytes == sum(f.bytes for u in record.units for f in u.files)
    assert record.source.licence == "CC0-1.0" and [layer.name for layer in record.layers][:2] == ["i_s", "d"]
    assert not (out / ".export").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_two_exports_are_equal_and_a_third_keeps_all(dataset: Path, kind: ExportFormat) -> None:
    export(dataset, kind)
    before = {path: path.stat().st_mtime_ns for path in (dataset.parent / "out").rglob("*")}
    assert export(dataset, kind).kept == 3
    assert {path: path.stat().st_mtime_ns for path in (dataset.parent / "out").rglob("*") if path.is_file()} == {
        path: time for path, time in before.items() if path.is_file()}
    export(dataset, kind, "other")
    assert contents(dataset.parent / "out") == contents(dataset.parent / "other")


@pytest.mark.parametrize("kind", KINDS)
def test_it_goes_on_where_it_was_stopped(dataset: Path, kind: ExportFormat, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped in the second shard: no record says that it is whole, and the first shard is not written again."""
    write, seen = WRITERS[kind], []

    def stopping(shard, out):
        seen.append(shard)
        if len(seen) == 2:
            raise KeyboardInterrupt
        return write(shard, out)

    monkeypatch.setitem(WRITERS, kind, stopping)
    with pytest.raises(KeyboardInterrupt):
        export(dataset, kind)
    assert not (dataset.parent / "out" / "export.json").exists()
    assert export(dataset, kind).kept == 1
    export(dataset, kind, "whole")
    assert contents(dataset.parent / "out") == contents(dataset.parent / "whole")


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_changed_is_written_again(dataset: Path, kind: ExportFormat) -> None:
    export(dataset, kind)
    out, whole = dataset.parent / "out", contents(dataset.parent / "out")
    flip(max(path for path in out.rglob("*") if path.suffix in (".mds", ".parquet", ".exr", ".idx")), 4)
    assert export(dataset, kind).kept == 2
    assert contents(out) == whole


def test_a_head_that_changed_is_written_again(dataset: Path) -> None:
    export(dataset)
    whole = contents(dataset.parent / "out")
    (dataset.parent / "out" / "train" / "index.json").write_text("{}")
    assert export(dataset).kept == 3 and contents(dataset.parent / "out") == whole


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_shard_is_refused(dataset: Path, kind: ExportFormat) -> None:
    """A bit of a layer; what was whole before it stays, and a mended dataset is taken up there."""
    tar = next((dataset / "shards").glob("*-test-*.tar"))
    flip(tar, 800)
    with pytest.raises(ShardError, match="expected SHA-256"):
        export(dataset, kind)
    assert not (dataset.parent / "out" / "export.json").exists()
    assert not [*(dataset.parent / "out").rglob("*.partial")]
    flip(tar, 800)
    assert export(dataset, kind).kept == 2


def test_a_damaged_index_is_refused(dataset: Path) -> None:
    path = next((dataset / "index").glob("*-test-*"))
    path.write_text(path.read_text().replace('"size":', '"size": '))
    with pytest.raises(ShardError, match="SHA256SUMS"):
        export(dataset)
    assert not (dataset.parent / "out").exists()


def test_splits_and_layers_are_chosen(dataset: Path) -> None:
    done = export(dataset, splits=["test"], layers=["mask", "i_t"])
    index = json.loads((dataset.parent / "out" / "test" / "index.json").read_text())
    assert done.examples == 1 and index["shards"][0]["column_names"] == ["i_t", "key", "label", "mask"]
    assert not (dataset.parent / "out" / "train").exists()


@pytest.mark.parametrize(("chosen", "message"), [
    ({"splits": ["tran"]}, "expected splits among train, test, got 'tran' .nearest known split: train"),
    ({"layers": ["depth"]}, "expected layers among i_s, d, .*got 'depth'")])
def test_what_there_is_not_is_named(dataset: Path, chosen: dict[str, list[str]], message: str) -> None:
    with pytest.raises(UserError, match=message):
        export(dataset, **chosen)
    assert not (dataset.parent / "out").exists()


def test_nothing_of_others_is_overwritten(dataset: Path) -> None:
    out = dataset.parent / "out"
    out.mkdir()
    (out / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="got something else"):
        export(dataset)
    assert [path.name for path in out.iterdir()] == ["mine.txt"]
    (out / "mine.txt").unlink()
    export(dataset)
    before = contents(out)
    for changed in ({"kind": "exr"}, {"layers": ["i_t"]}, {"splits": ["test"]}):
        with pytest.raises(OutputError, match="an export of another dataset, format, split or layers"):
            export(dataset, **changed)  # type: ignore[arg-type]
    assert contents(out) == before
    with pytest.raises(OutputError, match="got something else"):
        export(dataset, name="tiny")


def test_a_full_disk_is_said_before(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = []
    monkeypatch.setattr(module, "require_space", lambda folder, size: wanted.append(size))
    export(dataset)
    out = dataset.parent / "out"
    assert 0.9 * sum(path.stat().st_size for path in out.rglob("*.mds")) < wanted[0]


def test_the_command(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["export", str(dataset), str(dataset.parent / "out"), "--format", "exr", "--split", "test", "--layers",
                 "i_t", "mask"]
    assert main(arguments) == main([*arguments[:-2], "i_t,mask"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert "out: 1 examples in 2 files" in first and second.endswith("1 of 1 shards were there already")
