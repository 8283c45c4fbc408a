"""Every kind of light as UsdLux, by values worked out by hand, and read back as what it was."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux

from dataset_builder.assets.scene_readers.usd_lights import read_light
from dataset_builder.digest import sha256_file
from dataset_builder.exporting.light_prims import FALLOFF, LightWriter
from dataset_builder.exporting.texel_files import TexelFiles
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.view.emission import beam_of
from dataset_builder.rendering.scene.images import environment
from dataset_builder.shards.exr import decode, encode_picture
from tests.small_scenes import light, lit_by

SLANTED = (0.48, -0.6, -0.64)
LIGHTS = {
    "dome": {}, "sun": {"direction": SLANTED}, "area": {"direction": SLANTED, "size": 0.4, "length": 0.7, "turn": 25.0},
    "sphere": {"size": 0.2}, "point": {}, "spot": {"direction": SLANTED, "cutoff": 40.0},
    "disk": {"direction": SLANTED, "size": 0.3},
    "cylinder": {"direction": (0.6, 0.0, 0.8), "size": 0.05, "length": 1.2},
}


def written(tmp_path: Path, *lights, root: Path | None = None) -> tuple[Usd.Stage, tuple[str, ...]]:
    """A stage of lights, and what could not be said of them."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    writer = LightWriter(stage=stage, scope="/Lights", files=TexelFiles(folder=tmp_path), image_root=root or tmp_path)
    return stage, writer.write(lit_by(*lights))


@pytest.mark.parametrize("kind", LIGHT_KINDS)
def test_a_light_comes_back(tmp_path: Path, kind: str) -> None:
    plan = light(kind, (3.0, 6.0, 1.5), position=(0.3, -0.2, 2.1), **LIGHTS[kind])
    stage, lost = written(tmp_path, plan)
    prim, = stage.GetPrimAtPath("/Lights").GetChildren()
    world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T
    found = read_light(tmp_path / "lights.usda", prim, world)
    assert found.light is not None and lost == ((FALLOFF,) if kind == "spot" else ())
    back, row = found.light.light, LIGHT_KINDS[kind]
    assert back.kind == kind and back.radiance == pytest.approx(plan.radiance, rel=1e-6)
    if not row.outside:
        assert back.position == pytest.approx(plan.position)
    if row.aimed:
        assert abs(np.dot(back.direction, plan.direction)) == pytest.approx(1, abs=1e-9)
        assert kind == "cylinder" or np.dot(back.direction, plan.direction) > 0
    if row.sized:
        assert back.size == pytest.approx(plan.size, rel=1e-6)
    if kind in ("area", "cylinder"):
        assert back.length == pytest.approx(plan.length, rel=1e-6)
    if kind == "area":
        assert back.turn == pytest.approx(25, abs=1e-4)
    if row.beamed:
        assert (back.cutoff, beam_of(back)) == pytest.approx((plan.cutoff, beam_of(plan)), rel=1e-6)


def test_radiance_is_intensity_times_colour(tmp_path: Path) -> None:
    stage, _ = written(tmp_path, light("area", (3.0, 6.0, 1.5)))
    api = UsdLux.LightAPI(stage.GetPrimAtPath("/Lights/area_0"))
    assert api.GetIntensityAttr().Get() == 6 and tuple(api.GetColorAttr().Get()) == (0.5, 1, 0.25)
    assert api.GetExposureAttr().Get() == 0 and api.GetNormalizeAttr().Get() is False


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_point_has_the_power_of_its_intensity(tmp_path: Path, kind: str) -> None:
    """UsdLux: a normalised ball sends radiance intensity / (4 pi r^2), so power pi * intensity; ours is 4 pi W/sr."""
    stage, _ = written(tmp_path, light(kind, (2.0, 2.0, 2.0)))
    ball = UsdLux.SphereLight(stage.GetPrimAtPath(f"/Lights/{kind}_0"))
    assert ball.GetTreatAsPointAttr().Get() and ball.GetNormalizeAttr().Get()
    assert np.pi * ball.GetIntensityAttr().Get() == pytest.approx(4 * np.pi * 2.0)


def test_dark_lights_are_not_written(tmp_path: Path) -> None:
    stage, _ = written(tmp_path, light("area", (0.0, 0.0, 0.0)), light("sphere"))
    assert [prim.GetName() for prim in stage.GetPrimAtPath("/Lights").GetChildren()] == ["sphere_1"]


def test_a_sky_keeps_its_image_and_its_turn(tmp_path: Path) -> None:
    """USD's zenith is +Y and its middle +Z, as pxr's own shader has it; ours are +Z and, turned by 90, +Y."""
    pixels = np.full((32, 64, 3), 0.5, np.float32)
    pixels[4:8, 10:20] = (4.0, 2.0, 1.0)
    (tmp_path / "sky.exr").write_bytes(encode_picture(pixels, name="sky"))
    plan = light("dome", (2.0, 2.0, 2.0), image="sky.exr", image_sha256=sha256_file(tmp_path / "sky.exr"), turn=90.0)
    stage, _ = written(tmp_path, plan)
    prim = stage.GetPrimAtPath("/Lights/dome_0")
    matrix = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(prim)).T
    np.testing.assert_allclose(matrix[:3, :3] @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(matrix[:3, :3] @ [0, 0, 1], [0, 1, 0], atol=1e-12)
    shown = UsdLux.DomeLight(prim).GetTextureFileAttr().Get().path
    np.testing.assert_array_equal(decode((tmp_path / shown).read_bytes()), environment(pixels))
