"""Lights of USD stages: values by hand from the formulas of UsdLux, and everything that is not honoured said."""

from math import pi, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from dataset_builder.assets.scene_readers.usd_lights import FoundLight, is_light, read_light
from dataset_builder.errors import UserError
from dataset_builder.geometry.light_axes import rectangle_axes
from dataset_builder.label.scene_plan import LightPlan

STAGE = Path("room.usda")
Z_FROM_Y = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
STAGES: list[Usd.Stage] = []
"""Prims do not keep their stage."""
BARE = {"intensity": 2.0, "exposure": 1.0, "color": (1.0, 0.5, 0.25)}
TOTAL = np.array([4.0, 2.0, 1.0])
"""Emission of BARE: 2 x 2^1 x colour."""


def prim_of(kind: str, shaping: bool = False, **inputs: Any) -> Usd.Prim:
    """A light with inputs by name; `__` stands for a colon, and `bare_` for an attribute that is no input."""
    STAGES.append(stage := Usd.Stage.CreateInMemory())
    prim = stage.DefinePrim("/World/Key", kind)
    if shaping:
        UsdLux.ShapingAPI.Apply(prim)
    types = {bool: Sdf.ValueTypeNames.Bool, str: Sdf.ValueTypeNames.Token, tuple: Sdf.ValueTypeNames.Color3f,
             Sdf.AssetPath: Sdf.ValueTypeNames.Asset}
    for name, value in inputs.items():
        key = name[5:] if name.startswith("bare_") else f"inputs:{name.replace('__', ':')}"
        prim.CreateAttribute(key, types.get(type(value), Sdf.ValueTypeNames.Float)).Set(value)
    return prim


def found(kind: str, world: np.ndarray | None = None, **inputs: Any) -> FoundLight:
    return read_light(STAGE, prim_of(kind, **inputs), np.eye(4) if world is None else world)


def plan(kind: str, world: np.ndarray | None = None, **inputs: Any) -> LightPlan:
    result = found(kind, world, **inputs)
    assert result.light is not None and result.light.name == "/World/Key" and result.light.light.weight == 0
    return result.light.light


def scaled(x: float, y: float, z: float) -> np.ndarray:
    return np.diag([x, y, z, 1.0])


@pytest.mark.parametrize(("kind", "sized", "area", "expected"), [
    ("RectLight", {"width": 2.0, "height": 0.5}, 1.0, {"kind": "area", "size": 2.0, "length": 0.5}),
    ("DiskLight", {"radius": 0.3}, pi * 0.09, {"kind": "disk", "size": 0.3}),
    ("SphereLight", {"radius": 0.2}, 4 * pi * 0.04, {"kind": "sphere", "size": 0.2}),
    ("CylinderLight", {"radius": 0.1, "length": 2.0}, 2 * pi * 0.2, {"kind": "cylinder", "size": 0.1, "length": 2.0}),
])
def test_area_lights_have_a_radiance_that_normalising_divides_by_their_area(kind: str, sized: dict[str, float],
                                                                             area: float,
                                                                             expected: dict[str, Any]) -> None:
    light = plan(kind, **BARE, **sized)
    assert light.radiance == pytest.approx(TOTAL)
    assert {key: getattr(light, key) for key in expected} == pytest.approx(expected)
    assert plan(kind, normalize=True, **BARE, **sized).radiance == pytest.approx(TOTAL / area)
    assert found(kind, **BARE, **sized).said == ()


@pytest.mark.parametrize(("kind", "sized", "scale", "expected", "area"), [
    ("RectLight", {"width": 2.0, "height": 0.5}, (3, 2, 1), {"size": 6.0, "length": 1.0}, 6.0),
    ("DiskLight", {"radius": 0.3}, (2, 2, 5), {"size": 0.6}, pi * 0.36),
    ("SphereLight", {"radius": 0.2}, (2, 2, 2), {"size": 0.4}, 4 * pi * 0.16),
    ("CylinderLight", {"radius": 0.1, "length": 2.0}, (3, 2, 2), {"size": 0.2, "length": 6.0}, 2 * pi * 1.2),
])
def test_scales_of_the_transform_are_taken_into_sizes_and_areas(kind: str, sized: dict[str, float],
                                                                scale: tuple[float, float, float],
                                                                expected: dict[str, float], area: float) -> None:
    light = plan(kind, scaled(*scale), normalize=True, **BARE, **sized)
    assert {key: getattr(light, key) for key in expected} == pytest.approx(expected)
    assert light.radiance == pytest.approx(TOTAL / area)


@pytest.mark.parametrize(("kind", "sized", "area"), [
    ("RectLight", {"width": 20.0, "height": 50.0}, 1000.0), ("DiskLight", {"radius": 30.0}, pi * 900),
    ("SphereLight", {"radius": 20.0}, 4 * pi * 400), ("CylinderLight", {"radius": 10.0, "length": 90.0}, 1800 * pi)])
