"""Lights of scene files as target light: kept, dimmed, added, scaled, refused."""

from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from dataset_builder.assets.scene_model import SceneLight
from dataset_builder.errors import PlanError
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.emission import direct_irradiance
from dataset_builder.planning.view.exposure import expose
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.planning.view.own_lights import one_dome, own_lights
from dataset_builder.planning.view.scene_lights import HIDDEN, check_lights_differ, scene_light
from dataset_builder.spec.file_scene import SceneLightsSpec
from dataset_builder.spec.light import TargetSpec
from tests.planning.view.test_lights import CHAIR, lit_view, stream_of, target_spec
from tests.small_scenes import light

BoxStage = Callable[..., Arrangement]
SCENE = Path("room.usda")


def own(name: str, kind: str = "point", radiance: float = 100.0, **values: Any) -> SceneLight:
    given = {"position": (1.0, -1.0, 2.0), "direction": (0.0, 0.0, -1.0), "weight": 0.0}
    return SceneLight(name=f"/World/{name}", light=light(kind, (radiance,) * 3, **(given | values)))


KEY, FILL = own("Key"), own("Fill", radiance=20.0, position=(-1.0, -1.0, 2.0))


def planned(view: LitView, *lights: SceneLight, target: TargetSpec | None = None, seed: int = 0,
            **spec: Any) -> tuple[IlluminationPlan, str]:
    lights_spec = SceneLightsSpec.model_validate({"use": "kept"} | spec)
    return scene_light(view, lights, lights_spec, target or target_spec(strength=2), stream_of(seed), "train/0", SCENE)


def measured(view: LitView, lights: tuple[LightPlan, ...]) -> float:
    return expose(view.arrangement, view.sight, lights, view.unit, view.sky).mean


def radiances(plan: IlluminationPlan) -> list[float]:
    return [each.radiance[0] for each in plan.lights]


