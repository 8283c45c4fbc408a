"""What lies in an output folder is not lost: not what others put there, not another dataset, not an old one that a new
one is to replace; and nothing broken is kept."""

import json
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.cli.main import main
from dataset_builder.digest import sha256_file
from dataset_builder.shards.folder import WORK, next_of
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.verify import verify
from tests.shards.tiny_dataset import index_path, shard_path
from tests.small_specs import contents, outcomes_of, run_build, slots, write_spec
from tools.kill_edits import EDITS, files, kill_edits

QUICK = ("rough.sigma=0.0", "splits.train.lights=1", "render.spp=4")
"""Three examples."""
REPLACE = (["--replace"], [])
Tree = dict[str, bytes | str]


def tree(folder: Path) -> Tree:
    """All that is in a folder, `.build` included: bytes of files, targets of links."""
    return {path.relative_to(folder).as_posix(): os.readlink(path) if path.is_symlink() else
            path.read_bytes() if path.is_file() else "" for path in sorted(folder.rglob("*"))}


@pytest.fixture
def copy(small_dataset: Path, tmp_path: Path) -> Path:
    """The small dataset with all that its build left, to be changed."""
    shutil.copytree(small_dataset, tmp_path / "copy")
    return tmp_path / "copy"


def build(spec: Path, folder: Path, *overrides: str, options: tuple[str, ...] = ()) -> int:
    """The exit code of a build on the command line."""
    chosen = [part for override in overrides for part in ("--set", override)]
    return main(["build", str(spec), "--out", str(folder), "--workers", "1", "--backend", "llvm", *chosen, *options])


@pytest.mark.parametrize(("override", "title"), [("name=other", "other v1"), ("version=2.0.0", "small v2")])
def test_another_dataset_is_refused_by_name(small_spec: Path, copy: Path, capsys: pytest.CaptureFixture[str],
                                            override: str, title: str) -> None:
    before = tree(copy)
    assert build(small_spec, copy, override) == 2
    said = capsys.readouterr().err
    assert f"copy: expected a new or empty folder, or {title}, got the dataset small v1" in said
    assert "say --replace; no file was changed" in said and tree(copy) == before


def test_a_new_minor_version_is_the_same_dataset(small_spec: Path, copy: Path) -> None:
    assert build(small_spec, copy, "version=1.1.0", *QUICK) == 0 and load_manifest(copy).version == "1.1.0"


def test_replace_takes_away_what_the_old_manifest_lists(small_spec: Path, copy: Path, tmp_path: Path) -> None:
    assert build(small_spec, copy, "name=other", *QUICK, options=("--replace",)) == 0
    run_build(small_spec, tmp_path / "fresh", "name=other", *QUICK)
    assert slots(copy) == ["other-v1-test-000000", "other-v1-train-000000", "other-v1-train-000001"]
    assert verify(copy) == []
    assert contents(copy) == contents(tmp_path / "fresh")
    assert build(small_spec, copy, *QUICK) == 2


def linked(folder: Path, name: str) -> None:
    """Move a folder or a file elsewhere and leave a link."""
    (folder / name).rename(folder.with_name("elsewhere"))
    (folder / name).symlink_to(folder.with_name("elsewhere"))


def written(name: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("mine")
    return write


def link_to_a_file(name: str) -> Callable[[Path], None]:
    def link(folder: Path) -> None:
        written("../precious")(folder)
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).symlink_to(folder.parent / "precious")
    return link


