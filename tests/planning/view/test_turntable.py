"""The target turns by equal steps; camera, room and lamps stay; the circle that it sweeps is free."""

from collections.abc import Callable
from contextlib import suppress
from math import hypot
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.scene.footprints import Box, footprint
from dataset_builder.planning.scene.sweep import Sweep, swept_box
from dataset_builder.planning.view import turntable
from dataset_builder.planning.view.visibility import look
from dataset_builder.spec.scene import ObjectSpec

BOX = Box(low=(-0.2, -0.6, 0.0), high=(0.4, 0.2, 0.9))
PLAN = ObjectPlan(name="box", kind="procedural", source="box", source_sha256="", category="box", licence="CC0-1.0",
                  seed="0", params=(), scale=1.0, up="z")
PLACED = PlacedObject(object=PLAN, instance=1, position=(1.0, 2.0, 0.0), yaw=25.0)


def turning(data: dict[str, Any], **path: Any) -> dict[str, Any]:
    data["splits"][1] |= {"views": 12, "lights": 2, "lights_per": "pair", "camera": {
        "coverage": (0.03, 0.6), "visibility": 0.3, "path": {"kind": "turntable", **path}}}
    return data


def plans_of(loaded: Any) -> list[ExamplePlan]:
    planner = Planner(loaded)
    return [planner.example(ref) for ref in planner.examples if ref.view.pair.split == "eval"]


def test_a_turn_is_about_the_middle_of_the_footprint() -> None:
    sweep, middle = Sweep.of(PLACED, BOX), footprint(BOX, PLACED.position, PLACED.yaw).centre
    assert sweep.axis == middle and sweep.radius == pytest.approx(hypot(0.3, 0.4))
    corners = []
    for angle in range(0, 360, 15):
        turned = sweep.turned(PLACED, angle)
        box = footprint(BOX, turned.position, turned.yaw)
        assert box.centre == pytest.approx(middle) and (turned.yaw - PLACED.yaw - angle) % 360 == pytest.approx(0)
        corners.append(np.hypot(*(box.corners() - middle).T))
        assert not sweep.holds(np.array([*(box.corners()[0] + 0.51 * (box.corners()[0] - middle)), 0.5]), 0.0)
    assert np.array(corners) == pytest.approx(sweep.radius)
    assert swept_box(BOX).size == pytest.approx((1.0, 1.0, 0.9)) and swept_box(swept_box(BOX)).low[0] < -0.4
    # In it, beside it and above it, within a margin or not
    above = np.array([*middle, 1.2])
    assert sweep.holds(np.array([*middle, 0.9]), 0.0) and not sweep.holds(above, 0.2) and sweep.holds(above, 0.31)
    assert sweep.holds(np.array([middle[0] + 0.6, middle[1], 0.5]), 0.11)


def test_what_comes_into_the_circle_is_told() -> None:
    sweep = Sweep.of(PLACED, BOX)
    x, y = sweep.axis
    wall = np.array([[x + 0.45, y - 2, 0], [x + 0.45, y + 2, 0], [x + 0.45, y, 3]])
    sweep.check([(wall + np.array([0.1, 0, 0]), np.array([[0, 1, 2]]), 2)], "box in room")
    with pytest.raises(PlanError, match=r"box in room: expected a free circle of 0\.50 m about the target.* something "
                                        r"0\.45 m from its middle"):
        sweep.check([(wall, np.array([[0, 1, 2]]), 2)], "box in room")


