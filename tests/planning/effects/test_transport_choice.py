"""Which paths find light: every rule on its own, requests, and what is said of requests that cannot be met."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.label.example_plan import EffectsPlan
from dataset_builder.label.scene_plan import FogPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.materials_used import MaterialUse
from dataset_builder.planning.effects.transport_choice import LAMPS_LEAD, RULES, PassLight, choose, kinds
from dataset_builder.planning.plan import plan_example
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import ObjectSpec
from tests import plans

LAMPS = [name for name, kind in LIGHT_KINDS.items() if not kind.outside]
OUTSIDE = [name for name, kind in LIGHT_KINDS.items() if kind.outside]


RIPPLES = Texture(base_color=np.ones((1, 1, 3), np.float32), normal=np.array([[[0.6, 0.0, 0.8]]], np.float32))


def shining(kind: str, weight: float = 1.0) -> LightPlan:
    return plans.light_plan(kind).model_copy(update={"weight": weight})


def use(**surface: Any) -> MaterialUse:
    material = Material(**{"name": "ware", "base_color": (0.5, 0.5, 0.5), "roughness": 0.5} | surface)
    return MaterialUse(owner="vase", part="furniture", material=material, scattered=0.5, smoothest=material.roughness,
                       roughest=material.roughness)


def lit(*lights: LightPlan, **more: Any) -> PassLight:
    """A pass that no rule keeps from joined paths."""
    given: dict[str, Any] = {"name": "target", "lights": lights or (shining("area"),), "materials": (use(),),
                             "fog": FogPlan(),
             "depth": 6, "target_area": 1.0}
    return PassLight(**given | more)


BARRED = {
    "direct light": (lit(depth=2), "paths of 2 edges are direct light alone"),
    "no lamp": (lit(shining("dome"), shining("sun")), "dome and sun light shines from outside alone"),
    "no light": (lit(lights=()), "no light reaches the object"),
    "fog": (lit(fog=FogPlan(extinction=0.1, albedo=0.9)), "fog fills the air"),
    "dark lamps": (lit(shining("area", 0.0), shining("dome")), "its lamps are dark"),
    "rippled glass": (lit(materials=(use(), use(transmission=0.5, texture=RIPPLES))), "normal map on glass"),
    "glass in glass": (lit(materials=(use(), use(transmission=1.0, priority=1))), "do not count the bodies of glass"),
}
UNWISE = lit(shining("area"), shining("dome", 3.0))


@pytest.mark.parametrize("kind", LAMPS)
def test_paths_are_joined_where_a_lamp_sends_light_that_bounces(kind: str) -> None:
    transport, said = choose(lit(shining(kind)), "auto")
    assert (transport, said.effect, said.choice) == ("joined", "transport of target", "joined paths")
    assert said.reason == (f"{kind} light from within the scene is 100% of the direct light at the object, and it "
                           "bounces")


@pytest.mark.parametrize("kind", OUTSIDE)
def test_light_from_outside_alone_is_found_from_the_camera(kind: str) -> None:
    assert choose(lit(shining(kind)), "auto")[0] == "camera"


@pytest.mark.parametrize("case", BARRED)
@pytest.mark.parametrize("asked", ["auto", "joined"])
def test_what_joined_paths_cannot_do_is_left_to_the_camera_and_said(case: str, asked: str) -> None:
    light, why = BARRED[case]
    transport, said = choose(light, asked)
    assert (transport, said.choice) == ("camera", "camera paths") and why in said.reason
    assert said.reason.startswith("joined paths are requested, but ") == (asked == "joined")


def test_every_rule_has_a_case_of_its_own() -> None:
    """`BARRED` and `UNWISE` break one rule each; but nothing shines where there is no light, from lamps neither."""
    broken = [[rule.holds(light) for rule in RULES] for light in (*(light for light, _ in BARRED.values()), UNWISE)]
    by_bars = [[rule for rule, holds in zip(RULES, row, strict=True) if holds and rule.bars] for row in broken]
    assert [len(row) for row in by_bars] == [1] * len(BARRED) + [0]
    assert broken[-1] == [False] * (len(RULES) - 1) + [True]
    assert {id(rule) for row in by_bars for rule in row} == {id(rule) for rule in RULES if rule.bars}
    assert not any(rule.holds(lit()) for rule in RULES)


@pytest.mark.parametrize(("outside", "expected"), [(0.9, "joined"), (1.0, "joined"), (1.1, "camera")])
def test_paths_are_joined_where_lamps_have_half_of_the_light_or_more(outside: float, expected: str) -> None:
    assert LAMPS_LEAD == 0.5
    light = lit(shining("area", 0.4), shining("spot", 0.6), shining("dome", outside))
    transport, said = choose(light, "auto")
    assert transport == expected and f"{1 / (1 + outside):.0%}" in said.reason


def test_a_request_is_met_where_it_can_be() -> None:
    for light in (lit(), UNWISE):
        assert choose(light, "joined") == ("joined", choose(lit(), "joined")[1])
        assert choose(light, "camera")[0] == "camera" and choose(light, "camera")[1].reason == "as requested"
    assert choose(lit(), "joined")[1].reason == "as requested"
    assert choose(UNWISE, "auto")[0] == "camera"
    for light, _ in BARRED.values():
        assert choose(light, "camera")[1].reason == "as requested"


def test_smooth_panes_glass_of_one_index_and_tilted_opaque_surfaces_are_joined() -> None:
    for clear in (use(transmission=1.0), use(transmission=1.0, abbe=40.0, thin=True), use(abbe=40.0),
                  use(texture=RIPPLES), use(transmission=1.0, metallic=1.0, texture=RIPPLES)):
        assert choose(lit(materials=(clear,)), "auto")[0] == "joined"


def test_lamps_without_weight_are_no_reason_to_divide_by_nothing() -> None:
    assert lit(shining("area", 0.0)).share == 0
    assert choose(lit(shining("area", 0.0)), "auto")[0] == "camera"


def test_kinds_are_listed_once_and_in_order() -> None:
    assert kinds([shining("sphere")]) == "sphere light"
    assert kinds([shining(kind) for kind in ("sphere", "dome", "area", "dome")]) == "area, dome and sphere light"


# Whole plans

CHROME = {"metallic": 1.0, "roughness": 0.1}
TUPLE = {"i_s": "frame", "i_t": "object", "s_prime": "object", "mask": "object"}


@pytest.fixture
def effects(load: Callable[..., LoadedSpec], dataset_data: dict[str, Any]) -> Callable[..., EffectsPlan]:
    """Effects of the first example of a dataset of boxes, with changes to the materials of chairs."""

    def make(chairs: dict[str, float] | None = None, layers: dict[str, str] | None = None, *, fog: float = 0.0,
             **render: Any) -> EffectsPlan:
        data = {**dataset_data, "layers": layers or TUPLE, "render": render}
        scene: dict[str, Any] = {"room": "room.yaml", "furniture": [{"object": "stool.yaml", "place": "near"}]}
        scene |= {"fog": {"extinction": fog}} if fog else {}
        chair = ObjectSpec.model_validate({"family": "chair", "materials": {"*": chairs} if chairs else {}})
        return plan_example(load(data, scene, objects={"chair.yaml": chair}), 0).effects

    return make


def transports(found: EffectsPlan) -> list[str]:
    return [found.of(name).transport for name in ("source", "target", "rough")]


def said(found: EffectsPlan) -> dict[str, tuple[str, str]]:
    return {each.effect.rpartition(" ")[2]: (each.choice, each.reason) for each in found.decisions
            if each.effect.startswith("transport of ")}


Effects = Callable[..., EffectsPlan]


def test_the_light_of_the_source_is_found_from_the_camera_and_that_of_lamps_joined(effects: Effects) -> None:
    found = effects()
    assert transports(found) == ["camera", "joined", "joined"]
    assert {name: choice for name, (choice, _) in said(found).items()} == {
        "source": "camera paths", "target": "joined paths", "rough": "joined paths"}
    assert not found.of("first_hit").caustics and found.of("first_hit").transport == "camera"


def test_passes_that_do_not_run_say_nothing(effects: Effects) -> None:
    found = effects(CHROME, {"i_t": "object", "mask": "object"})
    assert said(found).keys() == {"target"}
    assert all(each.reason.endswith("(target)") for each in found.decisions if each.effect == "caustics")
    free = effects(CHROME, {"d": "object", "mask": "object"})
    assert not said(free) and "caustics" not in {each.effect for each in free.decisions}
    assert said(effects(layers={"i_t": "object", "mask": "object"}, effects="all")).keys() == {"target"}


def test_a_spec_may_ask_for_either(effects: Effects) -> None:
    assert transports(effects(transport="camera")) == ["camera"] * 3
    joined = effects(transport="joined")
    assert transports(joined) == ["camera", "joined", "joined"]
    assert said(joined)["source"] == ("camera paths", "joined paths are requested, but dome light shines from outside "
                                                      "alone, and light paths start at lamps in the scene")
    assert said(joined)["target"] == ("joined paths", "as requested")


@pytest.mark.parametrize(("how", "why"), [({"fog": 0.1}, "fog fills the air"), ({"max_depth": 2}, "direct light alone"),
                                          ({"effects": "all"}, "light paths know no fog")])
def test_plans_fall_back_with_a_reason(effects: Effects, how: dict[str, Any], why: str) -> None:
    for asked in ("auto", "joined"):
        found = effects(**how, transport=asked)
        assert transports(found) == ["camera"] * 3
        assert why in said(found)["target"][1]
        assert not any(entry.caustics for entry in found.passes)


def test_everything_is_simulated_from_the_camera(effects: Effects) -> None:
    assert said(effects(effects="all", transport="camera"))["target"] == ("camera paths", "as requested")
    assert said(effects(effects="all"))["rough"][1].startswith("everything simulated, as requested; ")


def test_passes_know_whether_light_paths_have_something_to_go_to(effects: Effects) -> None:
    shiny = effects(CHROME)
    assert [entry.name for entry in shiny.passes if entry.caustics] == ["target", "rough", "pbr", "empty"]
    for without in (effects(), effects(CHROME | {"roughness": 0.9}), effects(CHROME, transport="camera")):
        assert not any(entry.caustics for entry in without.passes)


def test_dispersive_glass_has_light_paths_like_any_other(effects: Effects) -> None:
    glass = effects({"transmission": 1.0, "roughness": 0.0, "abbe": 40.0})
    assert "dispersion" in glass.features and transports(glass) == ["camera", "joined", "joined"]
    assert [entry.name for entry in glass.passes if entry.caustics] == ["target", "rough", "pbr", "empty"]
