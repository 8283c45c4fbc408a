from functools import partial
from math import pi
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.view.emission import LUMINANCE, direct_irradiance
from dataset_builder.planning.view.exposure import expose
from dataset_builder.planning.view.lights import target_light
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.seeding import rng
from dataset_builder.spec.light import TargetSpec
from tests.planning.view.test_lights import CHAIR, SHELF, BoxStage, lit_view

FRONT = {"name": "front", "azimuth": 0, "elevation": 30, "distance": 1.5}
FREE = {"brightness": (0, 1e6), "dome": 0}


def lit(view: LitView, *lamps: dict[str, Any], seed: int = 0, alone: int | None = None,
        **more: Any) -> tuple[IlluminationPlan, str]:
    spec = TargetSpec.model_validate({"lights": lamps, **FREE, **more})
    return target_light(view, spec, partial(rng, seed), "train/000000", alone=alone)


def test_a_lamp_stands_where_it_is_put(box_arrangement: BoxStage) -> None:
    """The object's front is -Y, turned by its yaw of 90 degrees to +X."""
    view = lit_view(box_arrangement(CHAIR, yaw=90.0))
    plan, _ = lit(view, FRONT, {"position": (-1, 0.5, 2), "kind": "spot", "aim": (-1, 0.5, 0)},
                  {"position": (0, 0, 2.2), "direction": (0, 2, 0)})
    centre = view.arrangement.centre
    assert plan.lights[0].position == pytest.approx(centre + 1.5 * np.array([np.sqrt(0.75), 0, 0.5]))
    assert plan.lights[0].direction == pytest.approx(-np.array([np.sqrt(0.75), 0, 0.5]))
    assert plan.lights[1].position == (-1, 0.5, 2) and plan.lights[1].direction == (0, 0, -1)
    assert plan.lights[2].direction == (0, 1, 0)
    assert [light.name for light in plan.lights] == ["front", "", ""] and plan.open == ()


