"""See-through faces of scenes from files: they hide nothing from planning, and take up place all the same."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material, Texture, see_through
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.planning.effects.reach import reach
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.mesh_shell import MeshShell, shell_of
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import DATASET, at, thing, write_dataset
from tests.planning.scene.houses import ROOM, box, walled

CHAIR = thing("Chair_01", at(0, 0, 0, (0.5, 0.5, 0.9)), (0.7, 0.2, 0.1))
FLOOR = thing("Floor", at(0, 0, -0.1, (4, 4, 0.1)), (0.5, 0.45, 0.4))
CASE = thing("Case", at(0, 0, 0, (0.7, 0.7, 1.1)), (0.9, 0.9, 0.8))
KINDS: dict[str, dict[str, Any]] = {
    "pane": {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}},
    "solid": {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.8},
                             "KHR_materials_volume": {"thicknessFactor": 0.1}}},
    "cut-out": {"alphaMode": "BLEND"}}
WHITE = np.ones((2, 2, 3), np.float32)


def arranged(folder: Path, kind: str, *others: dict[str, Any], name: str = "Case") -> Arrangement:
    """A chair in a case, the thing called `name` of a kind of material."""
    things = [FLOOR, CHAIR, CASE, *others]
    path = write_dataset(folder, things, DATASET.replace('{name: "*"}, count: 2', "{name: Chair_01}, count: 1"))
    stage = json.loads((folder / "stage.gltf").read_text())
    material = stage["materials"][[each["name"] for each in things].index(name)]
    material |= KINDS.get(kind, {})
    if kind == "cut-out":
        material["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.5
    stage["extensionsUsed"] = ["KHR_materials_transmission", "KHR_materials_volume"]
    (folder / "stage.gltf").write_text(json.dumps(stage))
    planner = Planner(load_dataset(path))
    return planner.arrangement(planner.examples[0].view.pair)


@pytest.mark.parametrize("kind", ["opaque", *KINDS])
def test_a_target_is_seen_in_a_case_of_glass_and_in_no_other(kind: str, tmp_path: Path) -> None:
    found = arranged(tmp_path, kind)
    eye, into = np.array([[0.0, -1.5, 0.5]]), np.array([[0.0, 1.0, 0.0]])
    number, distance = found.everything.first_hit(eye, into)
    assert (number[0] == 1, distance[0]) == ((False, pytest.approx(1.15)) if kind == "opaque" else
                                             (True, pytest.approx(1.25)))
    assert len(found.clear) == (kind != "opaque")
    # A camera keeps away from the glass, too
    assert found.surfaces.distance(np.add(eye, (0.0, 1.1, 0.0)))[0] == pytest.approx(0.05)
    assert found.shell.inside(eye[0], 0.1, found.centre)


@pytest.mark.parametrize("kind", KINDS)
def test_a_see_through_target_keeps_its_faces(kind: str, tmp_path: Path) -> None:
    found = arranged(tmp_path, kind, name="Chair_01")
    assert found.alone.first_hit(np.array([[0.0, -1.5, 0.5]]), np.array([[0.0, 1.0, 0.0]]))[0] == [1]
    assert not found.clear


def windowed(clear: bool) -> MeshShell:
    """A closed room, of which one wall may be see-through."""
    building = walled(5, 4, 2.5)
    wall = [building.pop(2)]
    found = shell_of(ROOM, building, (), (wall, ())) if clear else shell_of(ROOM, [*building, *wall], ())
    assert isinstance(found, MeshShell)
    return found


def test_light_from_outside_comes_through_a_wall_of_glass() -> None:
    dome = LightPlan(kind="dome", position=(0, 0, 0), direction=(0, 0, -1), size=0, cutoff=0, radiance=(1, 1, 1),
                     temperature=6500, weight=1)
    assert not reach(dome, windowed(False), (), (2.5, 2.0, 0.0)).kept
    assert reach(dome, windowed(True), (), (2.5, 2.0, 0.0)).kept
    # The floor and the margin of what is there stay as they are
    assert windowed(True).said == windowed(False).said
    near = np.array([4.95, 2.0, 1.0])
    assert not windowed(True).inside(near, 0.1, np.array([2.5, 2.0, 0.5]))


def test_a_table_of_glass_and_a_floor_of_glass_take_up_place() -> None:
    building, table = walled(5, 4, 2.5), [box((1, 1, 0), (3, 3, 0.7), 3)]
    floor = [building[0]]
    solid = shell_of(ROOM, building, table)
    for clear in (shell_of(ROOM, building, (), ((), table)), shell_of(ROOM, building[1:], table, (floor, ()))):
        assert isinstance(clear, MeshShell) and isinstance(solid, MeshShell)
        assert clear.said == solid.said and solid.said != shell_of(ROOM, building, ()).said


@pytest.mark.parametrize(("fields", "expected"), [
    ({}, [0, 0, 0]), ({"transmission": 0.5}, [1, 1, 1]), ({"transmission": 0.5, "thin": True}, [1, 1, 1]),
    ({"transmission": 1.0, "metallic": 1.0}, [0, 0, 0]), ({"alpha": 0.9}, [1, 1, 1]),
    ({"alpha": 0.9, "alpha_cutoff": 0.5}, [0, 0, 0]), ({"alpha_cutoff": 0.5}, [0, 0, 0]),
    ({"alpha": 0.9, "alpha_cutoff": 0.8}, [0, 0, 1]), ({"colored": True}, [0, 0, 1]),
    ({"texture": Texture(base_color=WHITE, alpha=np.array([[1, 1], [1, 0.0]], np.float32))}, [1, 1, 1]),
    ({"texture": Texture(base_color=WHITE, transmission=np.ones((2, 2), np.float32))}, [0, 0, 0])])
def test_which_faces_let_light_through(fields: dict[str, Any], expected: list[int]) -> None:
    """The last face has a corner with a coverage of 0.7, where vertices have colours; another material is opaque."""
    fields = dict(fields)
    colors = np.ones((4, 3, 4), np.float32)
    colors[2, 1, 3] = 0.7
    colored = fields.pop("colored", False) or fields.get("alpha_cutoff") == 0.8
    mesh = TriangleMesh(positions=np.eye(3), faces=np.tile([0, 1, 2], (4, 1)), uvs=np.zeros((4, 3, 2)),
                        material=np.array([1, 1, 1, 0]), colors=colors if colored else None)
    plain = Material(name="plain", base_color=(1, 1, 1))
    asset = Asset(name="a", category="a", mesh=mesh,
                  materials=(plain, Material(name="m", base_color=(1, 1, 1), **fields)))
    assert see_through(asset).tolist() == [bool(each) for each in (*expected, 0)]


def test_a_scene_knows_which_parts_it_has(tmp_path: Path) -> None:
    assert arranged(tmp_path / "a", "opaque").shell.parts == ("floor",)
    roof = thing("Ceiling", at(0, 0, 2.5, (4, 4, 0.1)))
    assert arranged(tmp_path / "b", "opaque", roof).shell.parts == ("floor", "ceiling")
