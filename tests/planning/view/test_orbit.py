"""Views on equal areas in order, at one distance, one light for all of them; what cannot be had is refused by name."""

from collections.abc import Callable
from math import asin, pi, radians, sin, sqrt
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.catalogue import views_of
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import PlannedCamera, place_camera, towards
from dataset_builder.planning.view.lit_view import LIT_AROUND, POINTS, lit_view, together
from dataset_builder.planning.view.orbit import plan_orbit, spiral
from dataset_builder.planning.view.view_path import ViewPath, path_camera
from dataset_builder.seeding import rng
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.camera_path import OrbitSpec
from dataset_builder.spec.render import ImageSpec

BoxStage = Callable[..., Arrangement]
CHAIR = ((-0.3, -0.25, 0.0), (0.3, 0.25, 0.9))
IMAGE = ImageSpec(width=64, height=64)


def orbit_spec(**more: Any) -> CameraSpec:
    orbit = {"path": {"kind": "orbit", "azimuth": 0}}
    return CameraSpec.model_validate({"fov": 45, "coverage": (0.05, 0.6)} | orbit | more)


def planned(arrangement: Arrangement, spec: CameraSpec, views: int, seed: int = 0) -> ViewPath:
    assert isinstance(spec.path, OrbitSpec)
    return plan_orbit(arrangement, spec.path, spec, IMAGE, views, rng(seed))


def distance_of(orbit: ViewPath) -> float:
    first = orbit.frames[0].pinhole
    return float(np.linalg.norm(first.position - first.target))


def views_on(arrangement: Arrangement, spec: CameraSpec, views: int, seed: int = 0) -> list[PlannedCamera]:
    orbit = planned(arrangement, spec, views, seed)
    return [path_camera(arrangement, orbit, spec, k, "turn/000000") for k in range(views)]


@pytest.mark.parametrize(("views", "band"), [(100, (0.0, 90.0)), (37, (-30.0, 60.0)), (400, (10.0, 45.0))])
def test_heights_are_uniform_and_neighbours_are_as_near_as_equal_areas_let_them(views: int,
                                                                                band: tuple[float, float]) -> None:
    azimuths, elevations = spiral(views, band)
    low, high = (sin(radians(bound)) for bound in band)
    # Archimedes: equal heights are equal areas
    heights = np.sin(np.radians(elevations))
    assert heights == pytest.approx(low + (np.arange(views) + 0.5) / views * (high - low))
    assert azimuths[0] == 0 and (np.diff(azimuths) > 0).all()
    ways = np.array([towards(a, e) for a, e in zip(azimuths, elevations, strict=True)])
    # The side of a square as large as a view's share of the band
    side = sqrt(2 * pi * (high - low) / views)
    steps = np.arccos(np.clip((ways[1:] * ways[:-1]).sum(axis=1), -1, 1))
    assert steps.max() < 1.1 * side and steps.min() > 0.85 * side
    # Nothing else comes much nearer than a neighbour, so that no part is denser
    apart = np.arccos(np.clip(ways @ ways.T, -1, 1)) + 9 * np.eye(views)
    assert apart.min(axis=1).min() > 0.6 * side


@pytest.mark.parametrize("views", [100, 1000])
def test_means_over_views_are_those_over_the_semi_sphere(views: int) -> None:
    """z is 1/2 on average, squares 1/3, products 0; independent draws would be off by 0.3 / sqrt(V) or so. The lower
    edge of a spiral is a slope and not a circle, which x and y are off by."""
    ways = np.array([towards(a, e) for a, e in zip(*spiral(views, (0.0, 90.0)), strict=True)])
    x, y, z = ways.T
    means = [np.mean(value) for value in (z, x * x, y * y, z * z, x * z, y * z)]
    assert means == pytest.approx([1 / 2, 1 / 3, 1 / 3, 1 / 3, 0, 0], abs=0.3 / views)
    assert [x.mean(), y.mean()] == pytest.approx([0, 0], abs=0.42 / sqrt(views))


def test_a_ring_has_equal_steps_and_a_narrow_band_goes_once_round() -> None:
    azimuths, elevations = spiral(12, (20.0, 20.0))
    assert azimuths == pytest.approx(30 * np.arange(12)) and elevations == pytest.approx(np.full(12, 20.0))
    azimuths, elevations = spiral(50, (20.0, 20.5))
    assert azimuths[-1] == pytest.approx(360 * 49 / 50, rel=0.01) and np.ptp(elevations) < 0.5


def test_all_views_have_one_distance_and_aim_at_the_middle(box_arrangement: BoxStage,
                                                           room_of: Callable[..., RoomPlan]) -> None:
    arrangement = box_arrangement(CHAIR, room=room_of(12.0, 12.0, 8.0), yaw=30.0)
    spec = orbit_spec(path={"kind": "orbit", "azimuth": 20})
    found = views_on(arrangement, spec, 40)
    away = np.array([view.camera.position for view in found]) - arrangement.centre
    assert np.linalg.norm(away, axis=1) == pytest.approx(np.full(40, np.linalg.norm(away[0])))
    assert {view.camera.target for view in found} == {tuple(map(float, arrangement.centre))}
    assert {view.camera.fov for view in found} == {45.0}
    # The first one is at the azimuth asked for, about the object as it stands
    low = asin(0.5 / 40)
    assert away[0] / np.linalg.norm(away[0]) == pytest.approx(towards(50.0, np.degrees(low)))
    assert all(0.05 <= view.camera.coverage <= 0.6 and view.camera.visibility == 1 for view in found)
    assert np.linalg.norm(away[0]) > arrangement.radius / sin(radians(22.5))
    distances = {round(distance_of(planned(arrangement, spec, 40, seed)), 3) for seed in range(5)}
    assert len(distances) == 5


