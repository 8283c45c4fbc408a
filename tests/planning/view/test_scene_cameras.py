"""Cameras of scene files: the k-th that sees the target as the dataset asks."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.scene_model import SceneCamera
from dataset_builder.errors import PlanError
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import PlannedCamera
from dataset_builder.planning.view.scene_cameras import own_camera
from dataset_builder.planning.view.visibility import look
from dataset_builder.spec.render import ImageSpec
from tests.planning.view.test_cameras import CHAIR, camera_spec, frame_of

BoxStage = Callable[..., Arrangement]


def camera(name: str, position: tuple[float, float, float], towards: tuple[float, float, float] = (0, 0, 0.45),
           up: tuple[float, float, float] = (0.0, 0.0, 1.0), fov: float = 50.0) -> SceneCamera:
    ahead = np.subtract(towards, position) / np.linalg.norm(np.subtract(towards, position))
    x, y, z = (np.array(position) + ahead).tolist()
    return SceneCamera(name=name, position=position, target=(x, y, z), up=up, fov=fov)


AWAY = camera("/Away", (0.0, -1.5, 1.0), (0.0, -5.0, 1.0))
FRONT, SIDE = camera("/Front", (0.0, -1.7, 1.0)), camera("/Side", (1.7, -0.2, 1.2), up=(0.0, 0.6, 0.8))
FAR = camera("/Far", (0.3, -1.7, 1.0), fov=140.0)


def planned(arrangement: Arrangement, number: int, image: ImageSpec | None = None, **spec: Any) -> PlannedCamera:
    return own_camera(arrangement, (AWAY, FRONT, FAR, SIDE), camera_spec(**({"coverage": (0.05, 0.6)} | spec)),
                      image or ImageSpec(), number, "train/0")


def test_views_take_those_that_see_the_target_in_order(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR)
    first, second = planned(arrangement, 0), planned(arrangement, 1)
    for found, own in ((first, FRONT), (second, SIDE)):
        plan = found.camera
        assert (plan.position, plan.target, plan.up, plan.fov) == (own.position, own.target, own.up, own.fov)
        assert own.name in found.note and 0.05 <= plan.coverage <= 0.6
        sight = look(arrangement, frame_of(plan, ImageSpec()))
        assert (sight.coverage, sight.visibility) == (plan.coverage, plan.visibility)
    assert "number 2 of" in second.note


def test_the_horizontal_field_of_view_is_kept_at_any_aspect(box_arrangement: BoxStage) -> None:
    wide, square = (planned(box_arrangement(CHAIR), 0, ImageSpec(width=128, height=height)) for height in (64, 128))
    assert wide.camera.fov == square.camera.fov == 50
    assert square.camera.coverage < wide.camera.coverage


def test_a_camera_close_to_things_is_the_authors_choice(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR, (((-0.3, -1.9, 0.0), (0.3, -1.71, 1.5)),))
    assert "/Front" in planned(arrangement, 0, clearance=0.5).note


def test_too_few_cameras_are_refused_with_what_each_sees(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR)
    with pytest.raises(PlanError) as caught:
        planned(arrangement, 2)
    text = str(caught.value)
    assert text.startswith("train/0: camera: expected at least 3 cameras of the scene that see the object")
    assert "got 2 of 4: " in text and "/Away: coverage 0.000, visibility 0.00" in text and "cameras: random" in text
    assert text.index("/Front: coverage") < text.index("/Far: coverage") < text.index("/Away")
    with pytest.raises(PlanError, match=r"expected a camera of the scene that sees .* got none of 0 "):
        own_camera(arrangement, (), camera_spec(), ImageSpec(), 0, "")
    many = [camera(f"/C{k}", (0.0, -1.5, 1.0), (0.0, -5.0, 1.0)) for k in range(20)]
    with pytest.raises(PlanError, match="12 more that see less"):
        own_camera(arrangement, many, camera_spec(), ImageSpec(), 0, "")
