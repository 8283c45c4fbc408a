"""Where nodes of glTF put meshes: matrices, scenes, instances, skins."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.file_model import FileModel
from dataset_builder.errors import UserError
from tests.assets.gltf_files import QUAD, GltfMaker

TURN = [0, 0, 0.5**0.5, 0.5**0.5]
"""A quarter turn about z: x to y."""


def with_nodes(*nodes: dict[str, Any], **header: Any) -> GltfMaker:
    """One quad as the file's only mesh."""
    made = GltfMaker()
    made.add("meshes", primitives=[made.primitive()])
    made.header |= {"nodes": list(nodes), **header}
    return made


def bounds(model: FileModel) -> list[list[float]]:
    places = np.concatenate([part.positions for part in model.parts])
    return [places.min(axis=0).tolist(), places.max(axis=0).tolist()]


def normal(part: Any) -> np.ndarray:
    a, b, c = part.positions[part.faces[0]]
    return np.cross(b - a, c - a)


def test_scale_then_rotation_then_translation(tmp_path: Path) -> None:
    model = with_nodes({"mesh": 0, "scale": [2, 1, 1], "rotation": TURN, "translation": [10, 0, 0]}).model(tmp_path)
    np.testing.assert_allclose(bounds(model), [(9, 0, 0), (10, 2, 0)], atol=1e-12)


def test_matrices_stand_by_columns_and_parents_come_last(tmp_path: Path) -> None:
    matrix = [0, 2, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1]
    nodes = {"mesh": 0, "matrix": matrix}, {"children": [0], "translation": [0, 5, 0], "scale": [1, 1, 3]}
    np.testing.assert_allclose(bounds(with_nodes(*nodes).model(tmp_path)), [(9, 5, 0), (10, 7, 0)])


@pytest.mark.parametrize("scale", [[-1, 1, 1], [1, 1, -1], [-1, -1, -1], [-1, -1, 1]])
def test_mirrored_nodes_keep_their_outside(tmp_path: Path, scale: list[float]) -> None:
    """A mirror turns the winding, which is undone: the front of the quad looks where the mirror puts it."""
    part, = with_nodes({"mesh": 0, "scale": scale}).model(tmp_path).parts
    np.testing.assert_allclose(normal(part), (0, 0, scale[2]))


def test_hierarchies_of_any_depth(tmp_path: Path) -> None:
    nodes = [{"children": [number + 1], "translation": [1, 0, 0]} for number in range(5000)]
    np.testing.assert_allclose(bounds(with_nodes(*nodes, {"mesh": 0}).model(tmp_path)), [(5000, 0, 0), (5001, 1, 0)])


@pytest.mark.parametrize(("nodes", "rule"), [
    ([{"children": [1]}, {"children": [0], "mesh": 0}], r"nodes\[0\].children: expected nodes that end somewhere"),
    ([{"children": [0], "mesh": 0}], "expected nodes that end somewhere"),
    ([{"children": [2]}, {"children": [2]}, {"mesh": 0}],
     r"nodes\[1\].children: expected nodes with one parent, got nodes\[2\] below nodes\[0\], too"),
    ([{"children": [7]}], r"nodes\[0\].children: expected whole numbers below 1, got 7"),
    ([{"mesh": 4}], r"nodes\[0\].mesh: expected a whole number in \[0, 0\], got 4"),
    ([{"mesh": 0, "matrix": [1] * 15}], r"matrix: expected 16 finite numbers"),
    ([{"mesh": 0, "matrix": [1] * 16}], r"matrix: expected an affine matrix, got a last row of \[1.0, 1.0, 1.0, 1.0\]"),
    ([{"mesh": 0, "matrix": np.eye(4).ravel().tolist(), "scale": [1, 1, 1]}], "got both"),
    ([{"mesh": 0, "scale": [1e31, 1, 1]}], r"scale: expected 3 finite numbers, got \[1e\+31, 1, 1\]")])
def test_nodes_that_cannot_be_placed(tmp_path: Path, nodes: list[dict[str, Any]], rule: str) -> None:
    with pytest.raises(UserError, match=rule):
        with_nodes(*nodes).model(tmp_path)


def test_matrices_that_send_vertices_to_infinity(tmp_path: Path) -> None:
    chain = [{"children": [number + 1], "scale": [1e29] * 3} for number in range(20)]
    with pytest.raises(UserError, match=r"nodes\[20\]: expected a matrix that keeps vertices finite"):
        with_nodes(*chain, {"mesh": 0}).model(tmp_path)


