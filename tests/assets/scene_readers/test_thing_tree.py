"""Which nodes of a glTF file are one thing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.assets.gltf_files import GltfMaker
from tests.assets.gltf_scenes import add_mesh, box_asset, names, scene

Tree = dict[str, "Tree | float"]
"""Names of nodes; a number is where along x a unit box stands."""


def tree_of(tree: Tree, made: GltfMaker | None = None) -> GltfMaker:
    made = made or GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))

    def add(name: str, below: "Tree | float") -> int:
        if isinstance(below, dict):
            return made.add("nodes", name=name, children=[add(*item) for item in below.items()])
        return made.add("nodes", name=name, mesh=mesh, translation=[below, 0, 0])

    for name, below in tree.items():
        add(name, below)
    return made


@pytest.mark.parametrize(("tree", "expected"), [
    ({"a": 0, "b": 5}, ["a", "b"]),
    ({"Room": {"Chair_01": {"seat": 0, "leg": 0.9}, "x": 9}}, ["Room/Chair_01", "Room/x"]),
    ({"Room": {"Chairs": {"Chair": 0, "Chair.001": 1}}}, ["Room/Chairs/Chair", "Room/Chairs/Chair.001"]),
    # A group without a name that tells: its pieces touch, and at most one of them says what it is
    ({"Room": {"Group12": {"Object_4": 0, "Object_5": 1}, "x": 9}}, ["Room/Group12", "Room/x"]),
    ({"Room": {"Group12": {"seat": 0, "b": 1}, "x": 9}}, ["Room/Group12", "Room/x"]),
    ({"Room": {"n1": {"a": 0, "b": 3}, "x": 9}}, ["Room/n1/a", "Room/n1/b", "Room/x"]),
    ({"Room": {"n1": {"bed": 0, "lamp": 1}, "x": 9}}, ["Room/n1/bed", "Room/n1/lamp", "Room/x"]),
    # What holds everything, or is called after a place, is no thing
    ({"export": {"root": {"a": 0, "b": 1}}}, ["export/root/a", "export/root/b"]),
    ({"all": {"Kitchen": {"a": 0, "b": 1}, "c": 9}}, ["all/Kitchen/a", "all/Kitchen/b", "all/c"]),
    ({"Sofa_03": {"a": 0, "b": 5}}, ["Sofa_03"]),
    # The highest node of a single mesh
    ({"scene": {"thing": {"mesh": 0}, "b": 5}}, ["scene/thing", "scene/b"]),
    ({"scene": {"Walls": {"w1": 0, "w2": 1}, "Floor_1": {"Chair": 2, "Bed": 3}}},
     ["scene/Walls", "scene/Floor_1/Chair", "scene/Floor_1/Bed"]),
])
def test_the_highest_node_that_is_one_object(tmp_path: Path, tree: Tree, expected: list[str]) -> None:
    assert names(scene(tree_of(tree), tmp_path)) == expected


def test_what_the_spec_names_is_a_thing_of_its_own(tmp_path: Path) -> None:
    tree: Tree = {"Room": {"Table": {"top": 0, "Vase": 1}, "set": {"a": 3, "b": 6}}}
    assert names(scene(tree_of(tree), tmp_path)) == ["Room/Table", "Room/set/a", "Room/set/b"]
    parts = [{"part": "object", "patterns": ["Room/Table/Vase", "Room/set", "*Tab*"]}]
    assert names(scene(tree_of(tree), tmp_path, parts=parts)) == ["Room/Table", "Room/Table/Vase", "Room/set"]


def test_what_a_group_is_may_show_in_its_pieces_and_their_meshes(tmp_path: Path) -> None:
    made = tree_of({"Room": {"Group12": {"seat_old": 0, "b": 1}, "x": 9, "Lamp": 12}})
    assert [thing.category for thing in scene(made, tmp_path).things] == ["chair", "object", "lamp"]
    made.header["meshes"][0]["name"] = "StoolMesh"
    assert [thing.category for thing in scene(made, tmp_path).things] == ["chair", "stool", "lamp"]


def test_a_mesh_whose_children_are_things_stands_alone(tmp_path: Path) -> None:
    made = GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))
    made.header["nodes"] = [{"name": "Room", "mesh": mesh, "children": [1, 2]},
                            {"name": "Bed", "mesh": mesh, "translation": [5, 0, 0]}, {"name": "Lamp", "mesh": mesh}]
    assert names(scene(made, tmp_path)) == ["Room", "Room/Bed", "Room/Lamp"]


def test_names_are_unique(tmp_path: Path) -> None:
    made = GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)), name="block")
    made.header["nodes"] = [{"name": "a", "mesh": mesh, "translation": [9 * k, 0, 0]} for k in range(3)]
    made.header["nodes"] += [{"mesh": mesh}, {"name": "a\x1b[2J", "mesh": mesh}]
    assert names(scene(made, tmp_path)) == ["a", "a_2", "a_3", "block", "a\\x1b[2J"]


def test_instances_are_things_of_their_own(tmp_path: Path) -> None:
    made = GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))
    places = {"TRANSLATION": made.accessor(np.array([[0, 0, 0], [3, 0, 0]], np.float32))}
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    made.add("nodes", name="plant", mesh=mesh, translation=[0, 1, 0], extensions=extensions)
    made.use("EXT_mesh_gpu_instancing", required=True)
    found = scene(made, tmp_path)
    assert names(found) == ["plant#1", "plant#2"] and found.things[0].asset is found.things[1].asset
    np.testing.assert_allclose([thing.world[:3, 3] for thing in found.things], [(0, 0, 1), (3, 0, 1)])


@pytest.mark.parametrize(("scale", "determinant"), [([-2, 1, 1], -2), ([1, 2, 3], 6)])
def test_affine_matrices_are_kept(tmp_path: Path, scale: list[float], determinant: float) -> None:
    made = GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))
    made.add("nodes", name="a", children=[1], rotation=[0, 0, 0.6, 0.8])
    made.add("nodes", name="thing", mesh=mesh, scale=scale)
    made.add("nodes", name="b", mesh=mesh, translation=[9, 0, 0])
    thing = scene(made, tmp_path, scale=0.5).things[0]
    assert np.linalg.det(thing.world[:3, :3]) == pytest.approx(determinant)
    assert thing.asset.mesh.volume == pytest.approx(0.125)  # of half a metre a side


def test_what_is_scaled_flat_or_to_nothing(tmp_path: Path) -> None:
    made = GltfMaker()
    mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))
    for name, scale in (("whole", [1, 1, 1]), ("flat", [1, 0, 1]), ("gone", [0, 0, 0])):
        made.add("nodes", name=name, mesh=mesh, scale=scale)
    found = scene(made, tmp_path)
    assert names(found) == ["whole", "flat"]
    assert len(found.faults) == 1 and found.faults[0].startswith("gone: mesh: expected at least one face with an area")


def nested(depth: int) -> list[dict[str, Any]]:
    return [{"children": [number + 1], "name": "n"} for number in range(depth)]


def test_nesting_is_bounded(tmp_path: Path) -> None:
    for depth, bad in ((98, False), (100, True)):
        made = GltfMaker()
        mesh = add_mesh(made, box_asset((0, 0, 0), (1, 1, 1)))
        made.header["nodes"] = [*nested(depth), {"mesh": mesh}]
        if bad:
            with pytest.raises(Exception, match=r"nodes\[100\]: expected nodes that nest at most 100 deep"):
                scene(made, tmp_path)
        else:
            assert names(scene(made, tmp_path)) == ["n"]
