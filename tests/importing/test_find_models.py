import doctest
import json
import os
from pathlib import Path

import pytest

from dataset_builder.errors import UserError
from dataset_builder.importing import find_models as module
from dataset_builder.importing.find_models import FoundModel, file_names, find_models

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def put(root: Path, *names: str) -> None:
    for name in names:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(OBJ)


def test_examples_of_the_docstrings() -> None:
    assert doctest.testmod(module).failed == 0


def test_folders_are_searched_to_the_bottom(tmp_path: Path) -> None:
    put(tmp_path, "b/chair one.obj", "a/deep/er/\u6905\u5b50.PLY", "a/notes.txt", ".hidden/x.obj", "a/.y.obj",
        "a/old.fbx")
    found, left = find_models([tmp_path])
    assert [model.path.relative_to(tmp_path).as_posix() for model in found] == ["a/deep/er/\u6905\u5b50.PLY",
                                                                                 "b/chair one.obj"]
    assert [(one.path.name, one.reason) for one in left] == [("old.fbx", "FBX is not read: export glTF from Blender")]
    assert [folder.name for folder in found[0].folders] == ["er", "deep", "a", tmp_path.name]


def test_a_file_named_twice_is_one(tmp_path: Path) -> None:
    put(tmp_path, "a.obj")
    found, _ = find_models([tmp_path / "a.obj", tmp_path, tmp_path / "a.obj"])
    assert len(found) == 1


def test_what_another_model_names_is_no_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(tmp_path, "whole.obj", "parts/leg.obj")
    monkeypatch.setattr(module, "companions",
                        lambda path: ("parts/leg.obj",) if path.name == "whole.obj" else ())
    found, left = find_models([tmp_path])
    assert [model.path.name for model in found] == ["whole.obj"] and not left


def test_folders_of_3d_future_name_their_models(tmp_path: Path) -> None:
    put(tmp_path, "0a1b/raw_model.obj", "0a1b/normalized_model.obj", "lone/normalized_model.obj", "meshes/model.obj")
    found, left = find_models([tmp_path])
    assert [model.title for model in found] == ["0a1b", "lone", tmp_path.name]
    assert [(one.path.name, one.reason) for one in left] == [
        ("normalized_model.obj", "a copy of raw_model.obj beside it")]


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        find_models([tmp_path / "a", tmp_path, tmp_path / "b.obj"])
    assert [problem.where for problem in caught.value.problems] == [str(tmp_path / "a"), str(tmp_path / "b.obj")]
    (tmp_path / "x.fbx").write_text("")
    with pytest.raises(UserError, match=r"x\.fbx: FBX is not read[^\n]*\nexpected model files .*found none"):
        find_models([tmp_path])


def test_file_names_differ_on_every_file_system() -> None:
    assert file_names(["A b", "a B", "a/b", "a b_2", "///", "..", "con\ttrol"]) == [
        "A_b", "a_B_2", "a_b_3", "a_b_2_2", "model", "model_2", "con_trol"]


def test_names_that_no_spec_can_hold_are_told(tmp_path: Path) -> None:
    put(tmp_path, "a\nb.obj", "fine.obj")
    (tmp_path / os.fsdecode(b"\xff.obj")).write_text(OBJ)
    found, left = find_models([tmp_path])
    assert [model.path.name for model in found] == ["fine.obj"]
    assert len(left) == 2 and all("rename it" in one.reason for one in left)


def test_parts_of_a_gltf_stay_parts(tmp_path: Path) -> None:
    header = {"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 4}]}
    (tmp_path / "a.gltf").write_text(json.dumps(header))
    put(tmp_path, "textures/plain.png")
    found, _ = find_models([tmp_path])
    assert found == [FoundModel(path=tmp_path / "a.gltf", root=tmp_path)]


def test_captures_are_no_models(tmp_path: Path) -> None:
    put(tmp_path, "a.obj", "chair.npz")
    found, left = find_models([tmp_path])
    assert [model.path.name for model in found] == ["a.obj"] and not left
