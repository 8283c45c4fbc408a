"""Colours that are the same at all vertices of a part: the colour of its material."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.file_model import FileMaterial, FileModel, FilePart
from dataset_builder.assets.mesh_file import load_mesh_file, model_asset
from dataset_builder.label.scene_plan import MaterialChange, Param
from dataset_builder.planning.scene.material_changes import changed
from tests.assets.scene_readers.usd_stages import METRES, mesh, prim, scene

ORANGE, GLASSY = (1.0, 0.2158605, 0.0, 1.0), (1.0, 0.2158605, 0.0, 0.5)


def part(*colors: tuple[float, float, float, float], material: int = -1) -> FilePart:
    """A triangle with a colour for each of its corners, one for all, or none."""
    made = np.array(colors * (3 // len(colors)), np.float32)[None] if colors else None
    return FilePart(name="part", positions=np.eye(3), faces=np.array([[0, 1, 2]]),
                    material=material, colors=made)


def asset_of(*parts: FilePart, names: tuple[str, ...] = ()) -> Asset:
    parts = tuple(replace(each, positions=each.positions + rank) for rank, each in enumerate(parts))
    materials = tuple(FileMaterial(material=Material(name=name, base_color=(1, 1, 1))) for name in names)
    return model_asset(FileModel(parts=parts, materials=materials, contains=""), np.eye(4), name="a", category="a",
                       licence="CC0-1.0")


def test_a_part_of_one_colour_has_a_material_of_it() -> None:
    made = asset_of(part(ORANGE), part(GLASSY), part(), part(ORANGE))
    assert [(each.name, *each.base_color, each.alpha) for each in made.materials] == [
        ("colour ff8000", *map(pytest.approx, ORANGE)), ("colour ff800080", *map(pytest.approx, GLASSY)),
        ("no material", 0.6, 0.6, 0.6, 1.0)]
    assert made.mesh.colors is None and made.mesh.material.tolist() == [0, 1, 2, 0]


def test_colours_that_differ_or_tint_a_material_stay() -> None:
    varied = (ORANGE, ORANGE, GLASSY)
    made = asset_of(part(*varied), part(ORANGE), part(ORANGE, material=0), names=("paint",))
    assert [each.name for each in made.materials] == ["paint", "colour ff8000", "vertex colours"]
    assert made.mesh.material.tolist() == [2, 1, 0] and made.mesh.colors is not None
    assert made.mesh.colors == pytest.approx(np.array([varied, [(1, 1, 1, 1)] * 3, [ORANGE] * 3]))


def test_colours_too_near_for_their_bytes_keep_names_of_their_own() -> None:
    near = (1.0, 0.2158, 0.0, 1.0)
    made = asset_of(part(ORANGE), part(near), part(material=0), names=("colour ff8000",))
    assert [each.name for each in made.materials] == ["colour ff8000", "colour ff8000_2", "colour ff8000_3"]


def test_changes_of_materials_mean_it_by_its_name() -> None:
    made = asset_of(part(ORANGE), part(GLASSY))
    matt = (Param(name="roughness", value=0.25),)
    for name, expected in (("colour ff8000", [0.25, 0.8]), ("colour *", [0.25, 0.25])):
        found = changed(made.materials, [MaterialChange(name=name, values=matt)], "a")
        assert [each.roughness for each in found] == expected


@pytest.mark.parametrize("suffix", ["ply", "obj"])
def test_mesh_files_of_one_colour(suffix: str, tmp_path: Path) -> None:
    rows = {"ply": "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                   "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
                   "property list uchar int vertex_indices\nend_header\n"
                   "0 0 0 255 128 0\n1 0 0 255 128 0\n0 1 1 255 128 0\n3 0 1 2\n",
            "obj": "v 0 0 0 1 0.50196 0\nv 1 0 0 1 0.50196 0\nv 0 1 1 1 0.50196 0\nf 1 2 3\n"}
    (tmp_path / f"a.{suffix}").write_text(rows[suffix])
    made = load_mesh_file(tmp_path / f"a.{suffix}", name="a", category="a", licence="CC0-1.0")
    assert [each.name for each in made.materials] == ["colour ff8000"] and made.mesh.colors is None
    assert made.materials[0].base_color == pytest.approx(ORANGE[:3], abs=1e-4)


def test_display_colours_of_a_stage(tmp_path: Path) -> None:
    color = 'color3f[] primvars:displayColor = [(1, 0.2158605, 0)]\nfloat[] primvars:displayOpacity = [0.5]'
    [found] = scene(tmp_path, METRES + prim("Mesh", "Cup", mesh(), color)).things
    assert [each.name for each in found.asset.materials] == ["colour ff800080"] and found.asset.mesh.colors is None
