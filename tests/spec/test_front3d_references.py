"""The files that a 3D-FRONT scene needs."""

import os
from pathlib import Path

import pytest

from dataset_builder.spec.front3d_references import front3d_references
from dataset_builder.spec.scene_files import SceneFolders, scene_files
from tests.front3d_files import house
from tests.front3d_pieces import jid_of

ONE = {"rooms": ("Kitchen-44",), "models": ("stool", "cabinet")}


def named(folder: Path) -> set[str]:
    found = front3d_references(folder / "house.json", folder / "models", folder / "textures")
    return {os.path.normpath(each.name) for each in found}


def test_models_textures_and_the_list_are_found(tmp_path):
    house(**ONE).write(tmp_path)
    files = {f"models/{jid_of(model)}/{name}" for model in ("stool", "cabinet")
             for name in ("raw_model.obj", "model.mtl")}
    there = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*") if file.is_file()}
    assert named(tmp_path) == there - {"house.json"} >= files


def test_what_is_missing_or_leads_elsewhere_is_none(tmp_path):
    made = house(**ONE)
    made.entry("stool")["jid"] = "../models/x"
    made.entry("cabinet")["jid"] = "nothing"
    made.material("wood")["jid"] = ["bbbb-wood"]
    made.write(tmp_path)
    assert named(tmp_path) == {"models/model_info.json"}
    assert list(front3d_references(tmp_path / "house.json", None, None)) == []


@pytest.mark.parametrize("document", ["[]", "{}", '{"furniture": 3, "material": [7, {}]}', '{"furniture": [null]}'])
def test_other_documents_name_nothing(tmp_path, document):
    (tmp_path / "house.json").write_text(document)
    assert named(tmp_path) == set()


def test_the_digest_is_of_all_files_wherever_they_lie(tmp_path):
    def digest(folder: Path, models: str = "models") -> str:
        return scene_files(SceneFolders.of(folder, "house.json", (), models, "textures")).digest

    made = house(**ONE)
    made.write(tmp_path / "a")
    first = digest(tmp_path / "a")
    made.write(tmp_path / "b")
    os.rename(tmp_path / "b" / "models", tmp_path / "models")
    assert digest(tmp_path / "b", "../models") == first
    for name in ("models/model_info.json", f"models/{jid_of('stool')}/model.mtl", "textures/bbbb-wood/texture.png"):
        made.write(tmp_path / "a")
        with (tmp_path / "a" / name).open("ab") as stream:
            stream.write(b"\n")
        assert digest(tmp_path / "a") != first
