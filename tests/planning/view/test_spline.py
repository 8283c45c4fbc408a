"""A path goes through its keys, is smooth, never rolls or flips, and has its views at equal lengths."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import towards
from dataset_builder.planning.view.spline import Flight, flight, plan_spline
from dataset_builder.planning.view.view_path import path_camera
from dataset_builder.seeding import rng
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.camera_path import SplineSpec
from dataset_builder.spec.render import ImageSpec

BoxStage = Callable[..., Arrangement]
CHAIR = ((-0.3, -0.25, 0.0), (0.3, 0.25, 0.9))
IMAGE = ImageSpec(width=64, height=48)
ABOUT = ({"azimuth": 0, "elevation": 10, "distance": 2}, {"azimuth": 100, "elevation": 50, "distance": 3},
         {"azimuth": 200, "elevation": 20, "distance": 2.5}, {"azimuth": 300, "elevation": 5, "distance": 2})
ROOM = ({"position": (-3.0, -2.0, 1.0)}, {"position": (0.0, -3.0, 2.0), "look_at": (0.0, 0.0, 1.0), "fov": 60},
        {"azimuth": 90, "elevation": 30, "distance": 2.5}, {"position": (2.0, 3.0, 1.5), "fov": 50})


def of(keys: Any, **more: Any) -> CameraSpec:
    return CameraSpec.model_validate({"coverage": (0.0, 1.0), "visibility": 0.0, "path": {
        "kind": "spline", "keys": keys, **more}})


def flown(arrangement: Arrangement, spec: CameraSpec) -> Flight:
    assert isinstance(spec.path, SplineSpec)
    return flight(arrangement, spec.path, spec, IMAGE, 45.0, 0.5)


@pytest.fixture
def hall(box_arrangement: BoxStage, room_of: Callable[..., RoomPlan]) -> Arrangement:
    return box_arrangement(CHAIR, room=room_of(12.0, 12.0, 8.0), yaw=30.0)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("keys", [ABOUT, ROOM])
def test_a_path_goes_through_all_its_keys_and_is_smooth(hall: Arrangement, keys: Any, closed: bool) -> None:
    found = flown(hall, of(keys, closed=closed))
    positions, aims = found.poses(found.knots)
    for key, position, aim, fov in zip(keys, positions, aims, found.fov(found.knots)[:, 0], strict=False):
        away = key.get("distance", 0) * towards(key.get("azimuth", 0) + 30, key.get("elevation", 0))
        assert position == pytest.approx(np.array(key["position"]) if "position" in key else hall.centre + away)
        assert aim == pytest.approx(hall.centre if key.get("look_at") is None else np.array(key["look_at"]))
        assert fov == pytest.approx(key.get("fov", 45))
    if closed:
        assert positions[-1] == pytest.approx(positions[0])
    # Velocity does not jump at keys, nor where a closed path closes
    step = 1e-4
    ends = [found.knots[-1], *found.knots[1:-1]] if closed else found.knots[1:-1]
    for knot in ends:
        after = found.knots[0] if knot == found.knots[-1] else knot
        before, there = (found.poses(at + step * np.array([-2.0, -1.0, 0.0, 1.0, 2.0]))[0] for at in (knot, after))
        left, right = (before[2] - before[1]) / step, (there[3] - there[2]) / step
        assert np.abs(left - right).max() < 1e-2 * (1 + np.abs(left).max())


@pytest.mark.parametrize(("keys", "closed"), [(ABOUT, False), (ABOUT, True), (ROOM, False), (ROOM, True)])
def test_views_are_at_equal_lengths_level_and_never_flip(hall: Arrangement, keys: Any, closed: bool) -> None:
    spec = of(keys, closed=closed)
    found, at = flown(hall, spec), flown(hall, spec).even(200, closed=closed)
    places = found.poses(at)[0]
    steps = np.linalg.norm(np.diff(np.vstack([places, places[:1]]) if closed else places, axis=0), axis=1)
    assert steps == pytest.approx(np.full(len(steps), steps.mean()), rel=0.02)
    assert isinstance(spec.path, SplineSpec)
    path = plan_spline(hall, spec.path, spec, IMAGE, 200, rng(0), "")
    bases = np.array([view.pinhole.basis for view in path.frames])
    assert np.abs(bases[:, 0, 2]).max() < 1e-12 and (bases[:, 1, 2] > 0).all()
    # Neighbours see nearly the same way, right and up: no view is turned over against the one before
    for axis in range(3):
        assert np.einsum("ni,ni->n", bases[1:, axis], bases[:-1, axis]).min() > 0.97
    if not closed:
        assert places[0] == pytest.approx(found.poses(found.knots[:1])[0][0])
        assert places[-1] == pytest.approx(found.poses(found.knots[-1:])[0][0])


def test_a_closed_ring_of_four_keys_is_near_a_circle(hall: Arrangement) -> None:
    """In azimuth, elevation and distance it is one: the spline of equal steps is a straight line."""
    spec = of([{"azimuth": angle, "elevation": 20, "distance": 2} for angle in (0, 90, 180, 270)], closed=True)
    places = flown(hall, spec).poses(flown(hall, spec).even(8, closed=True))[0] - hall.centre
    expected = [2 * towards(30 + 45 * k, 20) for k in range(8)]
    assert places == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_two_opposite_keys_closed_go_once_round(hall: Arrangement, sign: int) -> None:
    """On as they went, not back the same way: neither view is another's."""
    spec = of([{"azimuth": 0, "distance": 2}, {"azimuth": 180 * sign, "distance": 2}], closed=True)
    places = flown(hall, spec).poses(flown(hall, spec).even(4, closed=True))[0] - hall.centre
    expected = [2 * towards(30 + 90 * sign * k, 0) for k in range(4)]
    assert places == pytest.approx(np.array(expected), abs=1e-6)


