"""Lights and cameras of scene files in whole plans, from the spec on."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import PlanError, UserError
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import read_meshes
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import DATASET, SPEC, WORLD_FROM_FILE, write_dataset

LAMPS = {"Key": (-1.5, -1.5, 2.2, 900.0), "Fill": (1.5, -1.5, 2.0, 300.0)}
"""Place in the world, and candela."""
CAMERAS = {"Left": (-1.2, -1.8, 1.3), "Right": (1.2, -1.8, 1.3), "Back": (0.0, -1.8, 1.2)}
AHEAD = {"Left": (-0.7, 0.2, 0.4), "Right": (-0.5, 0.2, 0.4), "Back": (0.0, -9.0, 1.2)}
CHAIR_ONLY = DATASET.replace('things: {name: "*"}, count: 2', 'things: {name: "Chair*"}, count: 1')


def planned(folder: Path, lights: str = "", cameras: str = "random", dataset: str = CHAIR_ONLY) -> list[ExamplePlan]:
    """Plans of the stage with its lamps and cameras; `lights` is YAML."""
    path = write_dataset(folder, dataset=dataset, scene=f"{SPEC}  cameras: {cameras}\n"
                         + (f"  lights: {lights}\n" if lights else ""))
    stage = json.loads((folder / "stage.gltf").read_text())
    nodes = stage["nodes"]
    for number, (name, (x, y, z, _)) in enumerate(LAMPS.items()):
        nodes.append({"name": name, "matrix": _node(np.eye(3), (x, y, z)),
                      "extensions": {"KHR_lights_punctual": {"light": number}}})
    for number, (name, place) in enumerate(CAMERAS.items()):
        right, up, forward = look_at(place, AHEAD[name])
        nodes.append({"name": name, "camera": number, "matrix": _node(np.stack([right, up, -forward], axis=1), place)})
    lamps = [{"type": "point", "intensity": candela} for *_, candela in LAMPS.values()]
    perspective: dict[str, Any] = {"yfov": 0.9, "aspectRatio": 1.2, "znear": 0.1}
    stage |= {"extensionsUsed": ["KHR_lights_punctual"], "extensions": {"KHR_lights_punctual": {"lights": lamps}},
              "cameras": [{"type": "perspective", "perspective": perspective}] * len(CAMERAS),
              "scenes": [{"nodes": [*range(len(nodes))]}]}
    (folder / "stage.gltf").write_text(json.dumps(stage))
    planner = Planner(load_dataset(path))
    return [planner.example(ref) for ref in planner.examples]


def _node(axes: np.ndarray, place: tuple[float, float, float]) -> list[float]:
    world = np.eye(4)
    world[:3, :3], world[:3, 3] = axes, place
    found: list[float] = (np.linalg.inv(WORLD_FROM_FILE) @ world).T.ravel().tolist()
    return found


def with_lights(count: int, strength: str = "2") -> str:
    return CHAIR_ONLY.replace("scenes:", f"lights: {count}\n    scenes:") + f"target: {{strength: {strength}}}\n"


def test_kept_lights_stand_where_the_file_has_them(tmp_path: Path) -> None:
    [plan] = planned(tmp_path, "{use: kept, dim: {Fill: 0.5}}")
    key, fill = plan.target_light.lights
    assert key.position == pytest.approx(LAMPS["Key"][:3]) and fill.position == pytest.approx(LAMPS["Fill"][:3])
    assert key.radiance[0] / fill.radiance[0] == pytest.approx(6) and min(key.weight, fill.weight) > 0
    [note] = [note for note in plan.notes if note.startswith("lights of the scene: ")]
    assert "Key, Fill, times" in note and "Fill dimmed to 0.5" in note


def test_added_lights_come_after_the_drawn_and_replaced_ones_are_named(tmp_path: Path) -> None:
    [added] = planned(tmp_path / "a", "{use: added}")
    [replaced] = planned(tmp_path / "b")
    assert len(added.target_light.lights) == len(replaced.target_light.lights) + 2
    assert added.camera == replaced.camera
    assert any(note.endswith("; lights of the scene replaced: Key, Fill") for note in replaced.notes)


def test_several_lights_of_a_view_differ_or_are_refused(tmp_path: Path) -> None:
    first, second = planned(tmp_path / "a", "{use: kept}", dataset=with_lights(2, "{uniform: [1, 3]}"))
    assert first.target_light != second.target_light and first.view == second.view
    with pytest.raises(PlanError, match=r"light 1: splits\[\]\.lights: expected 1 light for each view"):
        planned(tmp_path / "b", "{use: kept}", dataset=with_lights(2))


def test_own_cameras_are_taken_in_order_and_named(tmp_path: Path) -> None:
    dataset = CHAIR_ONLY.replace("scenes:", "views: 2\n    scenes:")
    plans = sorted(planned(tmp_path, "{use: kept}", "own", dataset), key=lambda plan: plan.camera.position)
    assert [plan.camera.position for plan in plans] == [pytest.approx(CAMERAS[name]) for name in ("Left", "Right")]
    for plan, name in zip(plans, ("Left", "Right"), strict=True):
        assert any(note.startswith(f"camera: {name} of the scene") for note in plan.notes)
        ahead = np.subtract(AHEAD[name], CAMERAS[name])
        assert np.subtract(plan.camera.target, plan.camera.position) == pytest.approx(ahead / np.linalg.norm(ahead))
        assert np.tan(np.radians(plan.camera.fov) / 2) == pytest.approx(1.2 * np.tan(0.45))


def test_more_views_than_cameras_that_see_the_target_are_refused(tmp_path: Path) -> None:
    dataset = CHAIR_ONLY.replace("scenes:", "views: 3\n    scenes:")
    with pytest.raises(PlanError, match=r"expected at least 3 cameras of the scene .* got 2 of 3: .*Back: coverage 0"):
        planned(tmp_path, cameras="own", dataset=dataset)


@pytest.mark.parametrize(("lights", "said"), [
    ("{use: kept, dim: {Fil: 0.5}}", "dim.Fil: expected the name of a light in stage.gltf, got 'Fil' (nearest known "
                                     "light: Fill)"),
    ("{dim: {Fill: 0.5}}", "use: expected `kept` or `added` beside `dim` and `scale`, got replaced"),
    ("{use: kept, dim: {Fill: -1}}", "dim.Fill: expected in [0, 1e+06], got -1"),
    ("{use: kept, scale: 0}", "scale: expected > 0, got 0"),
    ("{use: kept, scale: big}", "scale: expected a number above 0 or auto, got 'big'")])
def test_mistakes_about_lights_are_told_with_their_line(lights: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(UserError) as caught:
        planned(tmp_path, lights)
        read_meshes(Planner(load_dataset(tmp_path / "dataset.yaml")))
    assert str(caught.value) == f"{tmp_path}/scene.yaml:5: file.lights.{said}"
