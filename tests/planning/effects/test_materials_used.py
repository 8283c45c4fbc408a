"""Bounds on what a material scatters, against the renderer's own table and numbers worked out by hand."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dataset_builder.assets.asset import Asset, Material, Texture
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.planning.effects import materials_used
from dataset_builder.planning.effects.materials_used import glass_share, mean_schlick, scattered_share
from dataset_builder.planning.scene.room_parts import RoomPart
from dataset_builder.rendering.surface.reflectance import cosines, split_sum_table
from tests.plans import example_plan

SHARES = st.floats(0, 1)
COSINE = cosines()
TABLE = split_sum_table().astype(float)
MEAN = 1 / 21


def material(**more: object) -> Material:
    return Material(**{"name": "m", "base_color": (0.5, 0.2, 0.1), "specular": 0.0} | more)  # type: ignore[arg-type]


def textured(texels: np.ndarray, **maps: np.ndarray) -> Texture:
    return Texture(base_color=texels.astype(np.float32), **maps)


@given(f0=st.tuples(SHARES, SHARES, SHARES))
def test_no_roughness_reflects_more_than_the_bound(f0: tuple[float, float, float]) -> None:
    """What facets scatter again included, for light from everywhere."""
    f90, once = min(50 * max(f0), 1), TABLE.sum(axis=-1)
    for channel, bound in zip(f0, mean_schlick(np.array(f0)), strict=True):
        reflected = TABLE @ (channel, f90) * (1 + channel * (1 - once) / once)
        assert np.trapezoid(reflected * 2 * COSINE, COSINE, axis=1).max() <= bound + 1e-3


def test_glass_counts_where_a_map_leaves_it_opaque() -> None:
    clear = material(base_color=(1, 1, 1), transmission=1.0)
    white = np.ones((1, 2, 3))
    assert scattered_share(clear) == pytest.approx(glass_share(1.5, False))
    spotted = material(base_color=(1, 1, 1), transmission=1.0, texture=textured(white, transmission=np.array([[1, 0]])))
    assert scattered_share(spotted) == pytest.approx(1)
    shut = material(transmission=1.0, texture=textured(white, transmission=np.array([[0, 0]])))
    assert scattered_share(shut) == pytest.approx(0.5)


def test_a_matte_surface_scatters_its_brightest_texel() -> None:
    texels = np.array([[[0.2, 0.4, 0.1], [0.3, 0.1, 0.1]]])
    assert scattered_share(material()) == pytest.approx(0.5)
    assert scattered_share(material(base_color=(1, 1, 1), texture=textured(texels))) == pytest.approx(0.4)
    assert scattered_share(material(base_color=(0.5, 1, 1), texture=textured(texels))) == pytest.approx(0.4)


def test_texels_that_are_no_colours_count_as_white() -> None:
    texels = np.array([[[np.nan, 0.1, 0.1], [0.2, 1e8, -3.0]]])
    assert scattered_share(material(base_color=(0.7, 0.8, 0.6), texture=textured(texels))) == pytest.approx(0.8)


def test_layers_pass_on_what_they_do_not_reflect() -> None:
    gloss = 0.04 + 0.96 * MEAN
    assert scattered_share(material(specular=0.04)) == pytest.approx(gloss + 0.5 * (1 - gloss))
    assert scattered_share(material(coat=1.0)) == pytest.approx(gloss + 0.5 * (1 - gloss))
    assert scattered_share(material(sheen=(0.2, 0.0, 0.0))) == pytest.approx(0.2 + 0.5 * 0.8)
    assert scattered_share(material(metallic=1.0)) == pytest.approx(0.5 + 0.5 * MEAN)


def test_metallic_texels_count_where_they_scatter_most() -> None:
    mixed = textured(np.ones((1, 2, 3)), metallic=np.array([[0.0, 1.0]], dtype=np.float32))
    both = scattered_share(material(metallic=1.0, texture=mixed, specular=0.0))
    assert both == max(scattered_share(material(metallic=m, specular=0.0)) for m in (0.0, 1.0))


def test_glass_scatters_what_its_faces_reflect() -> None:
    """0.0918: D. Judd, "Fresnel Reflection of Diffusely Incident Light" (1942), for n = 1.5."""
    assert glass_share(1.5, thin=False) == pytest.approx(0.0918, abs=5e-4)
    assert glass_share(1.5, thin=False) < glass_share(1.5, thin=True) < 2 * glass_share(1.5, thin=False)
    assert glass_share(1.0, thin=True) == pytest.approx(0, abs=1e-12)
    clear = material(base_color=(1, 1, 1), transmission=1.0)
    assert scattered_share(clear) == pytest.approx(glass_share(1.5, thin=False))
    half = material(base_color=(1, 1, 1), transmission=0.5)
    assert scattered_share(half) == pytest.approx((1 + glass_share(1.5, thin=False)) / 2)


@given(base=st.tuples(SHARES, SHARES, SHARES), metallic=SHARES, specular=st.floats(0, 0.16), transmission=SHARES,
       coat=SHARES, sheen=st.tuples(SHARES, SHARES, SHARES), thin=st.booleans(), ior=st.floats(1, 3))
def test_no_material_scatters_more_than_all(**figures: object) -> None:
    figures["base_color"] = figures.pop("base")
    assert 0 <= scattered_share(material(**figures)) <= 1


def test_colours_of_vertices_bound_what_a_material_scatters() -> None:
    """As a base colour does; a path depth from white would be without end."""
    white = Material(name="vertex colours", base_color=(1, 1, 1), specular=0.0)
    assert scattered_share(white, (0.5, 0.4, 0.3)) == pytest.approx(0.5)
    assert scattered_share(white) == pytest.approx(1)


def test_areas_are_those_of_the_faces_that_show_a_material(monkeypatch: pytest.MonkeyPatch) -> None:
    """A square of side 2 of two materials, once in its own size and once three times as large, mirrored."""
    mesh = TriangleMesh(positions=np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 1, 0]]),
                        faces=np.array([[0, 1, 2], [0, 2, 3]]), uvs=np.zeros((2, 3, 2)), material=np.array([2, 0]))
    asset = Asset(name="sheet", category="table", mesh=mesh, materials=(material(),) * 3, meta={})
    large = RoomPart(name="large", part="furniture", asset=asset, instance=3, world=np.diag([-3.0, 3, 3, 1]))
    monkeypatch.setattr(materials_used, "room_parts", lambda *_: (large,))
    monkeypatch.setattr(materials_used, "asset_of", lambda *_: asset)
    plan = example_plan()
    use = materials_used.scene_use(plan.room, (plan.target,), Path())
    assert [(each.owner, each.area) for each in use.materials] == [
        ("large", pytest.approx(9)), ("large", pytest.approx(18)),
        (plan.target.object.name, pytest.approx(1)), (plan.target.object.name, pytest.approx(2))]
    assert use.area_of("large") == pytest.approx(27) and use.area_of(plan.target.object.name) == pytest.approx(3)