def test_what_is_in_the_way_shortens_the_distance_for_all(box_arrangement: BoxStage,
                                                          room_of: Callable[..., RoomPlan]) -> None:
    spec, hall = orbit_spec(coverage=(0.01, 0.6), visibility=0.3), room_of(20.0, 20.0, 12.0)
    free = planned(box_arrangement(CHAIR, room=hall), spec, 60)
    assert free.note.endswith(f"{distance_of(free):.2f} m") and distance_of(free) > 2.2
    wall = ((-4.0, -2.1, 0.0), (4.0, -2.0, 6.0))
    screened = box_arrangement(CHAIR, (wall,), room=hall)
    nearer = planned(screened, spec, 60)
    # Twice the clearance before the wall, of which views straight at it have the least
    assert distance_of(nearer) == pytest.approx(2.0 - 2 * 0.15, abs=0.01) and "shortened" in nearer.note
    assert len([path_camera(screened, nearer, spec, k, "") for k in range(60)]) == 60
    # So near that the object would not fit the frame: only the views behind it are lost
    wall = ((-4.0, -0.7, 0.0), (4.0, -0.6, 6.0))
    behind = box_arrangement(CHAIR, (wall,), room=hall)
    orbit = planned(behind, spec, 60)
    assert "in the way of" in orbit.note and distance_of(orbit) <= distance_of(free)
    with pytest.raises(PlanError, match=r"turn/000000: camera\.path: expected view 0 of the orbit \(0 degrees about "
                                        r"the object, 0 above the horizon, .* m away\) .* got: "):
        path_camera(behind, orbit, spec, 0, "turn/000000")


@pytest.mark.parametrize(("broken", "rule"), [
    ({"path": {"kind": "orbit"}, "elevation": 20}, "expected either `path` or `elevation`, got both"),
    ({"path": {"kind": "orbit"}, "azimuth": 20}, "expected either `path` or `azimuth`, got both"),
    ({"path": {"kind": "orbit", "elevation": (90, 90)}}, "expected a ring at an elevation <= 89, got 90"),
    ({"path": {"kind": "orbit", "elevation": (0, 91)}}, r"expected bounds in \[-89, 90\]"),
    ({"path": {"kind": "orbit", "elevation": (40, 10)}}, "low <= high|expected"),
    ({"path": {"kind": "circle"}}, "expected a mapping whose kind is one of orbit, turntable, spline, poses"),
    ({"orbit": {"elevation": (0, 90), "azimuth": 5}},
     r"write `path: {kind: orbit, elevation: \[0, 90\], azimuth: 5}`"),
])
def test_an_orbit_that_says_two_things_is_refused(broken: dict[str, Any], rule: str) -> None:
    with pytest.raises(ValidationError, match=rule):
        CameraSpec.model_validate(broken)


def test_several_views_are_one_in_the_means_and_points_of_all(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR)
    random = CameraSpec.model_validate({"azimuth": {"uniform": [-180, 180]}})
    views = [place_camera(arrangement, random, IMAGE, rng(k), "") for k in range(30)]
    sight = together([view.sight for view in views])
    assert sight.coverage == pytest.approx(np.mean([view.sight.coverage for view in views]))
    assert len(sight.points) == len(sight.normals) <= POINTS
    assert sum(bool((sight.normals @ side > 0.9).any()) for side in (np.eye(3)[0], -np.eye(3)[0])) == 2
    one, all_round = lit_view(arrangement, views[:1], 3.0), lit_view(arrangement, views, 3.0)
    assert one.sight is views[0].sight and one.least_lit == 0.5 and all_round.least_lit == LIT_AROUND


def sequence_data(dataset_data: dict[str, Any], **split: Any) -> dict[str, Any]:
    dataset_data["splits"][1] |= {"views": 12, "lights": 2, "lights_per": "pair", **split,
                                  "camera": {"path": {"kind": "orbit"}, "coverage": (0.03, 0.6), "visibility": 0.1}}
    return dataset_data


def test_views_of_an_orbit_are_in_order_and_say_so(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    loaded = load(sequence_data(dataset_data), scene={"room": "room.yaml", "space": 1.5},
                  room={"width": 9, "depth": 9, "height": 4})
    planner, spec = Planner(loaded), loaded.dataset
    views = views_of(spec, spec.splits[1])
    assert [(view.pair.object, view.camera) for view in views] == [(k // 12, k % 12) for k in range(24)]
    plans = [planner.example(ref) for ref in planner.examples if ref.view.pair.split == "eval"]
    assert [(plan.sequence.name, plan.sequence.frame) for plan in plans[::4]] == [
        (f"eval-{k // 12:02d}-00", k % 12) for k in range(24)]
    assert {plan.sequence.frames for plan in plans} == {12}
    trained = planner.example(planner.examples[0])
    assert (trained.sequence.name, trained.sequence.frames) == ("", 0)
    # One light for all views of a pair, whichever is planned first; another for another pair
    for number in (0, 1):
        own = [plan for plan in plans if plan.light == number]
        assert len({plan.target_light for plan in own[:24]}) == len({plan.target_light for plan in own[24:]}) == 1
        assert own[0].target_light != own[-1].target_light
    assert len({plan.source_light for plan in plans}) == 1 and plans[0].target_light != plans[2].target_light
    last = Planner(loaded).example(next(ref for ref in planner.examples if ref.key == plans[-1].key))
    assert last == plans[-1]


def test_lights_of_a_view_stay_as_they_were(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    before = Planner(load(dataset_data))
    kept = before.example(before.examples[0])
    after = Planner(load(sequence_data(dataset_data)))
    assert after.example(after.examples[0]) == kept
