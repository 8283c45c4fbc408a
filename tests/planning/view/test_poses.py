"""Cameras from files are where the file has them: round trip, both layouts, and what is refused or told."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.pose_readers.capture import Lens
from dataset_builder.assets.pose_readers.transforms_json import read_transforms_poses
from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.view.poses import lens_error, lens_fov
from dataset_builder.spec.pose_files import find_poses
from dataset_builder.spec.resolve import LoadedSpec
from tests.capture_files import FLIP, Made, orbit

Load = Callable[..., LoadedSpec]
ROOM = {"width": 9, "depth": 9, "height": 5}


@pytest.fixture
def filmed(load: Load, dataset_data: dict[str, Any], tmp_path: Path) -> Callable[..., LoadedSpec]:
    """A spec whose split `eval` has a path, beside which its file lies."""

    def make(path: dict[str, Any], views: int = 8, **camera: Any) -> LoadedSpec:
        dataset_data["splits"][1] |= {"views": views, "objects": {"from": ["chair.yaml"], "count": 1}, "camera": {
            "coverage": (0.0, 1.0), "visibility": 0.0, "path": path, **camera}}
        loaded = load(dataset_data, room=ROOM, scene={"room": "room.yaml", "space": 1.8})
        document = type("Named", (), {"data": {"splits": (None, dataset_data["splits"][1])}, "problem": None})
        return replace(loaded, pose_files=find_poses(document, tmp_path)[0])  # type: ignore[arg-type]

    return make


def cameras(loaded: LoadedSpec) -> list[CameraPlan]:
    planner = Planner(loaded)
    return [planner.example(ref).camera for ref in planner.examples
            if ref.view.pair.split == "eval" and (ref.light, ref.level) == (0, 0)]


def write(file: Path, plans: list[CameraPlan], width: int, height: int, **more: Any) -> None:
    frames = [{"camera_angle_x": float(np.radians(plan.fov)),
               "transform_matrix": Pinhole.of(plan, width, height).opengl_pose.tolist()} for plan in plans]
    file.write_text(json.dumps({"w": width, "h": height, "frames": frames, **more}))


@pytest.mark.parametrize("about", ["room", "object"])
def test_planned_cameras_come_back(filmed: Callable[..., LoadedSpec], tmp_path: Path, about: str) -> None:
    before = filmed({"kind": "orbit", "elevation": (5, 80)}, fov={"uniform": [40, 60]})
    planned, size = cameras(before), before.dataset.image
    moved = planned
    if about == "object":
        stands = Planner(before).view(next(ref.view for ref in Planner(before).examples
                                           if ref.view.pair.split == "eval")).arrangement
        yaw = np.radians(-stands.target.yaw)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        moved = [plan.model_copy(update={name: tuple((turn @ (np.array(getattr(plan, name)) - stands.centre) * 100
                                                      ).tolist()) for name in ("position", "target")})
                 for plan in planned]
    write(tmp_path / "cameras.json", moved, size.width, size.height)
    found = cameras(filmed({"kind": "poses", "file": "cameras.json", "about": about,
                            "scale": 1.0 if about == "room" else 0.01}))
    for ours, theirs in zip(planned, found, strict=True):
        for name, value in ours.model_dump().items():
            assert getattr(theirs, name) == pytest.approx(value, abs=1e-6), name


def test_a_rolled_camera_keeps_its_roll(filmed: Callable[..., LoadedSpec], tmp_path: Path) -> None:
    level, size = cameras(filmed({"kind": "orbit", "elevation": (5, 60)}, views=3)), (64, 48)
    rolled = [plan.model_copy(update={"up": (0.5, 0.2, 0.8)}) for plan in level]
    write(tmp_path / "cameras.json", rolled, *size)
    found = cameras(filmed({"kind": "poses", "file": "cameras.json", "about": "room"}, views=3))
    for ours, theirs in zip(rolled, found, strict=True):
        assert Pinhole.of(theirs, *size).opencv_pose == pytest.approx(Pinhole.of(ours, *size).opencv_pose, abs=1e-9)
        assert np.linalg.norm(theirs.up) == pytest.approx(1) and abs(theirs.up[2]) < 0.999


@pytest.mark.parametrize("binary", [True, False])
def test_a_model_of_colmap_has_the_same_cameras_as_transforms(filmed: Callable[..., LoadedSpec], tmp_path: Path,
                                                              binary: bool) -> None:
    made = Made(poses=orbit(8), size=(64, 48), focal=80.0)
    made.write_colmap(tmp_path / "model", binary=binary, shots=False, model="PINHOLE")
    made.write_transforms(tmp_path / "nerf", images=False)
    found = [cameras(filmed({"kind": "poses", "file": name})) for name in ("model", "nerf")]
    assert [plan.fov for plan in found[0]] == pytest.approx([np.degrees(2 * np.arctan(32 / 80))] * 8)
    for ours, theirs in zip(*found, strict=True):
        assert ours.position == pytest.approx(theirs.position) and ours.up == pytest.approx(theirs.up)
    # Y up, as three.js has it, is Z up here: what was up, stays up
    up = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1.0]])
    made.write_transforms(tmp_path / "y", images=False, change=lambda document: [frame.update(
        transform_matrix=(up @ np.array(frame["transform_matrix"])).tolist()) for frame in document["frames"]])
    assert [plan.position for plan in cameras(filmed({"kind": "poses", "file": "y/transforms.json", "up": (0, 1, 0)}))
            ] == [pytest.approx(plan.position) for plan in found[1]]


def test_fewer_views_are_spread_and_lenses_are_told(filmed: Callable[..., LoadedSpec], tmp_path: Path) -> None:
    made = Made(poses=orbit(10), size=(64, 48), focal=80.0)
    made.write_transforms(tmp_path / "nerf", images=False, change=lambda document: document.update(cx=32.5, fl_y=80.4))

    def notes(**path: Any) -> str:
        planner = Planner(filmed({"kind": "poses", "file": "nerf", **path}, views=5))
        return " ".join(planner.example(next(ref for ref in planner.examples if ref.view.pair.split == "eval")).notes)

    assert "poses: 5 of 10 of nerf, evenly spread; its principal points" in notes() and "aspect: the hor" in notes()
    assert "its lenses are not used, 50 degrees are given" in notes(fov=50)
    whole, few = (cameras(filmed({"kind": "poses", "file": "nerf"}, views=count)) for count in (10, 5))
    assert [plan.position for plan in few] == [whole[k].position for k in (1, 3, 5, 7, 9)]


def test_how_far_a_lens_is_from_a_pinhole() -> None:
    lens = Lens(size=(100, 50), focal=(50.0, 50.0), centre=(50.0, 25.0))
    assert lens_error(lens) == 0 and lens_fov(lens) == pytest.approx(90)
    assert lens_error(replace(lens, centre=(53.0, 29.0))) == pytest.approx(0.05)
    assert lens_error(replace(lens, focal=(50.0, 60.0))) == pytest.approx(0.05)
    # At the corner x = 1, y = 0.5: radius 1.118, squared 1.25
    assert lens_error(replace(lens, bend=(0.1, 0, 0, 0))) == pytest.approx(0.1 * 1.25 * 1.25**0.5 / 2)
    assert lens_fov(Lens(size=(0, 0), focal=(0.0, 0.0), centre=(0.0, 0.0), angle=np.pi / 3)) == pytest.approx(60)


@pytest.mark.parametrize(("change", "path", "rule"), [
    (lambda document: document.pop("frames"), {}, "json: frames: expected a value, the key is missing"),
    (lambda document: document["frames"].pop(), {},
     "expected at least as many poses as the 8 `views` of the split, got 7"),
    (lambda document: document.update(cx=40), {}, r"moves pixels by 12\.5% of the width"),
    (lambda document: document.pop("fl_x") and document.pop("w"), {}, "expected a field of view of 1 to 170 degrees"),
    (lambda document: document["frames"][3].update(transform_matrix=(2 * np.eye(4)).tolist()), {},
     "expected a rotation, determinant 1, in the pose of images/view_003.png"),
    (lambda document: document["frames"][3].update(transform_matrix=(-np.eye(4)).tolist()), {"fov": 45},
     "scale and mirroring"),
])
def test_what_is_no_camera_is_refused(filmed: Callable[..., LoadedSpec], tmp_path: Path, change: Any,
                                      path: dict[str, Any], rule: str) -> None:
    Made(poses=orbit(8), size=(64, 48), focal=80.0).write_transforms(tmp_path / "nerf", images=False, change=change)
    with pytest.raises(PlanError, match=rule) as caught:
        cameras(filmed({"kind": "poses", "file": "nerf", **path}))
    assert caught.value.problems[0].path == "splits[1].camera.path.file"


def test_a_pose_costs_the_same_however_many_there_are(tmp_path: Path) -> None:
    """1,500 poses take half a second; read with the whole file for each, they took twenty."""
    file, then = tmp_path / "cameras.json", process_time()
    file.write_text(json.dumps({"camera_angle_x": 0.8, "frames": [{"transform_matrix": np.eye(4).tolist()}] * 1500}))
    assert len(read_transforms_poses(file).shots) == 1500 and process_time() - then < 5


def test_a_fault_of_all_poses_is_told_of_a_few(filmed: Callable[..., LoadedSpec], tmp_path: Path) -> None:
    Made(poses=orbit(8), size=(64, 48), focal=80.0).write_transforms(
        tmp_path / "nerf", images=False, change=lambda document: document.update(cx=40))
    with pytest.raises(PlanError) as caught:
        cameras(filmed({"kind": "poses", "file": "nerf"}))
    rules = [problem.rule for problem in caught.value.problems]
    assert ["view_004" in rule for rule in rules] == [False] * 4 + [True, False]
    assert rules[-1].startswith("expected no fault in any pose, got 8 of 8 with one")


def test_a_file_that_changed_is_not_taken(filmed: Callable[..., LoadedSpec], tmp_path: Path) -> None:
    made = Made(poses=orbit(8), size=(64, 64), focal=80.0)
    made.write_transforms(tmp_path / "nerf", images=False)
    loaded = filmed({"kind": "poses", "file": "nerf"})
    made.write_transforms(tmp_path / "nerf", images=False, change=lambda document: document.update(fl_x=90))
    with pytest.raises(PlanError, match="the file that was there when the spec was read"):
        cameras(loaded)
    assert FLIP.shape == (4, 4)