def test_kept_lights_send_the_drawn_strength_and_keep_their_ratio(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, note = planned(view, KEY, FILL)
    assert measured(view, plan.lights) == pytest.approx(2.0)
    first, second = radiances(plan)
    assert first / second == pytest.approx(5) and plan.open == ()
    assert f"lights of the scene: /World/Key, /World/Fill, times {first / 100:.3g}, for a strength of 2" in note
    assert [each.position for each in plan.lights] == [KEY.light.position, FILL.light.position]


def test_a_number_is_the_factor_of_every_light(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, note = planned(view, KEY, FILL, scale=0.7, target=target_spec(brightness=(0, 1e9)))
    assert radiances(plan) == pytest.approx([70, 14]) and "times 0.7" in note and "strength" not in note


def test_dimming_goes_by_names_and_the_last_that_fits(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, note = planned(view, KEY, FILL, scale=1, dim={"/World/*": 0.5, "*/Fill": 3}, target=target_spec(
        brightness=(0, 1e9)))
    assert radiances(plan) == pytest.approx([50, 60])
    assert "/World/Key dimmed to 0.5; /World/Fill dimmed to 3" in note
    off, note = planned(view, KEY, FILL, dim={"*/?ey": 0})
    assert len(off.lights) == 1 and off.lights[0].position == FILL.light.position and "/World/Key is off" in note
    assert measured(view, off.lights) == pytest.approx(2.0)


def test_weights_are_what_lights_send_to_the_object(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    away = own("Up", "area", position=(0.0, -1.4, 0.45), direction=(0.0, -1.0, 0.0), size=0.2)
    plan, _ = planned(view, KEY, FILL, away, scale=1, target=target_spec(brightness=(0, 1e9)))
    centre = view.arrangement.centre
    facing = np.subtract(KEY.light.position, centre)
    sent = direct_irradiance(KEY.light, centre[None], (facing / np.linalg.norm(facing))[None])[0].mean()
    assert plan.lights[0].weight == pytest.approx(sent)
    assert plan.lights[2].weight == pytest.approx(0.02 * 100 * 0.04 / 1.4**2, rel=0.02), "what shines away is sampled"


def test_a_lamp_in_the_object_does_not_take_every_sample(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    inside = own("In", position=tuple(view.arrangement.centre))
    plan, _ = planned(view, KEY, inside, scale=1, target=target_spec(brightness=(0, 1e9)))
    assert plan.lights[1].weight == pytest.approx(100 / view.arrangement.radius**2)


def test_added_lights_stand_beside_drawn_ones(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    target = target_spec(strength=1, lights=2)
    plan, note = planned(view, KEY, target=target, use="added")
    drawn, _ = planned(view, KEY, target=target, use="replaced")
    assert len(plan.lights) == len(drawn.lights) + 1 and note.startswith("target light: draw ")
    assert measured(view, plan.lights[-1:]) == pytest.approx(1.0) and "lights of the scene: /World/Key" in note
    _, without = planned(view, target=target, use="added")
    assert "lights of the scene: none" in without


def test_replaced_lights_are_named_and_change_nothing(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, note = planned(view, KEY, FILL, use="replaced")
    alone, said = planned(view, use="replaced")
    assert plan == alone and note == f"{said}; lights of the scene replaced: /World/Key, /World/Fill"


def test_lights_behind_things_are_scaled_within_bounds_and_refused_as_dark(box_arrangement: BoxStage) -> None:
    """A wall stands between every light and the object."""
    wall = ((-1.9, -0.6, 0.0), (1.9, -0.5, 2.4))
    view = lit_view(box_arrangement(CHAIR))
    walled = LitView(arrangement=box_arrangement(CHAIR, (wall,)), cameras=view.cameras, sight=view.sight,
                     unit=view.unit, sky=0.0)
    with pytest.raises(PlanError, match=r"train/0: target: .*got 0 and 0% \(/World/Key 0, /World/Fill 0\).*use: added"):
        planned(walled, KEY, FILL)
    plan, note = planned(walled, KEY, FILL, target=target_spec(strength=2, brightness=(0, 20)))
    assert measured(view, plan.lights) == pytest.approx(2.0 / HIDDEN) and "hide all but 0%" in note


def test_too_bright_and_turned_away_are_refused(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    with pytest.raises(PlanError, match=r"got [0-9.e+]+ and .*/World/Key .*\(lower target\.strength or"):
        planned(view, KEY, scale=1e6)
    with pytest.raises(PlanError, match=r"train/0: lights: .*got none of /World/Up"):
        planned(view, own("Up", "area", direction=(0.0, 0.0, 1.0)))


@pytest.mark.parametrize("kind", ["sun", "dome"])
def test_light_from_outside_is_weighed_by_what_gets_in(kind: str, box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR, closed=False))
    plan, _ = planned(view, own("Sky", kind, 3.0, direction=(0.0, 0.6, -0.8)))
    assert measured(view, plan.lights) == pytest.approx(2.0)
    full = plan.lights[0].radiance[0] * (pi if kind == "dome" else 1)
    assert 0.1 * full < plan.lights[0].weight <= full * (1 + 1e-9)
    if kind == "dome":
        assert plan.lights[0].weight == pytest.approx(full * view.sky)


def test_domes_add_up_or_the_brightest_is_kept() -> None:
    plain, other = own("A", "dome", 1.0), own("B", "dome", 2.0)
    shown = own("C", "dome", 2.5, image="sky.exr", image_sha256="0")
    kept, said = one_dome([KEY, plain, FILL, other])
    assert [each.name for each in kept] == ["/World/Key", "/World/A", "/World/Fill"]
    assert kept[1].light.radiance == (3, 3, 3) and said == ["even domes add up: /World/A, /World/B"]
    kept, said = one_dome([plain, shown])
    assert kept == (shown,) and said == ["one dome, /World/C, the brightest; left out: /World/A"]
    assert one_dome([plain, other, shown])[0][0].light.radiance == (3, 3, 3)
    assert one_dome([shown, KEY]) == ((shown, KEY), [])


@pytest.mark.parametrize("values", [
    {"radiance": 1e30}, {"radiance": float("nan")}, {"radiance": -1.0}, {"size": float("inf")},
    {"position": (float("nan"), 0.0, 0.0)}, {"length": 1e9}])
def test_numbers_that_no_light_has_are_refused_by_file_and_light(values: dict[str, Any]) -> None:
    fields = {key: (value,) * 3 if key == "radiance" else value for key, value in values.items()}
    wrong = SceneLight(name="/World/Key", light=KEY.light.model_copy(update=fields))
    with pytest.raises(PlanError, match=r"room\.usda: /World/Key: expected .* got "):
        own_lights([wrong], {}, SCENE)


def test_dark_lights_are_left_out_and_none_at_all_refused(box_arrangement: BoxStage) -> None:
    dark = own("Dark", radiance=0.0)
    found = own_lights([dark, KEY], {}, SCENE)
    assert found.lights == (KEY,) and found.said == ("/World/Dark sends nothing",)
    with pytest.raises(PlanError, match=r"room\.usda: lights\.use: .*got none of 1; /World/Dark sends nothing"):
        planned(lit_view(box_arrangement(CHAIR)), dark)


def test_more_lights_than_a_scene_may_have_are_refused() -> None:
    many = [own(f"L{k}") for k in range(1025)]
    with pytest.raises(PlanError, match="expected at most 1024 lights, got 1025"):
        own_lights(many, {}, SCENE)
    assert len(own_lights(many, {"/World/L7": 0}, SCENE).lights) == 1024


@pytest.mark.parametrize(("use", "scale", "strength", "number", "fine"), [
    ("kept", "auto", 2, 0, True), ("kept", "auto", 2, 1, False), ("kept", 3.0, {"uniform": [1, 2]}, 1, False),
    ("kept", "auto", {"uniform": [1, 2]}, 1, True), ("added", "auto", 2, 1, True)])
def test_lights_of_a_view_that_would_be_the_same_are_refused(use: str, scale: Any, strength: Any, number: int,
                                                             fine: bool) -> None:
    spec, target = SceneLightsSpec.model_validate({"use": use, "scale": scale}), target_spec(strength=strength)
    if fine:
        check_lights_differ(spec, target, number, "train/0")
    else:
        with pytest.raises(PlanError, match=r"train/0: splits\[\]\.lights: .*which would be the same"):
            check_lights_differ(spec, target, number, "train/0")


def test_strengths_are_drawn_for_each_light_of_a_view(box_arrangement: BoxStage) -> None:
    view, target = lit_view(box_arrangement(CHAIR)), target_spec(strength={"uniform": [1, 3]})
    found = [measured(view, planned(view, KEY, target=target, seed=seed)[0].lights) for seed in range(4)]
    assert len(set(found)) == 4 and min(found) >= 1 and max(found) <= 3


@pytest.mark.parametrize("data", [{"dim": {"a": 0.5}}, {"scale": 2}, {"use": "replaced", "dim": {"a": 1}}])
def test_dimming_what_is_replaced_is_a_mistake(data: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="expected `kept` or `added`"):
        SceneLightsSpec.model_validate(data)
