"""Materials as UsdPreviewSurface, read back by our own reader as what they were."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdValidation

from dataset_builder.assets.asset import Material, Texture, reflectance_at
from dataset_builder.assets.readers.usd_materials import read_preview_surface
from dataset_builder.exporting.mesh_prims import welded, write_mesh
from dataset_builder.exporting.preview_surfaces import SurfaceWriter, index_of, not_said
from dataset_builder.exporting.texel_files import TexelFiles
from dataset_builder.seeding import rng
from tests.small_scenes import ball, sheet

PLAIN = Material(name="paint: blue", base_color=(0.1, 0.3, 0.7), roughness=0.35, metallic=0.25, specular=0.03)
EVERYTHING = replace(PLAIN, coat=0.5, coat_roughness=0.2, emission=(2.0, 1.0, 0.5), alpha=0.8, alpha_cutoff=0.5)


def texture(**maps: np.ndarray) -> Texture:
    base = rng(1, "base").uniform(0, 1, (8, 16, 3)).astype(np.float32)
    return Texture(**{"base_color": base, "wrap": ("mirror", "clamp"), **maps})


def shade(*path: str) -> np.ndarray:
    return rng(1, *path).uniform(0, 1, (8, 16)).astype(np.float32)


def normals() -> np.ndarray:
    vectors = rng(1, "normal").normal(size=(8, 16, 3)) * (0.2, 0.2, 0) + (0, 0, 1)
    return (vectors / np.linalg.norm(vectors, axis=2, keepdims=True)).astype(np.float32)


def surfaces(folder: Path, sky: float = 1.0) -> SurfaceWriter:
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    UsdGeom.Scope.Define(stage, "/Materials")
    return SurfaceWriter(stage=stage, scope="/Materials", files=TexelFiles(folder=folder), sky=sky)


def back(folder: Path, material: Material, sky: float = 1.0) -> Material:
    writer = surfaces(folder, sky)
    made = writer.material(material)
    writer.stage.GetRootLayer().Save()
    surface = made.ComputeSurfaceSource()[0]
    return read_preview_surface(folder / "stage.usda", surface, material.name, 4096, (folder,)).file.material


@pytest.mark.parametrize("specular", [0.0, 0.001, 0.04, 0.16])
def test_the_index_has_the_reflectance(specular: float) -> None:
    assert reflectance_at(index_of(specular)) == pytest.approx(specular, abs=1e-12)


@pytest.mark.parametrize("material", [PLAIN, EVERYTHING], ids=["plain", "everything"])
def test_factors_survive(tmp_path: Path, material: Material) -> None:
    found = back(tmp_path, material)
    assert found.alpha_cutoff == material.alpha_cutoff
    for name in ("base_color", "roughness", "metallic", "specular", "coat", "emission", "alpha"):
        assert getattr(found, name) == pytest.approx(getattr(material, name), rel=1e-6), name


def test_emission_is_in_units_of_radiance(tmp_path: Path) -> None:
    assert back(tmp_path, EVERYTHING, sky=3.0).emission == pytest.approx((6.0, 3.0, 1.5))


def test_texels_survive(tmp_path: Path) -> None:
    """Times their factors, in single precision; normals within what encoding rounds off."""
    own = texture(roughness=shade("roughness"), metallic=shade("metallic"), normal=normals(), alpha=shade("alpha"),
                  coat=shade("coat"))
    found = back(tmp_path, replace(EVERYTHING, alpha_cutoff=None, texture=own))
    assert found.texture is not None and found.texture.wrap == ("mirror", "clamp")
    factors = {"base_color": PLAIN.base_color, "roughness": 0.35, "metallic": 0.25, "alpha": 0.8, "coat": 0.5}
    for name, factor in factors.items():
        np.testing.assert_allclose(getattr(found.texture, name), getattr(own, name) * np.float32(factor), rtol=1e-5,
                                   atol=1e-7, err_msg=name)
    np.testing.assert_allclose(found.texture.normal, own.normal, atol=1e-6)


def test_what_8_bits_hold_is_png(tmp_path: Path) -> None:
    files = TexelFiles(folder=tmp_path)
    levels = np.arange(256, dtype=np.float32).reshape(16, 16) / np.float32(255)
    exact = files.write(levels, "levels", color=False)
    assert exact.path.endswith(".png") and exact.space == "raw"
    assert files.write(levels, "others", color=False) == exact
    assert files.write(levels * np.float32(0.999), "floats", color=True).path.endswith(".exr")


def test_what_cannot_be_said_is_named(tmp_path: Path) -> None:
    odd = replace(PLAIN, sheen=(0.5, 0.5, 0.5), transmission=0.9, thin=True, abbe=40.0,
                  texture=texture(specular=shade("specular"), sheen_roughness=shade("sheen"), transmission=shade("t")))
    odd = replace(odd, texture=replace(odd.texture, nearest=True))
    said = " ".join(not_said(odd))
    assert all(word in said for word in ("sheen", "transmission", "thin", "dispersion", "specular", "squares"))
    writer = surfaces(tmp_path)
    made = writer.material(odd)
    assert tuple(made.GetPrim().GetCustomDataByKey("notSaid")) == not_said(odd)
    assert set(writer.lost) == set(not_said(odd)) and not not_said(EVERYTHING)


def test_glass_is_seen_through(tmp_path: Path) -> None:
    writer = surfaces(tmp_path)
    shader = writer.material(replace(PLAIN, metallic=0.0, transmission=0.75)).ComputeSurfaceSource()[0]
    assert shader.GetInput("opacity").Get() == pytest.approx(0.25) and not shader.GetInput("opacityMode")
    covered = writer.material(replace(PLAIN, alpha=0.5)).ComputeSurfaceSource()[0]
    assert covered.GetInput("opacityMode").Get() == "presence"


def test_colours_of_vertices(tmp_path: Path) -> None:
    """Factors are multiplied in, since the surface has no place for both."""
    colors = np.linspace(0, 1, 24, dtype=np.float32).reshape(2, 3, 4)
    writer = surfaces(tmp_path)
    mesh = write_mesh(writer.stage, "/Mesh", sheet(replace(PLAIN, alpha=0.5), 0.0, 1.0, colors=colors), writer)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    np.testing.assert_allclose(np.array(primvars.GetPrimvar("displayColor").Get()).reshape(2, 3, 3),
                               colors[..., :3] * PLAIN.base_color, rtol=1e-6)
    np.testing.assert_allclose(np.array(primvars.GetPrimvar("displayOpacity").Get()), colors[..., 3].ravel() / 2)
    surface = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0].ComputeSurfaceSource()[0]
    assert surface.GetInput("diffuseColor").HasConnectedSource() and surface.GetInput("opacity").HasConnectedSource()
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    names = {error.GetName() for error in context.Validate(writer.stage)}
    assert names <= {"MissingDefaultPrim", "MissingUpAxisMetadata", "MissingMetersPerUnitMetadata"}


def test_points_are_welded_in_the_order_of_faces() -> None:
    soup = ball(PLAIN, segments=4)
    points, faces = welded(soup.corners)
    np.testing.assert_array_equal(points[faces], soup.corners.astype(np.float32))
    assert len(np.unique(points, axis=0)) == len(points) and faces.ravel()[0] == 0
    firsts = np.unique(faces.ravel(), return_index=True)[1]
    assert (np.diff(firsts) > 0).all()