@pytest.mark.parametrize("options", REPLACE)
@pytest.mark.parametrize(("change", "name"), [
    *((written(name), name) for name in ("notes.txt", "shards/data.tar", "shards/small-v1-train-000000.tar",
                                         "index/notes.txt", "previews/mine.png", "dataset.json.partial", ".hidden")),
    (lambda folder: (folder / "shards" / "more").mkdir(), "shards/more/"),
    (lambda folder: (folder / "more").mkdir(), "more/"),
    *((partial(linked, name=name), name) for name in (".build", "shards", "index", ".build/staging")),
    *((link_to_a_file(name), name) for name in (".build/lock", ".build/claim.json.partial", "shards/x.tar.partial",
                                                ".build/next")),
])
def test_what_this_builder_did_not_write_is_named_and_stays(
        small_spec: Path, copy: Path, capsys: pytest.CaptureFixture[str], change: Callable[[Path], None], name: str,
        options: list[str]) -> None:
    change(copy)
    before = tree(copy.parent)
    assert build(small_spec, copy, "seed=2", options=tuple(options)) == 2
    assert f"or a dataset of this builder, got other files: {name} (move them away, or choose another output folder; " \
           "no file was changed)" in capsys.readouterr().err
    assert tree(copy.parent) == before


@pytest.mark.parametrize("options", REPLACE)
@pytest.mark.parametrize("claim", [None, "{}", *(
    json.dumps({"format": "3df-lighting", "name": "small", "version": "1.0.0", "files": [file]})
    for file in ("../precious", "shards/../../precious.tar"))])
def test_a_folder_of_others_with_a_build_folder_in_it(small_spec: Path, tmp_path: Path, claim: str | None,
                                                      options: list[str]) -> None:
    out = tmp_path / "out"
    for name in ("../precious", "README.md", "shards/data.tar", ".build/staging/x"):
        (out / name).parent.mkdir(exist_ok=True, parents=True)
        written(name)(out)
    if claim is not None:
        (out / WORK / "claim.json").write_text(claim)
    before = tree(tmp_path)
    assert build(small_spec, out, options=tuple(options)) == 2 and tree(tmp_path) == before


def test_a_manifest_that_names_files_outside_is_none_of_ours(small_spec: Path, copy: Path) -> None:
    shutil.rmtree(copy / WORK)
    manifest = json.loads((copy / "dataset.json").read_bytes())
    manifest["shards"][0]["name"] = "../../precious.tar"
    (copy / "dataset.json").write_text(json.dumps(manifest))
    written("../precious.tar")(copy)
    before = tree(copy.parent)
    assert build(small_spec, copy, "name=other", options=("--replace",)) == 2 and tree(copy.parent) == before


def test_an_interrupted_build_of_another_dataset_is_refused(small_spec: Path, tmp_path: Path) -> None:
    assert build(small_spec, tmp_path / "out", *QUICK, options=("--example", "0")) == 0
    before = tree(tmp_path)
    assert build(small_spec, tmp_path / "out", *QUICK, "name=other") == 2 and tree(tmp_path) == before