def test_without_a_distance_the_object_is_as_large_as_asked(hall: Arrangement) -> None:
    spec = CameraSpec.model_validate({"coverage": (0.05, 0.4), "path": {"kind": "spline", "closed": True, "keys": [
        {"azimuth": 0, "elevation": 20}, {"azimuth": 120, "elevation": 40}, {"azimuth": 240, "elevation": 20}]}})
    assert isinstance(spec.path, SplineSpec)
    path = plan_spline(hall, spec.path, spec, IMAGE, 9, rng(1), "")
    views = [path_camera(hall, path, spec, k, "") for k in range(9)]
    assert all(0.05 <= view.camera.coverage <= 0.4 and view.camera.visibility == 1 for view in views)
    again = plan_spline(hall, spec.path, spec, IMAGE, 9, rng(1), "")
    assert (again.frames[4].pinhole.position == path.frames[4].pinhole.position).all()


def test_what_cannot_be_had_is_named(hall: Arrangement) -> None:
    spec = of([{"position": (0.0, -2.0, 1.0)}, {"position": (0.0, -9.0, 1.0)}])
    assert isinstance(spec.path, SplineSpec)
    path = plan_spline(hall, spec.path, spec, IMAGE, 3, rng(0), "")
    assert path_camera(hall, path, spec, 1, "turn/000001").camera.position == pytest.approx((0.0, -5.5, 1.0))
    with pytest.raises(PlanError, match=r"turn/000002: camera\.path: expected view 2 of the spline \(at \[0\.00, "
                                        r"-9\.00, 1\.00\]\) .* got: outside the room at any coverage "
                                        r"\(distances needed: [0-9.]+ m\) \(.*give the scene `space`"):
        path_camera(hall, path, spec, 2, "turn/000002")
    over = of([{"position": (0.0, -1.0, 3.0)}, {"position": (0.0, 1.0, 3.0)}])
    assert isinstance(over.path, SplineSpec)
    with pytest.raises(PlanError, match=r"looks at most 85 degrees up or down, got 90\.0 between keys 0 and 1"):
        plan_spline(hall, over.path, over, IMAGE, 3, rng(0), "")


@pytest.mark.parametrize(("keys", "rule"), [
    ([{"azimuth": 0}], "at least 2 items"),
    ([{"azimuth": 0}, {"azimuth": 0, "fov": 30}], "expected a key that differs from the one before"),
    ([{"azimuth": 0}, {"azimuth": 3601}], "expected at most 3600 degrees from the key before, got 3601"),
    ([{"azimuth": 0}, {"azimuth": 0, "position": (0, 0, 1)}], "exactly one of `azimuth` and `position`, got both"),
    ([{"azimuth": 0}, {"elevation": 5}], "exactly one of `azimuth` and `position`, got neither"),
    ([{"azimuth": 0}, {"position": (0, 0, 1), "elevation": 5}], "expected no `elevation` beside `position`"),
    ([{"azimuth": 0}, {"azimuth": 5, "look_at": (0, 0, 1)}], "expected `position` beside `look_at`"),
    ([{"azimuth": 0}, {"position": (0, 0, 1), "look_at": "sky"}], "expected object or three numbers"),
    ([{"azimuth": 0}, {"position": (0, 0, 1), "look_at": (0, 0, 1)}], "expected a point other than `position`"),
])
def test_keys_that_say_nothing_or_two_things_are_refused(keys: Any, rule: str) -> None:
    with pytest.raises(ValidationError, match=rule):
        of(keys)