def test_the_scene_that_the_file_says_and_what_is_in_none(tmp_path: Path) -> None:
    nodes = {"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}, {"mesh": 0, "translation": [9, 0, 0]}
    scenes = {"scenes": [{"nodes": [0], "name": "day"}, {"nodes": [1], "name": "night"}]}
    model = with_nodes(*nodes, **scenes, scene=1).model(tmp_path)
    assert bounds(model) == [[5, 0, 0], [6, 1, 0]]
    assert model.left_out[0] == "2 nodes with a mesh in no scene that is read"
    assert "scenes[1] 'night' is taken, not scenes[0] 'day'" in model.left_out
    made = with_nodes(*nodes, **scenes)
    made.header["scenes"] = [{"nodes": [2]}, {"nodes": [0]}]
    made.finished = lambda: {**made.header, "buffers": [{"byteLength": len(made.binary)}]}  # type: ignore[method-assign]
    assert bounds(made.model(tmp_path))[0] == [9, 0, 0]
    made.header.pop("scenes")
    model = made.model(tmp_path)
    assert bounds(model) == [[0, 0, 0], [10, 1, 0]] and "no scene in the file: all nodes are taken" in model.left_out


def test_hidden_nodes_hide_what_is_below_them(tmp_path: Path) -> None:
    hide = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    model = with_nodes({"mesh": 0}, {"children": [2], **hide}, {"mesh": 0}).model(tmp_path)
    assert len(model.parts) == 1 and model.left_out[0] == "1 node with a mesh that the file hides"


def test_all_instances_are_drawn(tmp_path: Path) -> None:
    made = with_nodes({"mesh": 0, "translation": [0, 1, 0]})
    turns = np.array([[0, 0, 0, 127], [0, 0, 90, 90], [0, 0, 0, 127]], np.int8)
    attributes = {"TRANSLATION": made.accessor(np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0]], np.float32)),
                  "ROTATION": made.accessor(turns, normalized=True),
                  "SCALE": made.accessor(np.array([[1, 1, 1], [1, 1, 1], [-1, 1, 1]], np.float32)), "_ID": 0}
    made.header["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    made.use("EXT_mesh_gpu_instancing", required=True)
    model = made.model(tmp_path)
    lows = [part.positions.min(axis=0).tolist() for part in model.parts]
    np.testing.assert_allclose(lows, [(0, 1, 0), (1, 1, 0), (3, 1, 0)], atol=1e-12)
    assert all(normal(part)[2] > 0 for part in model.parts)
    assert model.contains == "1 mesh, 1 primitive, 2 triangles of 2, 0 materials, 0 images, in 3 places"
    attributes["SCALE"] = made.accessor(np.ones((2, 3), np.float32))
    with pytest.raises(UserError, match=r"all as long, got lengths \[2, 3\]"):
        made.model(tmp_path)


def test_what_nodes_place_is_bounded(tmp_path: Path) -> None:
    """A mesh of 200 000 vertices that 1 000 nodes place."""
    made = GltfMaker()
    many = np.random.default_rng(0).random((200_000, 3)).astype(np.float32)
    made.add("meshes", primitives=[made.primitive(many, np.array([0, 1, 2], np.uint32))])
    attributes = {"TRANSLATION": made.accessor(np.zeros((1000, 3), np.float32))}
    made.add("nodes", mesh=0, extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    with pytest.raises(UserError, match="expected at most 134,217,728 corners and vertices in all"):
        made.model(tmp_path)


def skinned(weights: np.ndarray, joints: np.ndarray | None = None, **skin: Any) -> GltfMaker:
    """The quad with its lower edge on joint 0 and its upper edge on joint 1, which has moved up by one."""
    made = GltfMaker()
    joints = np.array([[0, 1, 0, 0]] * 4, np.uint8) if joints is None else joints
    made.draw(made.primitive(JOINTS_0=joints, WEIGHTS_0=weights), skin=0, translation=[50, 0, 0])
    made.add("nodes", children=[2])
    made.add("nodes", translation=[0, 3, 0])
    binds = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    binds[1, 3, 1] = -2  # by columns: joint 1 was bound at y = 2
    made.add("skins", joints=[1, 2], inverseBindMatrices=made.accessor(binds.reshape(2, 16)), **skin)
    return made


def test_skins_move_with_their_joints_and_not_with_their_node(tmp_path: Path) -> None:
    weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0.5, 0.5, 0, 0]], np.float32)
    model = skinned(weights).model(tmp_path)
    moved = QUAD + np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0.5, 0]])
    np.testing.assert_allclose(model.parts[0].positions, moved)
    assert "skins in the pose that the nodes of the file have" in model.left_out
    doubled = skinned((255 * weights).astype(np.uint8)).model(tmp_path)
    assert doubled.parts[0].positions[2, 1] == pytest.approx(2)  # weights are made to add up to 1
    free = skinned(np.zeros((4, 4), np.float32)).model(tmp_path)
    np.testing.assert_allclose(free.parts[0].positions, QUAD + np.array([50, 0, 0]))


def test_skins_that_lack_something(tmp_path: Path) -> None:
    weights = np.array([[1, 0, 0, 0]] * 4, np.float32)
    with pytest.raises(UserError, match="expected joints below 2, got 7"):
        skinned(weights, np.full((4, 4), 7, np.uint8)).model(tmp_path)
    made = skinned(weights)
    del made.header["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"]
    with pytest.raises(UserError, match="expected JOINTS_0, since its node has a skin"):
        made.model(tmp_path)
    made = skinned(weights)
    made.header["skins"][0]["joints"] = [1, 2, 0]
    with pytest.raises(UserError, match=r"skins\[0\].inverseBindMatrices: expected 3 matrices, got 2"):
        made.model(tmp_path)


def test_what_moves_looks_and_lights_is_named(tmp_path: Path) -> None:
    lights = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    made = with_nodes({"mesh": 0}, {"camera": 0}, animations=[{"channels": [], "samplers": []}] * 2,
                      cameras=[{"type": "perspective"}], extensions=lights)
    made.use("KHR_lights_punctual", "ACME_sound")
    assert made.model(tmp_path).left_out[:-1] == ("2 animations", "1 camera", "1 light", "the extensions ACME_sound")


def test_extensions_that_the_file_does_not_declare_are_named(tmp_path):
    made = GltfMaker()
    made.draw(made.primitive(extensions={"ACME_tessellation": {}}), extensions={"ACME_lod": {}})
    made.header["extensions"] = {"ACME_sound": {}}
    assert "the extensions ACME_sound, ACME_tessellation, ACME_lod" in made.model(tmp_path).left_out
