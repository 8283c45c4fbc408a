"""An index is the same whatever reads it, goes on where it stopped, and belongs to the code that made it."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from dataset_builder.errors import OutputError, UserError
from dataset_builder.importing import index_folder as module
from dataset_builder.importing.index_file import IndexFile
from dataset_builder.importing.index_folder import FolderIndex, IndexedFile, index_folder
from tests.front3d_files import house


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    """Six houses of different sizes and one file that is none."""
    folder = tmp_path / "scenes"
    folder.mkdir()
    for number in range(6):
        made = house()
        made.document["uid"] = f"house-{number}"
        made.document["scene"]["room"] = made.document["scene"]["room"][:1 + number % 3]
        (folder / f"{number}.json").write_text(json.dumps(made.document))
    (folder / "2b.json").write_text("{")
    (folder / "model_info.json").write_text("[]")
    (folder / ".hidden.json").write_text("{}")
    (folder / "notes.txt").write_text("")
    return folder




def index(scenes: Path, file: Path, *, workers: int = 1, made_by: str = "code", stop: int = 99) -> FolderIndex:
    def some(files: Iterable[IndexedFile], count: int) -> Iterator[IndexedFile]:
        for done, each in enumerate(files):
            if done == stop:
                raise KeyboardInterrupt
            yield each

    with IndexFile(file, made_by) as lines:
        return index_folder(scenes, lines, workers=workers, watch=some)


def test_the_same_lines_whatever_the_workers(scenes: Path, tmp_path: Path) -> None:
    one, two = index(scenes, tmp_path / "one", workers=1), index(scenes, tmp_path / "two", workers=2)
    assert one == two and (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert [scene.file for scene in one.scenes] == ["0.json", "1.json", "2.json", "2b.json", "3.json", "4.json",
                                                    "5.json"]
    assert [bool(scene.broken) for scene in one.scenes] == [False] * 3 + [True] + [False] * 3
    assert [len(scene.rooms) for scene in one.scenes] == [1, 2, 3, 0, 1, 2, 3]
    assert one.read == 7 and one.read_bytes == sum(scene.size for scene in one.scenes)


def test_another_order_of_arrival_is_mended(scenes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    index(scenes, tmp_path / "one")
    monkeypatch.setattr(module, "run", lambda work, units, workers: reversed([*map(work, units)]))
    index(scenes, tmp_path / "two", workers=2)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_an_interrupted_index_goes_on(scenes: Path, tmp_path: Path) -> None:
    whole = index(scenes, tmp_path / "whole")
    for stop in range(7):
        file = tmp_path / f"stopped-{stop}"
        with pytest.raises(KeyboardInterrupt):
            index(scenes, file, stop=stop)
        text = file.read_bytes()
        assert (tmp_path / "whole").read_bytes().startswith(text)
        # As if the process had died within the next line
        file.write_bytes((tmp_path / "whole").read_bytes()[:len(text) + 40])
        again = index(scenes, file)
        assert again.scenes == whole.scenes and again.read == 7 - stop
        assert file.read_bytes() == (tmp_path / "whole").read_bytes()


def test_files_are_known_by_their_bytes(scenes: Path, tmp_path: Path) -> None:
    file = tmp_path / "index"
    index(scenes, file)
    assert index(scenes, file).read == 0
    (scenes / "1.json").write_bytes((scenes / "2.json").read_bytes())
    (scenes / "3.json").unlink()
    changed = index(scenes, file)
    assert changed.read == 1 and [len(scene.rooms) for scene in changed.scenes] == [1, 3, 3, 0, 2, 3]
    with IndexFile(file, "code") as lines:
        told = {scene.file: scene.uid for scene, _ in lines.told()}
    assert told["1.json"] == "house-2" and len(told) == 7
    assert index(scenes, file, made_by="other code").read == 6


def test_faults_are_told_again_from_the_file(scenes: Path, tmp_path: Path) -> None:
    made = house()
    del made.mesh("Floor")["xyz"]
    (scenes / "0.json").write_text(json.dumps(made.document))
    index(scenes, tmp_path / "index")
    with IndexFile(tmp_path / "index", "code") as lines:
        told = {scene.file: [fault.kind for fault in faults] for scene, faults in lines.told()}
    assert told.pop("0.json") == ["faces with corners that are not there, left out", "meshes without faces, left out"]
    assert not any(told.values())


def test_nothing_else_is_written_over(scenes: Path, tmp_path: Path) -> None:
    for text in ("my notes\n", '{"format": "something"}\n'):
        (tmp_path / "notes").write_text(text)
        with pytest.raises(UserError, match="expected an index of 3D-FRONT scenes, got another file"):
            index(scenes, tmp_path / "notes")
        assert (tmp_path / "notes").read_text() == text
    (tmp_path / "link").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="link: cannot be written"):
        index(scenes, tmp_path / "link")
    assert not (tmp_path / "elsewhere").exists()


def test_a_name_that_cannot_be_written_is_passed_over(scenes: Path, tmp_path: Path) -> None:
    (scenes / "a\nb.json").write_bytes((scenes / "0.json").read_bytes())
    found = index(scenes, tmp_path / "index")
    assert [scene.broken.partition(":")[0] for scene in found.scenes if "\n" in scene.file] == [
        "its name holds control characters or bytes that are not UTF-8"]


@pytest.mark.parametrize(("make", "rule"), [
    ((), "expected a folder of 3D-FRONT scenes, got: No such file"),
    (("notes.txt",), "found no JSON file"), (("deep/a.json",), r"found no JSON file \(perhaps .*/deep\)")])
def test_a_folder_without_scenes(make: tuple[str, ...], rule: str, tmp_path: Path) -> None:
    for name in make:
        (tmp_path / "none" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "none" / name).write_text("{}")
    with pytest.raises(UserError, match=rule):
        index(tmp_path / "none", tmp_path / "index")