@pytest.mark.parametrize("kind", ["area", "sphere", "spot", "point"])
def test_every_lamp_sends_what_it_says_however_many_there_are(kind: str, box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    both = {**FRONT, "kind": kind, "elevation": 60, "strength": 3, "dim": 0.5, "color": "#ff8040"}
    lamps = [{**both, "name": str(k), "azimuth": 180 * k} for k in range(2)]
    plan, _ = lit(view, *lamps)
    centre = view.arrangement.centre[None]
    for light in plan.lights:
        facing = np.array([light.position]) - centre
        found = direct_irradiance(light, centre, facing / np.linalg.norm(facing))[0]
        assert found @ LUMINANCE == pytest.approx(0.5 * 3 * pi * 2.0) and found.mean() == pytest.approx(light.weight)
        assert np.array(light.radiance) / light.radiance[0] == pytest.approx([1, 0.215861, 0.051269], abs=1e-6)
        assert light.temperature == 0


def test_radiance_does_not_hang_on_where_the_object_is(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, _ = lit(view, {"position": (0, 0, 2), "radiance": 7}, {"position": (0, 1, 2.3), "radiance": 7, "dim": 2})
    for light, factor in zip(plan.lights, (1, 2), strict=True):
        assert np.array(light.radiance) @ LUMINANCE == pytest.approx(7 * 2.0 * factor)


def test_a_lamp_that_shines_elsewhere_keeps_a_weight(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    at, away = lit(view, FRONT, {**FRONT, "name": "away", "direction": (0, -1, 0.5)})[0].lights
    assert at.weight > 0 and away.weight == pytest.approx(0.02 * at.weight)


@pytest.mark.parametrize(("lamp", "rule"), [
    ({"position": (2.99, 0, 1)}, r"lights\[0\]: expected lamp 0 to be in the room, 0.02 m from its bounds, got it at "
     r"\[2.99, 0, 1\]; it has x in \[-3, 3\], y in \[-2.5, 2.5\], z in \[0, 2.8\]"),
    ({"position": (0, 0, 2.7), "kind": "sphere", "size": 0.3, "name": "moon"}, "expected lamp moon to be in the room"),
    ({"position": (0.65, 0, 1), "name": "desk", "direction": (0, 0, -1)},
     r"lamp desk to be clear of surfaces by 0.02 m, got it at \[0.65, 0, 1\], 0 m from a thing of the scene"),
    ({"position": (0.95, 0, 1), "kind": "point"}, r"to be in the open, got it at .*, inside a thing of the scene"),
    ({"position": (0, 0, 0.5), "kind": "point"}, r"in the open, got it at \[0, 0, 0.5\], inside the object")])
def test_a_lamp_in_a_wall_or_a_thing_is_refused_by_name_and_place(lamp: dict[str, Any], rule: str,
                                                                  box_arrangement: BoxStage) -> None:
    """The shelf is 0.05 m from the middle of a square of 0.2 m."""
    view = lit_view(box_arrangement(CHAIR, (SHELF,)))
    with pytest.raises(PlanError, match=rule):
        lit(view, lamp)
    lit(view, {"position": (0.65, 0, 1), "kind": "point"})


def test_a_panel_may_be_close_under_the_ceiling(box_arrangement: BoxStage) -> None:
    """A square lies flat: it needs no more room above it than a lamp without extent, but for steps of its grid."""
    panel = {"position": (1, 0, 2.75), "direction": (0, 0, -1), "size": 0.6}
    view = lit_view(box_arrangement(CHAIR))
    lit(view, panel)
    with pytest.raises(PlanError, match="to be in the room"):
        lit(view, {**panel, "direction": (0, -1, 0)})


def test_a_lamp_in_a_cameras_way_is_refused_and_one_without_extent_is_not(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    between = 0.5 * np.array(view.cameras[0].position) + 0.5 * view.arrangement.centre
    lamp = {"position": tuple(between.tolist()), "kind": "sphere", "size": 0.05, "name": "ball"}
    with pytest.raises(PlanError, match="lamp ball not to stand between the camera and the object, got it at"):
        lit(view, lamp)
    lit(view, {"position": lamp["position"], "kind": "point"})


def test_lamps_that_come_and_go_move_no_number_of_the_others(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    spread = {**FRONT, "azimuth": {"uniform": (0, 40)}, "dim": {"uniform": (0.5, 1)}}
    other = {**FRONT, "name": "other", "azimuth": 90, "on": True}
    together, note = lit(view, other, spread)
    assert together.lights[1] == lit(view, spread)[0].lights[0] == lit(view, other, spread, alone=1)[0].lights[0]
    assert lit(view, spread, seed=1)[0] != lit(view, spread)[0]
    found, said = lit(view, {**other, "on": False}, spread)
    assert found.lights == together.lights[1:] and "lamp other is off" in said and "off" not in note


def test_alone_means_without_light_from_outside(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    assert [light.kind for light in lit(view, FRONT, dome=1)[0].lights] == ["area", "dome"]
    assert [light.kind for light in lit(view, FRONT, dome=1, alone=0)[0].lights] == ["area"]


def test_brightness_is_kept_and_says_which_lamp_sends_what(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    above = {"position": (0, 0, 2.5), "kind": "point", "name": "above", "strength": 50}
    sent = expose(view.arrangement, view.sight, lit(view, above)[0].lights, view.unit, 0.0).mean
    with pytest.raises(PlanError, match=rf"in \[0.1, 20\] .* got {sent:.3g} \(above {sent:.2g}\) \(turn lamps down"):
        lit(view, above, brightness=(0.1, 20))
    with pytest.raises(PlanError, match=r"got 0 \(above 0\) .*allow the dark: target.brightness: \[0, ...\]"):
        lit(view, {**above, "kind": "spot", "direction": (0, 0, 1)}, brightness=(0.1, 20))


def test_each_lamp_alone_is_as_it_is_among_all(load: Any, dataset_data: dict[str, Any]) -> None:
    lamps = [{"name": name, "azimuth": azimuth, "elevation": 60, "kind": "point", "dim": {"uniform": [0.5, 1]}}
             for name, azimuth in (("left", -90), ("right", 90))]

    def lights_of(lights: Any) -> list[Any]:
        splits = [{**split, "lights": lights, "views": 1} for split in dataset_data["splits"]]
        data = {**dataset_data, "splits": splits, "target": {"lights": lamps, **FREE}}
        planner = Planner(load(data))
        view = planner.examples[0].view
        return [planner.light(ref.view, ref.light)[0].lights for ref in planner.examples
                if ref.view == view and ref.level == 0]

    (together,), alone = lights_of(1), lights_of("each")
    assert [(light,) for light in together] == alone and [light.name for light in together] == ["left", "right"]
