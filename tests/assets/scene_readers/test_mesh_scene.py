"""Mesh files as scenes: groups of .obj files, files of one thing, other files that they name, damaged ones."""

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_model import SceneModel
from dataset_builder.errors import UserError
from dataset_builder.label.scene_source import SceneSource
from tests.assets.gltf_files import COLORS, QUAD_UVS, GltfMaker, glb, png
from tests.assets.gltf_scenes import load, names, world_corners
from tests.assets.readers.test_gltf_fuzz import SEEDS, changed

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 6 1 0\n"
SETTINGS = settings(max_examples=100, deadline=None, derandomize=True, database=None,
                    suppress_health_check=[HealthCheck.function_scoped_fixture])


def obj_scene(folder: Path, text: str) -> SceneModel:
    (folder / "a.obj").write_text(SQUARE + text)
    return load(folder / "a.obj")


@pytest.mark.parametrize(("text", "expected"), [
    ("o Table\nf 1 2 3\no Chair\nf 5 6 7\n", {"Table": 1, "Chair": 1}),
    ("g Table\nf 1 2 3\ng Chair\nf 5 6 7\ng Table\nf 1 3 4\n", {"Table": 2, "Chair": 1}),
    # Groups part nothing where there are objects
    ("f 1 2 3\no Table\ng top\nf 1 3 4\ng legs\nf 5 6 7\n", {"a": 1, "Table": 2}),
    ("f 1 2 3 4\n", {"a": 2})])
def test_objects_or_groups_are_things(tmp_path: Path, text: str, expected: dict[str, int]) -> None:
    found = obj_scene(tmp_path, text)
    assert {thing.name: len(thing.asset.mesh.faces) for thing in found.things} == expected
    whole = load_mesh_file(tmp_path / "a.obj", name="a", category="", licence="")
    assert sum(expected.values()) == len(whole.mesh.faces)


def test_things_take_the_materials_that_they_use(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nTf 0.5 0.5 0.5\n")
    found = obj_scene(tmp_path, "mtllib a.mtl\no A\nusemtl red\nf 1 2 3\no B\nusemtl blue\nf 5 6 7\n")
    assert [[each.name for each in thing.asset.materials] for thing in found.things] == [["red"], ["blue"]]
    assert found.left_out[0].startswith("blue: ")
    other = obj_scene(tmp_path, "mtllib a.mtl\no A\nusemtl blue\nf 1 2 3\n").things[0]
    assert other.content != found.things[0].content


def test_a_group_without_area_is_a_fault(tmp_path: Path) -> None:
    found = obj_scene(tmp_path, "o A\nf 1 2 3\no B\nf 1 1 1\n")
    assert names(found) == ["A"] and len(found.faults) == 1 and found.faults[0].startswith("B: mesh: expected")
    with pytest.raises(UserError, match="expected things with triangles, got none"):
        obj_scene(tmp_path, "o B\nf 1 1 1\n")


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".off"])
def test_files_of_one_thing(tmp_path: Path, suffix: str) -> None:
    text = {".off": "OFF\n3 1 0\n0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n",
            ".ply": "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
                    "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n0 2 0\n"
                    "3 0 1 2\n",
            ".stl": "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 2 0\nendloop\n"
                    "endfacet\nendsolid\n"}[suffix]
    (tmp_path / f"room{suffix}").write_text(text)
    found = load(tmp_path / f"room{suffix}", scale=0.5, up="y")
    assert names(found) == ["room"]
    np.testing.assert_allclose(world_corners(found.things)[0], [(0, 0, 0), (1, 0, 0), (0, 0, 1)], atol=1e-12)


def textured(uri: str) -> GltfMaker:
    made = GltfMaker()
    made.add("images", uri=uri)
    made.add("textures", source=0)
    material = made.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=material), name="thing")
    return made


def test_files_elsewhere_need_a_root(tmp_path: Path) -> None:
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "a.png").write_bytes(png(COLORS))
    textured("../maps/a.png").write(folder / "a.glb")
    with pytest.raises(UserError, match=r"images\[0\].uri: expected a file in the folder of the mesh or below it, got"):
        load(folder / "a.glb")
    found = load(folder / "a.glb", roots=("../maps",))
    assert found.things[0].asset.materials[0].texture is not None
    with pytest.raises(UserError, match="or in one of"):
        load(folder / "a.glb", roots=("../other",))


def test_another_texel_is_another_content(tmp_path: Path) -> None:
    found = []
    for texels in (COLORS, COLORS, 255 - COLORS):
        (tmp_path / "a.png").write_bytes(png(texels))
        source = SceneSource(source="a.glb")
        textured("a.png").write(tmp_path / "a.glb")
        found.append(load_scene(source, tmp_path, max_texture=2 - len(found)).things[0].content)
    assert found[0] == found[1] != found[2]  # the size of textures does not count


def test_what_materials_say_and_is_not_honoured_is_named(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive(material=made.add("materials", name="m", occlusionTexture={"index": 0})))
    assert load(made.write(tmp_path / "a.glb")).left_out[0] == "m: occlusionTexture (light that is baked in)"


def test_files_that_are_no_scene(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="expected an existing file, got none"):
        load(tmp_path / "a.glb")
    (tmp_path / "a.fbx").write_bytes(b"")
    with pytest.raises(UserError, match="expected a scene file that ends in one of"):
        load(tmp_path / "a.fbx")


def rich_scene() -> tuple[dict[str, Any], bytes]:
    """What the other fuzz test reads, with names, lights and cameras."""
    header, binary = copy.deepcopy(SEEDS[0])
    for number, node in enumerate(header["nodes"]):
        node["name"] = ("Room", "Chair_01", "wall")[number % 3]
    header["nodes"].append({"name": "lamp", "camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}})
    header["scenes"][0]["nodes"].append(len(header["nodes"]) - 1)
    header["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "aspectRatio": 2}}]
    spot = {"innerConeAngle": 0.1, "outerConeAngle": 0.5}
    header["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": 5, "color": [1, 1, 1], "range": 3, "spot": spot}]}}
    return header, binary


RICH = rich_scene()


def test_the_seed_is_whole(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(glb(*RICH))
    found = load(tmp_path / "a.glb")
    assert len(found.things) >= 5 and len(found.lights) == len(found.cameras) == 1


@SETTINGS
@given(chosen=st.data())
def test_any_change_of_the_json(tmp_path: Path, chosen: st.DataObject) -> None:
    header = changed(RICH[0], chosen)
    (tmp_path / "a.glb").write_bytes(glb(json.dumps(header).encode(), RICH[1]))
    try:
        found = load(tmp_path / "a.glb")
    except UserError as error:
        assert str(error).startswith((str(tmp_path), "expected the package"))
        return
    assert len({thing.name for thing in found.things}) == len(found.things)
    for thing in found.things:
        assert np.isfinite(thing.world).all() and len(thing.asset.mesh.faces)


@SETTINGS
@given(text=st.lists(st.sampled_from(["o A\n", "g B\n", "f 1 2 3\n", "f 1 3 4\n", "f 1 9 2\n", "o\n", "usemtl x\n",
                                      "f -1 -2 -3\n", "v 1 2 nan\n", "v 9e29 0 0\n", "#", "\\\n"]), max_size=12))
def test_any_lines_of_an_obj(tmp_path: Path, text: list[str]) -> None:
    try:
        found = obj_scene(tmp_path, "".join(text))
    except UserError as error:
        assert str(error).startswith(str(tmp_path))
        return
    assert found.things
