"""Texels are averaged without moving light about, and what no surface can have is refused by name."""

from dataclasses import fields, replace

import numpy as np
import pytest

from dataset_builder.assets.asset import MORE_MAPS, Material, Texture
from dataset_builder.errors import PlanError
from dataset_builder.rendering.surface.texel_means import averaged
from dataset_builder.rendering.surface.texels import CHANNELS, FACTORS, pack, pack_texture

CHECKED = tuple(field.name for field in fields(Material) if field.name not in ("name", "texture"))


def textured(**maps) -> Material:
    return Material(name="oak", base_color=(1, 1, 1), texture=Texture(**maps))


def grey(*shape: int) -> np.ndarray:
    return np.full((*shape, 3), 0.5, np.float32)


def test_integer_ratios_average_blocks():
    values = np.random.default_rng(1).random((12, 8, 3)).astype(np.float32)
    blocks = values.reshape(4, 3, 4, 2, 3).mean(axis=(1, 3))
    assert np.allclose(averaged(values, (4, 4)), blocks, atol=1e-6)


def test_a_value_that_two_boxes_share_counts_in_both():
    assert np.allclose(averaged(np.array([[3.0], [6.0], [9.0]]), (2, 1)), [[4.0], [8.0]])


@pytest.mark.parametrize("size", ((1, 1), (5, 3), (7, 16), (16, 16)))
def test_averaging_keeps_the_mean(size):
    values = np.random.default_rng(2).random((16, 16)).astype(np.float32)
    small = averaged(values, size)
    assert small.shape == size and np.isclose(small.mean(), values.mean(), rtol=1e-5)


def test_every_map_shrinks_and_normals_keep_their_mean_direction():
    # Two tilts that mirror each other average to upright; one tilt stays what it is.
    normal = np.zeros((4, 8, 3), np.float32)
    normal[..., 2] = 0.8
    normal[:2, ::2, 0], normal[:2, 1::2, 0], normal[2:, :, 1] = 0.6, -0.6, 0.6
    roughness = np.tile(np.float32([0.2, 0.6]), (4, 4))
    block = pack_texture(Texture(base_color=grey(4, 8), roughness=roughness, metallic=1 - roughness, normal=normal), 4)
    assert block.shape == (1, 2, 4, CHANNELS) and block.dtype == np.float16
    block = block[0]
    assert np.allclose(block[..., :3], 0.5) and np.allclose(block[..., 3], 0.4, atol=1e-3)
    assert np.allclose(block[..., 4], 0.6, atol=1e-3)
    assert np.allclose(block[0, :, 5:7], 0, atol=1e-3) and np.allclose(block[1, :, 5:7], (0, 0.6), atol=1e-3)


def test_further_maps_have_planes_of_their_own():
    texture = Texture(base_color=grey(2, 3), alpha=np.full((2, 3), 0.25, np.float32), sheen=grey(2, 3),
                      coat=np.full((2, 3), 0.75, np.float32), wrap=("mirror", "clamp"), nearest=True)
    block = pack_texture(texture)
    assert block.shape == (3, 2, 3, CHANNELS)
    assert np.allclose(block[:, 0, 0], [[0.5, 0.5, 0.5, 1, 1, 0, 0, 0.25], [1, 1, 1, 1, 1, 0.75, 1, 1],
                                        [0.5, 0.5, 0.5, 1, 1, 1, 1, 1]])
    arrays = pack([textured(base_color=grey(1, 1)), Material(name="m", base_color=(1, 1, 1), texture=texture)])
    assert np.array_equal(arrays.extents, [[0, 1, 1, 0], [1, 3, 2, 1 + (2 << 2) + 16 + 32]])
    assert len(arrays.texels) == 1 + 3 * 6


def test_small_textures_are_left_alone_and_shared_once():
    texture = Texture(base_color=np.random.default_rng(3).random((3, 5, 3)).astype(np.float32))
    materials = [Material(name=name, base_color=(1, 1, 1), texture=texture) for name in "ab"]
    arrays = pack(materials, texture_size=5)
    assert arrays.texels.shape == (15, CHANNELS) and arrays.factors.shape == (2, FACTORS)
    assert np.array_equal(arrays.extents, [[0, 5, 3, 0]] * 2)
    assert np.allclose(arrays.texels[:, :3].reshape(3, 5, 3), texture.base_color, atol=5e-4)


def test_rows_hold_every_factor():
    material = Material(name="m", base_color=(0.1, 0.2, 0.3), roughness=0.4, metallic=0.5, specular=0.06, coat=0.7,
                        coat_roughness=0.8, sheen=(0.9, 0.11, 0.12), sheen_roughness=0.13, transmission=0.14, ior=1.6,
                        thin=True, abbe=42.0)
    row = pack([material]).factors[0]
    assert np.allclose(row[:16], [0.1, 0.2, 0.3, 0.4, 0.5, 0.06, 0.7, 0.8, 0.9, 0.11, 0.12, 0.13, 0.14, 1.6, 1, 42])
    glowing = replace(material, emission=(0.1, 0.2, 3.0), alpha=0.4, alpha_cutoff=0.5)
    assert np.allclose(pack([material]).factors[0, 16:], [0, 0, 0, 1, -1, 0, 0, 0])
    # Half a step of half precision below the cutoff is still the cutoff
    assert np.allclose(pack([glowing], sky=2.0).factors[0, 16:], [0.2, 0.4, 6, 0.4, 0.5 * (1 - 2**-11), 0, 0, 0])


