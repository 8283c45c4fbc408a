"""What textures and vertices say beyond colour, gloss and bumps, and where textures end."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from dataset_builder.assets.asset import MORE_MAPS, Material, Texture
from dataset_builder.errors import PlanError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.rough_base import displace
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.scene.triangle_soup import merge, soup_of
from dataset_builder.rendering.surface.bsdf import PLUGIN
from dataset_builder.rendering.surface.material_table import MaterialTable, Textures, VertexColours
from dataset_builder.rendering.surface.texels import needs
from tests.rendering.surface.surface_bench import hemisphere, interaction, surface_of
from tests.small_scenes import sheet

RICH = Material(name="rich", base_color=(0.6, 0.5, 0.4), roughness=0.5, specular=0.16, transmission=0.8, ior=1.4,
                coat=0.8, coat_roughness=0.8, sheen=(0.8, 0.6, 0.4), sheen_roughness=0.9, emission=(1.0, 2.0, 3.0),
                alpha=0.9)


def white(**maps):
    return Texture(base_color=np.ones((1, 1, 3), np.float32), **maps)


def told(material):
    """All that a surface says at one point, as one array."""
    surface, si, width = surface_of(material), interaction(0.6, 64), 64
    value, pdf = surface.eval_pdf(mi.BSDFContext(), si, hemisphere(1, width), mi.Bool(True))
    parts = [*surface.reflectance(si, mi.Bool(True)), surface.emission(si, mi.Bool(True)),
             surface.coverage(si, mi.Bool(True)), value, pdf]
    return np.concatenate([np.array(part + dr.zeros(mi.Float, width)).ravel() for part in parts])


@pytest.mark.parametrize("name", [*MORE_MAPS, "alpha"])
def test_every_map_multiplies_its_factor(name):
    factor = getattr(RICH, name)
    texels = np.float32([0.5, 0.25, 0.75] if isinstance(factor, tuple) else [0.5])
    shape = (1, 1, 3) if isinstance(factor, tuple) else (1, 1)
    product = tuple(np.multiply(factor, texels)) if isinstance(factor, tuple) else factor * float(texels[0])
    mapped = told(replace(RICH, texture=white(**{name: texels.reshape(shape)})))
    assert np.allclose(mapped, told(replace(RICH, **{name: product})), rtol=1e-3, atol=1e-5)
    assert not np.allclose(mapped, told(RICH), rtol=1e-2)


def test_a_texture_of_many_maps_shares_a_scene_with_one_of_few():
    """Rows of both kinds, and the masked gather beyond the last texel."""
    plain = Material(name="plain", base_color=(1, 1, 1), specular=0.0, emission=(1, 1, 1), texture=white())
    mapped = replace(plain, texture=white(emission=np.full((1, 1, 3), 0.5, np.float32)))
    for order in ((plain, mapped), (mapped, plain)):
        si = interaction(1.0, 2)
        si.prim_index = mi.UInt32([0, 1])
        found = np.array(surface_of(*order).emission(si, mi.Bool(True)))[0]
        assert np.allclose(found, [1, 0.5] if order[0] is plain else [0.5, 1])


@pytest.mark.parametrize(("wrap", "u", "expected"), [
    ("repeat", (0.125, 1.125, -0.875, 0.0), (1, 1, 1, 2.5)),
    ("mirror", (0.125, 1.875, -0.125, 0.0, 1.125, 1.0), (1, 1, 1, 1, 4, 4)),
    ("clamp", (0.125, -3.0, 0.0, 7.5, 1.0, 0.25), (1, 1, 1, 4, 4, 1.5)),
])
@pytest.mark.parametrize("axis", (0, 1))
def test_textures_repeat_turn_back_or_end(wrap, u, expected, axis):
    """Four texels of 1 to 4 quarters along one axis; row 0 is at v = 1."""
    texels = np.float32([1, 2, 3, 4]) / 4
    grey = np.stack([texels] * 3, axis=-1)
    base = grey[None] if axis == 0 else grey[::-1, None]
    wraps = (wrap, "repeat") if axis == 0 else ("repeat", wrap)
    surface = surface_of(Material(name="t", base_color=(1, 1, 1), specular=0.0,
                                  texture=Texture(base_color=base, wrap=wraps)))
    other = np.full(len(u), 0.3)
    uv = (u, other) if axis == 0 else (other, u)
    si = interaction(1.0, len(u))
    si.uv = mi.Point2f(*(np.float32(part) for part in uv))
    found = np.array(surface.eval_diffuse_reflectance(si, mi.Bool(True)))[0]
    assert np.allclose(found, np.array(expected) / 4, atol=1e-3)


def test_squares_of_one_value():
    base = np.stack([np.float32([0.25, 0.5, 0.75, 1.0])] * 3, -1)[None]
    surface = surface_of(Material(name="t", base_color=(1, 1, 1), specular=0.0,
                                  texture=Texture(base_color=base, nearest=True)))
    si = interaction(1.0, 5)
    si.uv = mi.Point2f(np.float32([0.01, 0.24, 0.26, 0.99, 1.01]), np.float32([0.5] * 5))
    found = np.array(surface.eval_diffuse_reflectance(si, mi.Bool(True)))[0]
    assert np.allclose(found, [0.25, 0.25, 0.5, 1.0, 0.25])


def test_a_cutoff_is_reached_by_what_rounds_to_it():
    alpha = np.float32([[0.0, 0.4999, 0.5, 1.0]])
    texture = Texture(base_color=np.ones((1, 4, 3), np.float32), alpha=alpha, nearest=True)
    surface = surface_of(Material(name="leaf", base_color=(1, 1, 1), texture=texture, alpha_cutoff=0.5))
    si = interaction(1.0, 4)
    si.uv = mi.Point2f(np.float32([0.1, 0.3, 0.6, 0.9]), np.float32([0.5] * 4))
    assert np.array_equal(np.array(surface.coverage(si, mi.Bool(True))), [0, 1, 1, 1])


# Vertices

CORNERS = np.float32([[0, 0, 0], [2, 0, 0], [0, 1, 0], [5, 5, 5], [5, 6, 5], [5, 5, 7]])
COLORS = np.float32([[[1, 0, 0, 1], [0, 1, 0, 0.5], [0, 0, 1, 0]], [[0.25, 0.5, 0.75, 1]] * 3])


def coloured(material=None, face_material=(0, 0)):
    material = material or Material(name="m", base_color=(0.8, 0.4, 1.0), specular=0.0)
    surface = mi.load_dict({"type": PLUGIN})
    vertices = VertexColours.of([material], np.array(face_material), COLORS, owned(mi.Float, CORNERS))
    surface.bind(MaterialTable(textures=Textures.upload([material]), face_material=mi.UInt32([0, 0]),
                               vertices=vertices))
    return surface, vertices


def test_colours_of_corners_are_interpolated():
    weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.2, 0.3, 0.5], [1 / 3] * 3], np.float32)
    points = np.concatenate([weights @ CORNERS[:3], weights @ CORNERS[3:]])
    si = interaction(1.0, 10)
    si.prim_index, si.p = mi.UInt32([0] * 5 + [1] * 5), mi.Point3f(*points.T)
    surface, vertices = coloured()
    expected = np.concatenate([weights @ COLORS[0], np.tile(COLORS[1, 0], (5, 1))])
    base = np.array(surface.eval_diffuse_reflectance(si, mi.Bool(True))).T
    assert np.allclose(base, expected[:, :3] * (0.8, 0.4, 1.0), atol=1e-6)
    assert np.allclose(np.array(surface.coverage(si, mi.Bool(True))), expected[:, 3], atol=1e-6)
    assert vertices.needs == {"colours", "coverage"}


@pytest.mark.parametrize("width", (0.0, 1e-9, 1e-5, 1e-3))
def test_a_sliver_has_colours_between_those_of_its_corners(width):
    """Of a scan; in single precision the narrow ones have no area at all."""
    corners = np.float32([[0, 0, 0], [0.3, 0.4, 0.5], [0.1501, 0.2 + width, 0.25]])
    white_ones = np.ones((1, 3, 4), np.float32)
    colors = white_ones * np.float32([[[0.2], [0.4], [0.6]]])
    vertices = VertexColours.of([RICH], np.array([0]), colors, owned(mi.Float, corners))
    si = interaction(1.0, 64)
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 64)
    si.prim_index, si.p = mi.UInt32([0] * 64), mi.Point3f(*(weights @ corners).T)
    found = np.array(vertices.at(si, mi.Bool(True)))
    assert np.isfinite(found).all() and found.min() >= 0.2 - 1e-6 and found.max() <= 0.6 + 1e-6


def test_colours_stay_with_their_triangles():
    plain, painted = sheet(RICH, 0, 1), sheet(RICH, 1, 1, colors=COLORS)
    both = merge([plain, painted, plain])
    assert np.array_equal(both.colors, np.concatenate([np.ones_like(COLORS), COLORS, np.ones_like(COLORS)]))
    assert np.array_equal(both.only(np.arange(6) == 3).colors, COLORS[1:]) and merge([plain, plain]).colors is None
    # Moved by the noise of a twin, and split
    mesh = TriangleMesh(positions=CORNERS, faces=np.arange(6).reshape(2, 3), uvs=np.zeros((2, 3, 2)),
                        material=np.zeros(2, int), colors=COLORS)
    moved = displace(mesh, sigma=0.1, radius=1.0, direction="isotropic", rng=np.random.default_rng(1))
    assert np.array_equal(moved.colors, COLORS)
    assert np.array_equal(soup_of(moved, np.zeros((2, 3, 3)), (RICH,), np.eye(4), 1).colors, COLORS)


def test_a_cutoff_counts_what_vertices_cover():
    opaque = replace(Material(name="m", base_color=(1, 1, 1)), alpha_cutoff=0.0)
    assert coloured(opaque)[1].needs == {"colours"}
    white_ones = np.ones((2, 3, 4), np.float32)
    assert VertexColours.of([opaque], np.array([0, 0]), white_ones, owned(mi.Float, CORNERS)) is None
    with pytest.raises(ValueError, match="coverage"):
        surface, _ = coloured()
        surface.bind(surface.table, frozenset({"colours", "specular"}))


@pytest.mark.parametrize("value", (np.nan, -0.1, 1.5))
def test_colours_that_no_surface_has_are_refused(value):
    bad = COLORS.copy()
    bad[1, 2, 0] = value
    with pytest.raises(PlanError, match=r"1 corners of 6 .* corner 2 of face 1"):
        VertexColours.of([RICH], np.array([0, 0]), bad, owned(mi.Float, CORNERS))


@pytest.mark.parametrize(("change", "expected"), [
    ({"alpha": 0.5}, {"coverage"}), ({"alpha": 0.5, "alpha_cutoff": 0.5}, set()),
    ({"alpha": 0.4, "alpha_cutoff": 0.5}, {"coverage"}), ({"emission": (0, 0.1, 0)}, {"emission"}),
    ({"emission": (0, 1, 0), "texture": white(emission=np.zeros((1, 1, 3), np.float32))}, {"textures", "maps"}),
    ({"transmission": 1.0, "texture": white(transmission=np.zeros((1, 1), np.float32))}, {"textures", "maps"}),
    ({"texture": white(wrap=("repeat", "clamp"))}, {"textures", "maps"}), ({"texture": white()}, {"textures"}),
    ({"texture": white(alpha=np.float32([[0.5]]))}, {"textures", "coverage"}),
])
def test_what_calls_for_a_switch(change, expected):
    assert needs([replace(Material(name="m", base_color=(1, 1, 1), specular=0.0), **change)]) == expected