def test_the_target_turns_and_all_else_stays(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    loaded = load(turning(dataset_data, start={"uniform": [0, 90]}))
    plans = plans_of(loaded)
    for number in (0, 1):
        own = [plan for plan in plans if plan.target.object.name == plans[-number].target.object.name]
        first = own[0]
        assert len({plan.camera.position for plan in own}) == len({plan.camera.target for plan in own}) == 1
        assert len({plan.furniture for plan in own}) == len({plan.room for plan in own}) == 1
        assert len({plan.target_light for plan in own if plan.light == 0}) == 1
        turns = [(plan.target.yaw - first.target.yaw) % 360 for plan in own[::4]]
        assert turns == pytest.approx([30 * k for k in range(12)], abs=1e-9)
        assert [plan.sequence.frame for plan in own[::4]] == list(range(12))
    # A view planned alone, by another planner, is the same
    alone = Planner(loaded)
    assert alone.example(next(ref for ref in alone.examples if ref.key == plans[-1].key)) == plans[-1]
    # What is said to be covered is what the turned target covers
    ref = next(ref for ref in alone.examples if ref.key == plans[-1].key)
    seen = look(alone.view(ref.view).arrangement, Pinhole.of(plans[-1].camera, 64, 64))
    assert alone.view(ref.view).arrangement.target == plans[-1].target and seen.coverage > 0


def test_turns_and_direction(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    plans = plans_of(load(turning(dataset_data, turns=0.5, direction="clockwise", start=10, azimuth=0, elevation=20)))
    turns = [(plan.target.yaw - plans[0].target.yaw) % 360 for plan in plans[:48:4]]
    assert turns == pytest.approx([-15 * k % 360 for k in range(12)])
    azimuth = np.degrees(np.arctan2(*(np.subtract(plans[0].camera.position, plans[0].camera.target)[:2] * [1, -1])))
    # The camera is in front of the object as it was placed, which is 10 degrees before the first view
    assert (azimuth - plans[0].target.yaw + 10 + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)


def test_a_camera_of_fixed_angles_is_drawn_at_other_distances(load: Callable[..., Any], dataset_data: dict[str, Any],
                                                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Each draw may be the one that is within `coverage` at all turns, so no two are the same camera."""
    tried = list[float]()

    def none_will_do(_: Any, spec: Any, pinhole: Pinhole) -> int:
        tried.append(float(np.linalg.norm(pinhole.position - pinhole.target)))
        return 0

    monkeypatch.setattr(turntable, "_had", none_will_do)
    data = turning(dataset_data, azimuth=0, elevation=20)
    data["splits"][1]["camera"]["attempts"] = 5
    planner = Planner(load(data))
    with suppress(PlanError):
        planner.example(next(ref for ref in planner.examples if ref.view.pair.split == "eval"))
    assert len(tried) == 5 and len(set(tried)) == 5


def test_views_that_show_the_same_are_told(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    """Two turns in 12 views are one turn in 6, twice; half a turn is not."""
    for turns, said in ((2, "60 degrees counter-clockwise from each to the next, so view 6 shows what view 0 does; "),
                        (0.5, "15 degrees counter-clockwise from each to the next; ")):
        assert f"12 views, {said}the camera" in " ".join(plans_of(load(turning(dataset_data, turns=turns)))[0].notes)


def test_a_room_that_is_too_narrow_to_turn_in_is_told(load: Callable[..., Any], dataset_data: dict[str, Any]) -> None:
    """A cabinet of 1 x 0.5 m would stand in a room of 1.15 m, but not turn: its circle has 1.12 m."""
    room = {"width": 1.15, "depth": 1.15, "height": 2.8}
    loaded = load(turning(dataset_data), room=room, scene={"room": "room.yaml"},
                  objects={"chair.yaml": ObjectSpec(family="cabinet", params={"width": 1.0, "depth": 0.5})})
    with pytest.raises(PlanError, match=r"expected the target to fit in the room, got an object of 1\.12 x 1\.12 x"):
        plans_of(loaded)


def test_a_lamp_placed_about_the_object_stays_where_it_is(load: Callable[..., Any],
                                                           dataset_data: dict[str, Any]) -> None:
    dataset_data["target"] = {"lights": [{"kind": "point", "azimuth": 40, "elevation": 50, "distance": 1.6}],
                              "brightness": [0, 100]}
    data = turning(dataset_data, start=70, azimuth=0, elevation=20)
    data["splits"][1] |= {"lights": 1, "lights_per": "view"}
    plans = plans_of(load(data))[:24:2]
    lamps = np.array([plan.target_light.lights[0].position for plan in plans])
    assert lamps == pytest.approx(np.broadcast_to(lamps[0], lamps.shape))
    # 40 degrees about the object as it was placed, as the camera is in front of it
    away, camera = (lamps[0] - plans[0].camera.target)[:2], np.subtract(plans[0].camera.position,
                                                                        plans[0].camera.target)[:2]
    angle = np.degrees(np.arctan2(away[1], away[0]) - np.arctan2(camera[1], camera[0]))
    assert (angle - 40 + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)