def test_a_priority_numbers_the_bodies_of_glass_and_is_checked():
    glass = Material(name="wax", base_color=(1, 1, 1), transmission=1.0)
    rows = pack([replace(glass, priority=3), glass, replace(glass, priority=2, ior=1.3)]).factors
    assert rows[:, 21].tolist() == [2, 0, 1]
    for broken in ({"priority": np.nan}, {"priority": np.inf}, {"priority": -1}, {"priority": 1.5},
                   {"priority": 1, "alpha": 0.5}):
        with pytest.raises(PlanError, match="'wax': priority: expected a whole number >= 0"):
            pack([replace(glass, **broken)])


@pytest.mark.parametrize("factor", [name for name in CHECKED if name != "priority"])
def test_every_factor_moves_its_row_and_is_checked(factor):
    plain = Material(name="wax", base_color=(0.5, 0.5, 0.5))
    value = getattr(plain, factor)
    colour, truth, value = isinstance(value, tuple), isinstance(value, bool), 0.0 if value is None else value
    moved = replace(plain, **{factor: (0.25, 0.25, 0.25) if colour else not value if truth else value / 2 + 0.375})
    assert not np.array_equal(pack([moved]).factors, pack([plain]).factors)
    if not truth:
        with pytest.raises(PlanError, match=f"'wax'.*{factor}"):
            pack([replace(plain, **{factor: (np.nan, 0, 0) if colour else np.nan})])


@pytest.mark.parametrize("value", (np.nan, np.inf, -np.inf, 1e8, -1.0, 1.01, -0.01))
@pytest.mark.parametrize("name", ("base_color", "roughness", "metallic", "alpha", *MORE_MAPS))
def test_texels_that_no_surface_has_are_counted_and_refused(value, name):
    colour = name in ("base_color", "emission", "sheen")
    maps = {"base_color": grey(4, 4), name: grey(4, 4) if colour else np.ones((4, 4), np.float32)}
    maps[name][1, 2] = maps[name][3, 3] = value
    with pytest.raises(PlanError, match=rf"'oak'.*texture.{name}.*2 of 16 texels.*row 1, column 2"):
        pack([textured(**maps)])


@pytest.mark.parametrize("vector", ((np.nan, 0, 1), (0.9, 0.9, 0.1), (0, 0, 1e8)))
def test_normals_that_are_none_are_refused(vector):
    normal = np.tile(np.float32([0, 0, 1]), (2, 2, 1))
    normal[0, 1] = vector
    with pytest.raises(PlanError, match=r"texture\.normal.*1 of 4 texels"):
        pack([textured(base_color=grey(2, 2), normal=normal)])


def test_what_half_precision_rounds_off_is_clipped():
    base = np.float32([[[1.0004, -0.0004, 1.0]]])
    assert np.array_equal(pack([textured(base_color=base)]).texels[0, :3], [1, 0, 1])


@pytest.mark.parametrize("field, value", (("roughness", np.nan), ("base_color", (1.2, 0, 0)), ("sheen", (0, -0.1, 0)),
                                          ("ior", 0.9), ("ior", np.inf), ("abbe", -1.0), ("coat", 1.5)))
def test_factors_out_of_range_are_refused_by_name(field, value):
    with pytest.raises(PlanError, match=f"'wax'.*{field}"):
        pack([Material(**({"name": "wax", "base_color": (1, 1, 1)} | {field: value}))])


def test_all_problems_are_told_at_once():
    bad = [Material(name=name, base_color=(2, 0, 0), roughness=3.0) for name in "ab"]
    with pytest.raises(PlanError) as caught:
        pack(bad)
    assert len(caught.value.problems) == 4


def half(*shape: int) -> np.ndarray:
    return np.random.default_rng(5).random(shape).astype(np.float16)


@pytest.mark.parametrize("size", ((4, 4), (6, 3), (12, 1), (2, 8), (5, 7)))
@pytest.mark.parametrize("shape", ((12, 8), (12, 8, 3)))
def test_half_precision_is_averaged_to_the_same_values(shape, size):
    values = half(*shape)
    expected = averaged(values.astype(np.float32), size)
    assert averaged(values, size).dtype == np.float32 and np.allclose(averaged(values, size), expected, atol=3e-7)


def test_many_texels_of_half_precision_lose_nothing_to_it():
    """A sum in half precision would stop at 2048."""
    assert averaged(np.ones((128, 64), np.float16), (1, 1)) == 1
    assert averaged(np.full((256, 256, 3), 2.0**-12, np.float16), (1, 1)).ravel() == pytest.approx([2.0**-12] * 3)


def test_what_became_of_a_large_texture_is_kept():
    texture = Texture(base_color=half(64, 64, 3))
    small = pack_texture(texture, 16)
    assert pack_texture(texture, 16) is small and pack_texture(texture, 32).shape == (1, 32, 32, CHANNELS)
    assert np.array_equal(small, pack_texture(Texture(base_color=texture.base_color), 16))
    large = Texture(base_color=half(512, 4, 3))
    assert pack_texture(large, 256) is pack_texture(large, 256)
    assert pack_texture(Texture(base_color=half(1024, 1024, 3)), 256).shape == (1, 256, 256, CHANNELS)


def test_unit_vectors_in_half_precision_are_normals():
    vectors = np.random.default_rng(6).normal(size=(64, 64, 3))
    normal = (vectors / np.linalg.norm(vectors, axis=2, keepdims=True)).astype(np.float16)
    assert pack([textured(base_color=grey(64, 64), normal=normal)]).texels.shape == (4096, CHANNELS)