def test_an_output_that_is_a_link_to_a_folder_is_that_folder(small_spec: Path, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert build(small_spec, tmp_path / "link", *QUICK) == 0
    assert (tmp_path / "link").is_symlink() and verify(tmp_path / "real") == []


def test_a_contact_sheet_that_cannot_be_written_is_a_warning(small_spec: Path, copy: Path, tmp_path: Path,
                                                             capsys: pytest.CaptureFixture[str]) -> None:
    link_to_a_file("previews/contact_sheet.png.partial")(copy)
    assert build(small_spec, copy) == 0 and verify(copy) == []
    said = capsys.readouterr().out
    assert "warning: no contact sheet (" in said and f"dataset: {copy}" in said
    assert (tmp_path / "precious").read_text() == "mine"


def test_an_edit_that_every_example_fails_leaves_the_old_dataset(small_spec: Path, copy: Path) -> None:
    before = contents(copy)
    assert build(small_spec, copy, "gates.coverage=[0.9, 0.95]", *QUICK) == 2
    assert contents(copy) == before and verify(copy) == []


@pytest.mark.parametrize("after", [0, 2])
def test_ctrl_c_leaves_the_old_dataset(small_spec: Path, copy: Path, monkeypatch: pytest.MonkeyPatch,
                                       after: int) -> None:
    from dataset_builder import builder as module

    before, seconds, run, units = contents(copy), (copy / "seconds.csv").read_bytes(), module.run_unit, iter(range(9))

    def interrupt(*arguments: Any) -> Any:
        if next(units) == after:
            raise KeyboardInterrupt
        return run(*arguments)

    monkeypatch.setattr(module, "run_unit", interrupt)
    assert build(small_spec, copy, "seed=2", "storage.examples_per_shard=1", *QUICK) == 130
    assert contents(copy) == before and verify(copy) == [] and (copy / "seconds.csv").read_bytes() == seconds
    assert len(list((next_of(copy) / "shards").glob("*.tar"))) == after
    monkeypatch.setattr(module, "run_unit", run)
    assert sorted(outcomes_of(run_build(small_spec, copy, "seed=2", "storage.examples_per_shard=1", *QUICK))) == \
        list(range(after, 3))


def spoil_digest(index: dict[str, Any]) -> None:
    index["examples"][1]["digest"] = "0" * 64


def spoil_pixels(index: dict[str, Any]) -> None:
    index["examples"][0]["members"][0]["pixel_digest"] = "0" * 64


@pytest.mark.parametrize("change", [spoil_digest, spoil_pixels, lambda index: index["versions"].pop("source"),
                                    lambda index: index["examples"].pop()])
def test_a_damaged_index_is_not_blessed_again(small_spec: Path, small_dataset: Path, copy: Path,
                                              change: Callable[[dict[str, Any]], Any]) -> None:
    path = index_path(copy, "small-v1-train-000001")
    index = json.loads(path.read_bytes())
    change(index)
    path.write_text(json.dumps(index, sort_keys=True, separators=(",", ":")) + "\n")
    sums = copy / "SHA256SUMS"
    sums.write_text(sums.read_text().replace(sha256_file(small_dataset / "index" / path.name), sha256_file(path)))
    assert sorted(outcomes_of(run_build(small_spec, copy))) == [2, 3]
    assert contents(copy) == contents(small_dataset)


@pytest.mark.parametrize("gone", ["dataset.json", "index/", "shards/", "README.md"])
def test_what_is_missing_is_made_again(small_spec: Path, small_dataset: Path, copy: Path, gone: str) -> None:
    path = next(copy / name for name in contents(copy) if name.startswith(gone))
    path.unlink()
    events = run_build(small_spec, copy)
    assert bool(outcomes_of(events)) == ("/" in gone)
    assert contents(copy) == contents(small_dataset)


def test_a_dataset_without_its_build_folder_is_kept(small_spec: Path, small_dataset: Path, copy: Path) -> None:
    shutil.rmtree(copy / WORK)
    assert outcomes_of(run_build(small_spec, copy)) == {} and contents(copy) == contents(small_dataset)


def test_an_edited_dataset_equals_a_fresh_one_names_included(small_spec: Path, copy: Path, tmp_path: Path) -> None:
    edit = ("title=Renamed", "storage.examples_per_shard=4")
    old = shard_path(copy, "small-v1-test-000000")
    run_build(small_spec, copy, *edit)
    run_build(small_spec, tmp_path / "fresh", *edit)
    assert contents(copy) == contents(tmp_path / "fresh") and verify(copy) == [] and not old.exists()
    assert len(open_dataset(copy)) == 10


def test_edits_that_are_killed_leave_the_old_or_the_new_dataset(tmp_path: Path) -> None:
    spec = write_spec(tmp_path / "spec")
    found = kill_edits(spec, QUICK, tmp_path / "out", count=6)
    assert found["wrong"] == 0 and found["old"] + found["new"] == 6
    run_build(spec, tmp_path / "out", *QUICK, *EDITS[1])
    run_build(spec, tmp_path / "fresh", *QUICK, *EDITS[1])
    assert files(tmp_path / "out") == files(tmp_path / "fresh")
