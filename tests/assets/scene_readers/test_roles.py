"""Which part of a building a thing is: by the spec, by names, by shapes."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.scene_model import Role, SceneThing
from dataset_builder.assets.scene_readers.parted_building import face_roles
from dataset_builder.assets.scene_readers.roles import classified, role_of, says_object
from dataset_builder.geometry.mesh import TriangleMesh, concatenate
from dataset_builder.label.scene_source import PartPatterns, SceneSource
from tests.assets.gltf_scenes import box_mesh

Box = tuple[tuple[float, float, float], tuple[float, float, float]]
FLOOR: Box = ((-2, -2, -0.1), (2, 2, 0))
CEILING: Box = ((-2, -2, 2.5), (2, 2, 2.6))
WALL: Box = ((-2, 2, 0), (2, 2.1, 2.5))
CHAIR: Box = ((0, 0, 0), (0.5, 0.5, 0.9))
BODY: Box = ((-2, -2, 0), (2, 2, 2.5))


def thing(name: str, mesh: TriangleMesh | Box, role: Role = "object", category: str = "object") -> SceneThing:
    mesh = mesh if isinstance(mesh, TriangleMesh) else box_mesh(*mesh)
    asset = Asset(name=name, category="", mesh=mesh, materials=(Material(name="m", base_color=(1, 1, 1)),))
    return SceneThing(name=name, category=category, role=role, asset=asset, world=np.eye(4), content=name)


def roles(*things: SceneThing, **parts: tuple[str, ...]) -> dict[str, str]:
    said = tuple(PartPatterns.model_validate({"part": part, "patterns": each}) for part, each in parts.items())
    found, _ = classified(things, SceneSource(parts=said))
    return {each.name: each.role for each in found}


@pytest.mark.parametrize(("name", "role"), [
    ("floor", "floor"), ("Floor.001", "floor"), ("groundPlane", "floor"), ("WallInner", "walls"), ("Walls", "walls"),
    ("wall_left_02", "walls"), ("Window_3", "walls"), ("Door", "walls"), ("Ceiling", "ceiling"), ("Roof", "ceiling"),
    ("CustomizedCeiling", "ceiling"), ("Baseboard", "walls"), ("Cornice", "ceiling"),
    ("Chair", None), ("floor_lamp", None), ("WallClock", None), ("cabinet_door", None), ("ceiling fan", None),
    ("wall-art", None), ("DoorMat", None), ("Curtain", None), ("carpet", None), ("Wallpaper", None),
    ("Object_4", None)])
def test_words(name: str, role: str | None) -> None:
    assert role_of(name) == role
    assert role is None or not says_object(name)


def test_what_comes_first() -> None:
    """The spec, then what the reader knows, then names, then categories; the last pattern that fits holds."""
    things = [thing("a/Wall_1", CHAIR), thing("a/Wall_2", CHAIR, role="floor"), thing("b", CHAIR, category="window"),
              thing("Wall/x", CHAIR)]
    assert roles(*things) == {"a/Wall_1": "walls", "a/Wall_2": "floor", "b": "walls", "Wall/x": "object"}
    said = roles(*things, object=("a/*",), ceiling=("*_2", "b"))
    assert said == {"a/Wall_1": "object", "a/Wall_2": "ceiling", "b": "ceiling", "Wall/x": "object"}


def test_slabs_by_where_they_lie() -> None:
    found = roles(thing("A", FLOOR), thing("B", CEILING), thing("C", WALL), thing("D", CHAIR),
                  thing("rug", ((-1, -1, 0), (1, 1, 0.02))), thing("E", ((-1, -1, 0), (0, 0, 0.02))),
                  thing("shelf", ((-2, 1.8, 0), (2, 2, 2.4))))
    assert found == {"A": "floor", "B": "ceiling", "C": "walls", "D": "object", "rug": "object", "E": "object",
                     "shelf": "object"}
    assert roles(thing("Plane", ((-5, -5, 0), (5, 5, 0.01)))) == {"Plane": "floor"}


def test_only_what_encloses_the_rest_is_parted() -> None:
    assert set(roles(thing("A", BODY), thing("B", CHAIR)).values()) == {"floor", "walls", "ceiling", "object"}
    beside = ((5.0, 0.0, 0.0), (5.5, 0.5, 0.5))
    assert roles(thing("A", BODY), thing("B", beside)) == {"A": "object", "B": "object"}
    low = ((-2.0, -2.0, 0.0), (2.0, 2.0, 1.5))
    assert roles(thing("A", low), thing("B", CHAIR)) == {"A": "object", "B": "object"}
    assert roles(thing("Wardrobe", BODY), thing("B", CHAIR)) == {"Wardrobe": "object", "B": "object"}
    # Alone, with a floor below its middle
    assert set(roles(thing("A", BODY))) == {"A#floor", "A#walls", "A#ceiling"}
    found, decided = classified([thing("A", BODY)], SceneSource())
    assert decided == ("A is the building in one mesh: parted into floor, walls, ceiling by how its faces lie",)
    assert len({each.content for each in found}) == 3
    assert roles(thing("A", BODY), walls=("A#ceiling",))["A#ceiling"] == "walls"


def of_boxes(*boxes: Box) -> tuple[TriangleMesh, np.ndarray]:
    """A mesh of boxes and the number of the box of each face."""
    return concatenate([box_mesh(*box) for box in boxes]), np.repeat(np.arange(len(boxes)), 12)


def test_faces_of_a_house_of_slabs() -> None:
    """Two storeys: the slab between them is floor above and ceiling below; the roof's upper side is no floor."""
    middle = ((-2.0, -2.0, 2.5), (2.0, 2.0, 2.7))
    roof = ((-2.0, -2.0, 5.2), (2.0, 2.0, 5.3))
    table = ((0.0, 0.0, 0.7), (0.8, 0.8, 0.75))
    mesh, box = of_boxes(FLOOR, middle, roof, ((-2, 2, 0), (2, 2.1, 5.2)), table)
    up = mesh.area_normals[:, 2]
    found = face_roles(mesh)
    assert set(found[(box == 0) & (up > 0)]) == {0} and set(found[(box == 0) & (up < 0)]) == {0}
    assert set(found[(box == 1) & (up > 0)]) == {0} and set(found[(box == 1) & (up < 0)]) == {2}
    assert set(found[(box == 2) & (up != 0)]) == {2}
    assert set(found[box == 3]) == {1}
    assert set(found[box == 4]) == {1}


def test_a_room_without_a_ceiling_has_none() -> None:
    """The tops of its walls are no ceiling; a single sheet is a floor."""
    sheet = TriangleMesh(positions=np.array([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]]),
                         faces=np.array([[0, 1, 2], [0, 2, 3]]), uvs=np.zeros((2, 3, 2)), material=np.zeros(2))
    mesh = concatenate([sheet, box_mesh(*WALL)])
    found = face_roles(mesh)
    assert found[:2].tolist() == [0, 0] and set(found[2:]) == {1}


def test_names_are_patterns_without_brackets(tmp_path: Path) -> None:
    assert roles(thing("W[1]", CHAIR), thing("W1", CHAIR), walls=("W[1]",)) == {"W[1]": "walls", "W1": "object"}
