"""Cones, domes and images of USD lights, worked out by hand."""

from math import pi
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd, UsdGeom, UsdLux

from dataset_builder.assets.scene_readers.usd_light_images import ImageFinder, ImageFound
from dataset_builder.assets.scene_readers.usd_lights import FoundLight, read_light
from dataset_builder.digest import sha256_file
from dataset_builder.errors import UserError
from dataset_builder.label.scene_plan import LightPlan
from tests.assets.scene_readers.test_usd_lights import BARE, STAGE, TOTAL, Z_FROM_Y, prim_of
from tests.rendering.scene.test_emitters import radiance_from, spot_of_sky, written
from tests.small_scenes import lit_by


def found(kind: str, **inputs: Any) -> FoundLight:
    return read_light(STAGE, prim_of(kind, shaping=True, **inputs), np.eye(4))


def plan(kind: str, **inputs: Any) -> LightPlan:
    result = found(kind, **inputs)
    assert result.light is not None
    return result.light.light


@pytest.mark.parametrize(("kind", "sized", "area"), [
    ("SphereLight", {"radius": 0.1}, pi * 0.01), ("DiskLight", {"radius": 0.1}, pi * 0.01),
    ("RectLight", {"width": 0.3, "height": 0.2}, 0.06), ("CylinderLight", {"radius": 0.1, "length": 0.3}, 0.06)])
def test_small_lights_with_a_cone_are_spots_of_their_intensity(kind: str, sized: dict[str, float],
                                                               area: float) -> None:
    inputs = {"shaping__cone__angle": 40.0, "shaping__cone__softness": 0.25, **sized, **BARE}
    spot = plan(kind, **inputs)
    assert (spot.kind, spot.cutoff, spot.beam, spot.size, spot.length) == ("spot", 40, 30, 0, 0)
    assert spot.radiance == pytest.approx(TOTAL * area) and spot.direction == (0, 0, -1)
    assert [line.partition(": ")[2].partition(" of ")[0] for line in found(kind, **inputs).said] == ["extent",
                                                                                                  "smooth edge"]


def test_a_point_with_a_cone_keeps_its_intensity() -> None:
    spot = plan("SphereLight", bare_treatAsPoint=True, normalize=True, shaping__cone__angle=40.0, **BARE)
    assert spot.kind == "spot" and spot.radiance == pytest.approx(TOTAL / 4) and spot.beam == 40
    assert found("SphereLight", bare_treatAsPoint=True, shaping__cone__angle=40.0).said == ()


def test_a_cone_that_takes_nothing_away_changes_nothing() -> None:
    for kind, angle, spot in (("RectLight", 90.0, False), ("SphereLight", 180.0, False), ("SphereLight", 90.0, True),
                              ("RectLight", 89.0, True)):
        light = plan(kind, width=0.1, height=0.1, radius=0.1, shaping__cone__angle=angle)
        assert (light.kind == "spot") == spot
    assert plan("SphereLight", radius=0.1).kind == "spot", "the schema's own cone is 90 degrees"


@pytest.mark.parametrize(("kind", "inputs", "said"), [
    ("RectLight", {"width": 2.0, "shaping__cone__angle": 30.0}, "cone of 30 degrees, since the light is 2 m across"),
    ("RectLight", {"shaping__focus": 3.0}, "focus 3"),
    ("RectLight", {"shaping__ies__file": Sdf.AssetPath("lamp.ies")}, "IES profile lamp.ies")])
def test_other_shaping_is_said_and_the_light_stays(kind: str, inputs: dict[str, Any], said: str) -> None:
    assert plan(kind, **inputs).kind == "area"
    assert [line for line in found(kind, **inputs).said if said in line]
    assert not found("RectLight", shaping__focus=3.0, shaping__focusTint=(1.0, 1.0, 1.0)).said


def finder(folder: Path) -> ImageFinder:
    return lambda asset: ImageFound(path=folder / asset.path, root=folder)


def dome(folder: Path, world: np.ndarray, kind: str = "DomeLight", **inputs: Any) -> FoundLight:
    prim = prim_of(kind, texture__file=Sdf.AssetPath("image.exr"), **inputs)
    return read_light(STAGE, prim, world, image=finder(folder))