def test_what_is_normalised_is_so_in_the_unit_of_the_stage(kind: str, sized: dict[str, float], area: float) -> None:
    """A stage in centimetres is as bright as the same numbers in metres."""
    prim = prim_of(kind, normalize=True, **BARE, **sized)
    light = read_light(STAGE, prim, scaled(0.01, 0.01, 0.01), unit=0.01).light
    assert light is not None and light.light.radiance == pytest.approx(TOTAL / area)
    point = read_light(STAGE, prim_of("SphereLight", radius=0.0, normalize=True, **BARE), scaled(0.01, 0.01, 0.01),
                       unit=0.01).light
    # What a ball of radius r units sends: pi (r / 100)^2 of its radiance, which is TOTAL / (4 pi r^2)
    assert point is not None and point.light.radiance == pytest.approx(TOTAL / 4 * 1e-4)


@pytest.mark.parametrize(("kind", "scale", "said"), [
    ("DiskLight", (1, 4, 1), "scale 1 4; an ellipse"), ("SphereLight", (1, 1, 8), "scale 1 1 8; an ellipsoid"),
    ("CylinderLight", (1, 4, 1), "scale 4 1; a cylinder of an ellipse")])
def test_uneven_scales_keep_the_area_or_volume_and_are_said(kind: str, scale: tuple[float, float, float],
                                                            said: str) -> None:
    assert plan(kind, scaled(*scale), radius=0.5).size == pytest.approx(1.0)
    assert f"light /World/Key: {said}" in found(kind, scaled(*scale), radius=0.5).said[0]


@pytest.mark.parametrize(("angle", "plain", "normalised"), [
    (0.0, 1.0, 1.0), (0.53, pi * sin(radians(0.265)) ** 2, 1.0), (180.0, pi, 1.0), (360.0, pi, 0.5)])
def test_a_distant_light_is_a_sun_of_what_its_disc_of_sky_sends(angle: float, plain: float, normalised: float) -> None:
    assert plan("DistantLight", angle=angle, **BARE).radiance == pytest.approx(TOTAL * plain)
    sun = plan("DistantLight", Z_FROM_Y, angle=angle, normalize=True, **BARE)
    assert sun.radiance == pytest.approx(TOTAL * normalised) and sun.kind == "sun"
    assert sun.direction == pytest.approx((0, 1, 0)) and sun.position == (0, 0, 0)
    assert bool(found("DistantLight", angle=angle, **BARE).said) == (angle > 1)
    assert plan("DistantLight", normalize=True).radiance == pytest.approx([50000] * 3)


def test_a_point_has_the_intensity_of_its_ball() -> None:
    ball = plan("SphereLight", radius=0.2, **BARE)
    point = plan("SphereLight", radius=0.2, bare_treatAsPoint=True, **BARE)
    assert point.kind == "point" and point.size == 0
    assert point.radiance == pytest.approx(np.array(ball.radiance) * pi * 0.04)
    for radius in (0.0, 0.2):
        one = plan("SphereLight", radius=radius, bare_treatAsPoint=True, normalize=True, **BARE)
        assert one.radiance == pytest.approx(TOTAL / 4)
    assert found("SphereLight", radius=0.0).said == ("light /World/Key of kind SphereLight left out: sends nothing",)


def test_colour_temperatures_multiply_the_colour_where_they_are_enabled() -> None:
    warm = np.array(UsdLux.BlackbodyTemperatureAsRgb(2700.0))
    light = plan("RectLight", enableColorTemperature=True, colorTemperature=2700.0, **BARE)
    assert light.radiance == pytest.approx(TOTAL * warm) and light.temperature == 2700
    assert warm[0] > 1.5 > 0.5 > warm[2]
    off = plan("RectLight", colorTemperature=2700.0, **BARE)
    assert off.radiance == pytest.approx(TOTAL) and off.temperature == 0
    hot = found("RectLight", enableColorTemperature=True, colorTemperature=20000.0)
    assert hot.light is not None and "colorTemperature 20000, taken as the nearest" in hot.said[0]
    assert hot.light.light.radiance == pytest.approx(np.array(UsdLux.BlackbodyTemperatureAsRgb(10000.0)))


@pytest.mark.parametrize("turn", [0, 30, -100])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize("mirror", [1, -1])
def test_a_rectangle_lies_as_its_axes_do(turn: float, axis: tuple[float, float, float], mirror: int) -> None:
    matrix = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(*axis), turn))
    world = np.array(matrix).T @ np.diag([mirror, 1, 1, 1.0])
    world[:3, 3] = 1, 2, 3
    light = plan("RectLight", world, width=2.0, height=0.5)
    first, second = rectangle_axes(light.direction, light.turn)
    assert light.position == (1, 2, 3) and light.direction == pytest.approx(-world[:3, 2])
    assert abs(first @ world[:3, 0]) == pytest.approx(1) and abs(second @ world[:3, 1]) == pytest.approx(1)


