"""What is said of caustics: *simulated* where light paths find them and nowhere else, by material and lamp."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture, range_of
from dataset_builder.label.scene_plan import FogPlan, LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.effects.caustics_told import GATHERS, HALF, LARGE, casters, large, throws_caustics, told
from dataset_builder.planning.effects.materials_used import MaterialUse
from dataset_builder.planning.effects.transport_choice import PassLight
from tests import plans

GLASS = {"transmission": 1.0, "roughness": 0.0}
CHROME = {"metallic": 1.0, "roughness": 0.05}
LACQUER = {"coat": 1.0, "coat_roughness": 0.1}
LAMPS = [name for name, kind in LIGHT_KINDS.items() if not kind.outside]


def use(name: str = "ware", **surface: Any) -> MaterialUse:
    material = Material(**{"name": name, "base_color": (0.5, 0.5, 0.5)} | surface)
    smoothest, roughest = range_of(material, "roughness")
    return MaterialUse(owner="vase", part="furniture", material=material, scattered=0.5, smoothest=smoothest,
                       roughest=roughest, area=LARGE)


def lit(*surfaces: dict[str, Any], kinds: tuple[str, ...] = ("area",), name: str = "target",
        depth: int = 12, spp: int = 64) -> PassLight:
    lights: tuple[LightPlan, ...] = tuple(plans.light_plan(kind).model_copy(update={"size": 0.05, "length": 0.2})
                                          for kind in kinds)
    return PassLight(name=name, lights=lights, materials=tuple(use(**each) for each in surfaces), fog=FogPlan(),
                     depth=depth, target_area=8.0, spp=spp)


def choices(light: PassLight, transport: str) -> list[str]:
    return [each.choice for each in told([(light, transport)])]  # type: ignore[list-item]


@pytest.mark.parametrize(("surface", "gathers"), [
    ({}, False), ({"roughness": 0.0}, False), ({"specular": 0.16, "roughness": 0.0}, False),
    (GLASS, True), (GLASS | {"roughness": GATHERS}, True), (GLASS | {"roughness": 0.4}, False),
    (GLASS | {"thin": True}, False), (GLASS | {"metallic": 1.0, "roughness": 0.5}, False),
    (CHROME, True), (CHROME | {"roughness": GATHERS}, True), (CHROME | {"roughness": 0.31}, False),
    (CHROME | {"metallic": 0.4}, False),
    (LACQUER, True), (LACQUER | {"coat": 0.4}, False), (LACQUER | {"coat_roughness": 0.31}, False),
    (LACQUER | GLASS | {"thin": True}, True)])
def test_smooth_glass_metal_and_coats_gather_light(surface: dict[str, Any], gathers: bool) -> None:
    light = lit({}, surface)
    assert len(casters(light)) == gathers == throws_caustics(light)
    assert (choices(light, "camera") == choices(light, "joined") == ["none"]) != gathers


@pytest.mark.parametrize(("depth", "glass", "chrome"), [(2, False, False), (3, False, True), (4, True, True)])
def test_paths_must_be_long_enough(depth: int, glass: bool, chrome: bool) -> None:
    """Camera, surface, mirror, lamp: 3 edges; glass is gone into and out of."""
    for surface, reached in ((GLASS, glass), (CHROME, chrome)):
        light = lit(surface, depth=depth)
        assert throws_caustics(light) == reached
        assert ("left out" in choices(light, "camera")) != reached
    both = told([(lit(GLASS | {"name": "ice"}, CHROME | {"name": "tin"}, depth=3), "joined")])
    assert [each.reason for each in both if each.choice == "left out"] == [
        "area light by way of ice of vase; paths of 3 edges are too short (target)"]


def test_nothing_throws_caustics_of_lamps_where_there_are_none() -> None:
    light = lit(GLASS, CHROME, kinds=("dome", "sun"))
    assert casters(light) and not throws_caustics(light)


@pytest.mark.parametrize("surface", [GLASS, GLASS | {"roughness": 0.2}, CHROME, LACQUER])
@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_at_such_spp_only_light_paths_simulate_them_and_only_from_lamps(kind: str, surface: dict[str, Any]) -> None:
    light = lit(surface, kinds=(kind,))
    assert "simulated" not in choices(light, "camera")
    assert choices(light, "joined").count("simulated") == (kind in LAMPS)


@pytest.mark.parametrize("kind", LIGHT_KINDS)
@pytest.mark.parametrize(("surface", "smooth", "wide"), [
    (GLASS, True, False), (GLASS | {"roughness": 0.2}, False, True), (CHROME, False, True)])
def test_without_them_light_is_noisy_or_left_out(kind: str, surface: dict[str, Any], smooth: bool,
                                                 wide: bool) -> None:
    """A light with extent is met by chance; one without cannot be met, and smooth glass has no lobe to find it with."""
    extended = LIGHT_KINDS[kind].extended  # type: ignore[index]
    expected = ["noisy"] * (extended or wide) + ["left out"] * (not extended and smooth)
    assert choices(lit(surface, kinds=(kind,)), "camera") == expected
    # What a mirror or glass shows of them stays as hard with light paths
    assert choices(lit(surface, kinds=(kind,)), "joined") == ["simulated"] * (kind in LAMPS) + expected


def test_lights_and_materials_are_named_with_the_passes() -> None:
    surfaces = (GLASS | {"name": "ice"}, CHROME | {"name": "tin"})
    source = lit(*surfaces, kinds=("dome",), name="source")
    target, rough = (lit(*surfaces, kinds=("point", "area", "dome"), name=name) for name in ("target", "rough"))
    found = told([(source, "camera"), (target, "joined"), (rough, "joined")])
    assert {each.effect for each in found} == {"caustics"}
    assert [(each.choice, each.reason) for each in found] == [
        ("noisy", "dome light by way of ice of vase, tin of vase; camera paths meet it by chance; expected error of a "
                  "pixel's share at least 8.1% to 32% at 64 spp (source, target, rough)"),
        ("simulated", "area and point light by way of ice of vase, tin of vase, found from the lamp's side where it "
                      "falls on diffuse surfaces; expected error of a pixel's share 78% to 160% at 64 spp (target, "
                      "rough)"),
        ("noisy", "point light that such surfaces show in mirrors or through glass, by way of tin of vase; without "
                  "extent, found only through narrow lobes; expected error of a pixel's share 10,000% at 64 spp "
                  "(target, rough)"),
        ("noisy", "area light that such surfaces show in mirrors or through glass, by way of ice of vase, tin of vase; "
                  "camera paths meet it by chance; expected error of a pixel's share 450% to 1,700% at 64 spp "
                  "(target, rough)"),
        ("left out", "point light that passes ice of vase and is seen through smooth glass again; without extent, no "
                     "path meets it (target, rough)")]


def test_glass_that_is_smooth_in_one_texel_and_rough_in_another_loses_caustics_and_has_noisy_ones() -> None:
    texels = Texture(base_color=np.ones((1, 2, 3), np.float32), roughness=np.array([[0, 1]], np.float32))
    light = lit({"name": "ice", "transmission": 1.0, "texture": texels},
                {"name": "foil", "metallic": 1.0, "texture": texels}, kinds=("point",), spp=1024)
    found = {each.choice: each.reason for each in told([(light, "camera")])}
    assert found.keys() == {"noisy", "left out"}
    assert "ice of vase, foil of vase;" in found["noisy"] and "by way of ice of vase;" in found["left out"]


def test_nothing_is_said_where_no_pass_with_light_runs() -> None:
    assert told([]) == []


# Small things

SMALL = 0.99 * LARGE


def sized(area: float, target_area: float = 8.0, *, kinds: tuple[str, ...] = ("area",), more: tuple[Any, ...] = (),
          **surface: Any) -> PassLight:
    """A pass with a caster of an area, `more` of some others."""
    first = replace(use("chrome", **(surface or CHROME)), area=area)
    return replace(lit(kinds=kinds), materials=(first, *more), target_area=target_area)


@pytest.mark.parametrize(("area", "target_area", "expected"), [
    (LARGE, 8.0, True), (SMALL, 8.0, False), (0.01, 0.02, True), (0.0099, 0.02, False), (SMALL, 2 * SMALL, True)])
def test_caustics_are_followed_where_casters_are_large_or_half_of_the_target(area: float, target_area: float,
                                                                             expected: bool) -> None:
    assert HALF == 0.5
    light = sized(area, target_area)
    assert throws_caustics(light) == bool(large(light)) == expected and casters(light)
    assert choices(light, "joined")[0] == ("simulated" if expected else "noisy")


def test_parts_of_one_thing_gather_light_together() -> None:
    half = replace(use("tin", **CHROME), area=LARGE / 2)
    assert large(sized(LARGE / 2, more=(half,)))
    assert not large(sized(LARGE / 2, more=(replace(half, owner="bowl"),)))


@pytest.mark.parametrize("kind", LAMPS)
@pytest.mark.parametrize(("surface", "smooth"), [(GLASS, True), (CHROME, False)])
def test_without_light_paths_small_things_are_as_with_camera_paths(kind: str, surface: dict[str, Any],
                                                                   smooth: bool) -> None:
    light = sized(SMALL, kinds=(kind,), **surface)
    assert choices(light, "joined") == choices(light, "camera")
    assert choices(light, "joined") == ["noisy" if LIGHT_KINDS[kind].extended or not smooth  # type: ignore[index]
                                        else "left out"]
    reason, as_camera = (told([(light, transport)])[0].reason for transport in ("joined", "camera"))  # type: ignore[list-item]
    assert reason.replace("; what is small has no light paths of its own", "") == as_camera != reason


def test_beside_large_things_small_ones_are_noisy() -> None:
    light = sized(SMALL, more=(use("ice", **GLASS), replace(use("wall", **CHROME), owner="bowl")))
    light = replace(light, materials=(replace(light.materials[0], owner="chest"), *light.materials[1:]))
    found = [(each.choice, each.reason) for each in told([(light, "joined")])]
    assert found[:2] == [
        ("simulated", "area light by way of ice of vase, wall of bowl, found from the lamp's side where it falls on "
                      "diffuse surfaces; expected error of a pixel's share 78% to 160% at 64 spp (target)"),
        ("noisy", "area light by way of small chrome of chest; few light paths meet it; expected error of a pixel's "
                  "share 160% at 64 spp (target)")]