def turned(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("turn", [0.0, 70.0])
@pytest.mark.parametrize("kind", ["DomeLight", "DomeLight_1"])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_dome_shines_from_where_openexr_has_it(tmp_path: Path, turn: float, kind: str, up: str) -> None:
    """A quarter from the left, longitude is a quarter turn: the light's +x, in stages of either axis up."""
    from dataset_builder.rendering.backend import activate
    from dataset_builder.rendering.scene.emitters import emitters

    activate("llvm")
    fields = written(tmp_path, spot_of_sky(0.25, 0.5))
    prim = prim_of(kind, texture__file=Sdf.AssetPath("image.exr"), **BARE)
    UsdGeom.SetStageUpAxis(prim.GetStage(), up)
    # An upright DomeLight of a stage with Z up is turned to it; that of DomeLight_1 stands upright as it is
    stands = np.eye(4) if up == "Z" and kind == "DomeLight_1" else Z_FROM_Y
    light = read_light(STAGE, prim, turned(turn) @ stands, image=finder(tmp_path)).light
    assert light is not None and (light.light.image, light.light.image_sha256) == tuple(fields.values())
    towards = turned(turn)[:3, :3] @ (1, 0, 0)
    seen = radiance_from(emitters(lit_by(light.light.model_copy(update={"weight": 1.0})), tmp_path), towards.tolist())
    assert seen == pytest.approx(TOTAL * (9, 6, 3), rel=1e-3)


def test_domes_that_lean_or_are_mirrored_are_said(tmp_path: Path) -> None:
    written(tmp_path, spot_of_sky(0.25, 0.5))
    assert dome(tmp_path, Z_FROM_Y).said == ()
    assert "tilt of 90 degrees" in dome(tmp_path, np.eye(4)).said[0]
    assert "a mirrored image" in dome(tmp_path, Z_FROM_Y @ np.diag([-1, 1, 1, 1.0])).said[0]
    plain = read_light(STAGE, prim_of("DomeLight", **BARE), np.eye(4))
    assert plain.said == () and plain.light is not None and plain.light.light.radiance == pytest.approx(TOTAL)
    # An image of one colour, as Blender writes it for a world without an image, looks the same from all sides
    written(tmp_path, np.ones_like(spot_of_sky(0.25, 0.5)))
    assert dome(tmp_path, np.eye(4)).said == ()


@pytest.mark.parametrize(("made", "inputs", "said"), [
    ("image.exr", {"texture__format": "mirroredBall"}, "layout mirroredBall"),
    ("none.exr", {}, "image image.exr ("), ("black.exr", {}, "it is black")])
def test_images_that_cannot_be_shown_leave_the_colour(tmp_path: Path, made: str, inputs: dict[str, Any],
                                                      said: str) -> None:
    pixels = spot_of_sky(0.25, 0.5)
    written(tmp_path, pixels * (made != "black.exr"), "image.exr" if made == "black.exr" else made)
    result = dome(tmp_path, Z_FROM_Y, **BARE, **inputs)
    assert said in result.said[0] and "colour alone" in result.said[0]
    assert result.light is not None and result.light.light.radiance == pytest.approx(TOTAL)
    assert result.light.light.image == ""


def test_a_rectangle_is_as_bright_as_its_image(tmp_path: Path) -> None:
    mi.Bitmap(np.full((4, 4, 3), 128, np.uint8)).write(str(tmp_path / "a.png"))
    prim = prim_of("RectLight", texture__file=Sdf.AssetPath("a.png"), **BARE)
    result = read_light(STAGE, prim, np.eye(4), image=finder(tmp_path))
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert result.light is not None and result.light.light.radiance == pytest.approx(TOTAL * linear, rel=1e-5)
    assert result.light.light.image_sha256 == sha256_file(tmp_path / "a.png")
    assert result.said == ()
    jpg = read_light(STAGE, prim_of("RectLight", texture__file=Sdf.AssetPath("a.jpg")), np.eye(4),
                     image=finder(tmp_path))
    assert ".jpg, where .exr and .png are read" in jpg.said[0]


@pytest.mark.parametrize("world", [np.eye(4), turned(70), Z_FROM_Y, turned(-30) @ Z_FROM_Y])
def test_the_image_of_a_rectangle_has_its_first_pixel_at_plus_x_and_y(tmp_path: Path, world: np.ndarray) -> None:
    from dataset_builder.rendering.backend import activate
    from dataset_builder.rendering.scene.emitters import emitters

    activate("llvm")
    pixels = np.full((4, 4, 3), 0.25)
    pixels[0, 0], pixels[0, 3], pixels[3, 0] = 4, 2, 1
    written(tmp_path, pixels)
    far = world.copy()
    far[:3, 3] = 3 * world[:3, 2]
    prim = prim_of("RectLight", texture__file=Sdf.AssetPath("image.exr"), width=2.0, height=1.0)
    result = read_light(STAGE, prim, far, image=finder(tmp_path))
    assert result.light is not None and result.said == ()
    made = emitters(lit_by(result.light.light.model_copy(update={"weight": 1.0})), tmp_path)
    for x, y, value in ((0.9, 0.45, 4), (-0.9, 0.45, 2), (0.9, -0.45, 1), (-0.9, -0.45, 0.25)):
        assert radiance_from(made, (world[:3, :3] @ (x, y, 3)).tolist()) == pytest.approx([value] * 3, rel=0.02)
    mirror = far @ np.diag([-1, 1, 1, 1.0])
    assert "a mirrored image" in read_light(STAGE, prim, mirror, image=finder(tmp_path)).said[0]


def test_what_a_stage_animates_is_read_at_its_first_time() -> None:
    prim = prim_of("RectLight")
    attribute = UsdLux.LightAPI(prim).GetIntensityAttr()
    for time, value in ((3.0, 5.0), (9.0, 50.0)):
        attribute.Set(value, Usd.TimeCode(time))
    light = read_light(STAGE, prim, np.eye(4)).light
    assert light is not None and light.light.radiance == (5, 5, 5)


TYPES = {Sdf.ValueTypeNames.Float: st.floats(width=32), Sdf.ValueTypeNames.Token: st.text(max_size=4),
         Sdf.ValueTypeNames.Bool: st.booleans(), Sdf.ValueTypeNames.Int: st.integers(-9, 9),
         Sdf.ValueTypeNames.Color3f: st.tuples(*[st.floats(-1, 2, width=32)] * 3),
         Sdf.ValueTypeNames.FloatArray: st.lists(st.floats(width=32), max_size=4)}
INPUTS = ("intensity", "exposure", "color", "normalize", "enableColorTemperature", "colorTemperature", "diffuse",
          "width", "height", "radius", "length", "angle", "texture:file", "texture:format", "shaping:cone:angle",
          "shaping:cone:softness", "shaping:focus", "shaping:focusTint", "shadow:color", "shadow:enable")
KINDS = ("RectLight", "DiskLight", "SphereLight", "CylinderLight", "DistantLight", "DomeLight", "DomeLight_1")


@settings(max_examples=200, deadline=None)
@given(chosen=st.data())
def test_whatever_the_inputs_are_a_light_is_read_left_out_or_refused_in_one_line(chosen: st.DataObject) -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/World/Key", chosen.draw(st.sampled_from(KINDS)))
    if chosen.draw(st.booleans()):
        UsdLux.ShapingAPI.Apply(prim)
    for name in chosen.draw(st.lists(st.sampled_from(INPUTS), max_size=4, unique=True)):
        kind = chosen.draw(st.sampled_from([*TYPES]))
        spec = stage.GetRootLayer().GetPrimAtPath("/World/Key")
        Sdf.AttributeSpec(spec, f"inputs:{name}", kind).default = chosen.draw(TYPES[kind])
    world = np.eye(4)
    world[:3] = chosen.draw(st.lists(st.floats(-3, 3) | st.just(0.0) | st.just(1e30), min_size=12,
                                     max_size=12).map(lambda values: np.reshape(values, (3, 4))))
    try:
        result = read_light(STAGE, prim, world)
    except UserError as error:
        assert str(error).startswith("room.usda: /World/Key: expected ") and "\n" not in str(error)
        return
    assert result.light is not None or len(result.said) == 1
    if result.light is not None:
        light = result.light.light
        assert np.isfinite([*light.radiance, *light.position, light.size, light.length, light.turn]).all()
        assert min(light.radiance) >= 0 < max(light.radiance)
        assert light.kind in ("point", "dome") or np.linalg.norm(light.direction) in (0, pytest.approx(1))