def test_a_cylinder_lies_along_x() -> None:
    assert plan("CylinderLight", Z_FROM_Y @ scaled(2, 1, 1)).direction == pytest.approx((1, 0, 0))
    line = plan("CylinderLight", radius=0.0, length=2.0, normalize=True, **BARE)
    assert np.array(line.radiance) * 2 * pi * line.size * line.length == pytest.approx(TOTAL)


def test_names_of_before_2021_are_read_and_said() -> None:
    light = found("SphereLight", bare_intensity=7.0)
    assert light.light is not None and light.light.light.radiance == (7, 7, 7)
    assert light.said == ("light /World/Key: intensity without `inputs:`, as before 2021, read as today's",)


@pytest.mark.parametrize(("inputs", "said"), [
    ({"diffuse": 0.5}, "multiplier of the diffuse response (diffuse 0.5)"),
    ({"specular": 0.0}, "multiplier of the specular response (specular 0)"),
    ({"shadow__enable": False}, "shadows switched off"), ({"shadow__color": (1.0, 0.0, 0.0)}, "colour of shadows"),
    ({"texture__file": Sdf.AssetPath("a.png")}, "image a.png (no folder to find it in)"),
    ({"shaping__cone__angle": 20.0}, "shaping:cone:angle without ShapingAPI")])
def test_what_no_light_of_ours_does_is_said(inputs: dict[str, Any], said: str) -> None:
    [line] = found("RectLight", **inputs).said
    assert line.startswith("light /World/Key: ") and said in line


def test_links_and_filters_are_said() -> None:
    prim = prim_of("RectLight")
    UsdLux.LightAPI(prim).GetLightLinkCollectionAPI().GetExcludesRel().AddTarget("/World/Wall")
    UsdLux.LightAPI(prim).GetShadowLinkCollectionAPI().GetIncludeRootAttr().Set(False)
    UsdLux.LightAPI(prim).GetFiltersRel().AddTarget("/World/Gobo")
    said = read_light(STAGE, prim, np.eye(4)).said
    assert [line.rpartition(": ")[2] for line in said] == ["light linking; it lights everything",
                                                           "shadow linking; it lights everything", "light filters"]


@pytest.mark.parametrize(("kind", "why"), [
    ("PortalLight", "a portal"), ("GeometryLight", "deprecated"), ("PluginLight", "own kind"),
    ("LightFilter", "light filters"), ("PluginLightFilter", "light filters"), ("Mesh", "a mesh or volume that shines")])
def test_what_is_no_light_of_ours_is_left_out_by_name(kind: str, why: str) -> None:
    prim = prim_of(kind)
    if kind == "Mesh":
        assert not is_light(prim)
        UsdLux.MeshLightAPI.Apply(prim)
    result = read_light(STAGE, prim, np.eye(4))
    assert is_light(prim) and result.light is None
    assert len(result.said) == 1 and "/World/Key" in result.said[0] and why in result.said[0]


def test_dark_and_hidden_lights_are_left_out_with_the_reason() -> None:
    for inputs in ({"intensity": 0.0}, {"color": (0.0, 0.0, 0.0)}, {"width": 0.0}):
        assert found("RectLight", **inputs).light is None and "sends nothing" in found("RectLight", **inputs).said[0]
    prim = prim_of("RectLight")
    UsdGeom.Imageable(prim).MakeInvisible()
    assert read_light(STAGE, prim, np.eye(4)).said == ("light /World/Key of kind RectLight left out: invisible",)


@pytest.mark.parametrize("inputs", [
    {"intensity": 1e30}, {"intensity": float("nan")}, {"intensity": -1.0}, {"exposure": 500.0},
    {"color": (1.0, float("inf"), 0.0)}, {"color": (-1.0, 0.0, 0.0)}, {"width": -2.0}, {"width": float("inf")},
    {"intensity": 1e10, "exposure": 20.0}, {"enableColorTemperature": True, "colorTemperature": float("nan")},
    {"normalize": True, "width": 1e-9, "height": 1e-9}])
def test_numbers_that_no_light_has_are_refused_by_file_and_prim(inputs: dict[str, Any]) -> None:
    with pytest.raises(UserError, match=r"room\.usda: /World/Key: expected .* got ") as caught:
        found("RectLight", **inputs)
    assert len(caught.value.problems) == 1 and "\n" not in str(caught.value)


@pytest.mark.parametrize("world", [scaled(0, 1, 1), np.full((4, 4), np.nan), np.array([[1, 1, 0, 0], [1, 1, 0, 0],
                                                                                      [0, 0, 1, 0], [0, 0, 0, 1.0]])])
def test_transforms_that_flatten_a_light_are_refused(world: np.ndarray) -> None:
    with pytest.raises(UserError, match=r"room\.usda: /World/Key: expected a transform"):
        found("RectLight", world)
