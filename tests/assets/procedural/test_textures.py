"""Procedural textures and the primitives below the furniture: laws that hold for every one."""

from collections.abc import Callable

import numpy as np
import pytest

from dataset_builder.assets.asset import Texture
from dataset_builder.assets.procedural import textures
from dataset_builder.assets.procedural.boxes import bevelled_box, plate
from dataset_builder.assets.procedural.round_solids import bar, disc, hoop
from dataset_builder.assets.procedural.soft import cushion, pillow
from dataset_builder.assets.procedural.textures import normals_of, smooth_noise
from dataset_builder.seeding import rng

LIGHT, DARK = np.array([0.5, 0.35, 0.2]), np.array([0.2, 0.1, 0.05])

MAKERS: dict[str, Callable[[np.random.Generator, int], Texture]] = {
    "wood": lambda stream, size: textures.wood(stream, LIGHT, DARK, size=size),
    "weave": lambda stream, size: textures.weave(stream, LIGHT, DARK, size=size),
    "nap": lambda stream, size: textures.nap(stream, LIGHT, size=size),
    "leather": lambda stream, size: textures.leather(stream, LIGHT, size=size),
    "plaster": lambda stream, size: textures.plaster(stream, LIGHT, size=size),
    "brushed": lambda stream, size: textures.brushed(stream, LIGHT, size=size),
    "stone": lambda stream, size: textures.stone(stream, LIGHT, DARK, size=size),
    "tiles": lambda stream, size: textures.tiles(stream, LIGHT, size=size),
    "planks": lambda stream, size: textures.planks(stream, LIGHT, DARK, size=size),
}


@pytest.mark.parametrize("name", MAKERS)
def test_no_seam_shows_where_a_texture_repeats(name: str) -> None:
    image = MAKERS[name](rng(0, name), 128).base_color.mean(axis=-1)
    for axis in (0, 1):
        steps = np.abs(np.roll(image, -1, axis=axis) - image).mean(axis=1 - axis)
        assert steps[-1] <= 1.05 * steps[:-1].max() + 1e-4


@pytest.mark.parametrize("name", MAKERS)
def test_values_are_in_range_and_follow_the_seed(name: str) -> None:
    one, two, other = (MAKERS[name](rng(seed, name), 64) for seed in (0, 0, 1))
    assert one.base_color.shape == (64, 64, 3)
    assert one.base_color.dtype == np.float32
    assert one.base_color.min() >= 0.03 - 1e-6 and one.base_color.max() <= 0.85 + 1e-6
    assert one.base_color.std() > 1e-3
    np.testing.assert_array_equal(one.base_color, two.base_color)
    assert not np.array_equal(one.base_color, other.base_color)
    for plane in (one.roughness, one.metallic):
        assert plane is None or (plane.shape == (64, 64) and plane.min() >= 0 and plane.max() <= 1)
    if one.normal is not None:
        np.testing.assert_allclose(np.linalg.norm(one.normal, axis=-1), 1, atol=1e-5)
        assert (one.normal[..., 2] > 0.2).all()


def test_wood_grain_runs_along_v() -> None:
    image = MAKERS["wood"](rng(0, "wood"), 128).base_color.mean(axis=-1)
    along, across = (np.abs(np.diff(image, axis=axis)).mean() for axis in (0, 1))
    assert across > 2 * along


def test_normals_lean_away_from_the_slope() -> None:
    """A height that rises with u tilts the normal to -u, and likewise v, which falls from row to row."""
    ramp = np.tile(np.sin(2 * np.pi * np.arange(64) / 64), (64, 1))
    rising_u, rising_v = normals_of(ramp, relief=0.1), normals_of(ramp.T[::-1], relief=0.1)
    assert rising_u[0, 0, 0] < -0.1 and abs(rising_u[0, 0, 1]) < 1e-6
    assert rising_v[-1, 0, 1] < -0.1 and abs(rising_v[-1, 0, 0]) < 1e-6


def test_noise_has_mean_0_and_deviation_1() -> None:
    field = smooth_noise(rng(0, "noise"), 64, u_scale=0.05, v_scale=0.1)
    assert field.mean() == pytest.approx(0, abs=1e-9)
    assert field.std() == pytest.approx(1)


def test_chamfers_take_their_prisms_off_a_box() -> None:
    """Each of 12 edges loses a prism of c^2/2 by l - 2c, each of 8 corners 5/6 of a cube of c."""
    c, size = 0.1, (1.0, 2.0, 3.0)
    prisms = sum(4 * (side - 2 * c) * c**2 / 2 for side in size)
    assert bevelled_box(size, bevel=c).volume == pytest.approx(6 - prisms - 8 * c**3 * 5 / 6)
    assert bevelled_box(size, bevel=0).volume == pytest.approx(6)


def test_round_solids_have_the_volume_of_their_polygons() -> None:
    polygon = 48 / 2 * np.sin(2 * np.pi / 48)
    assert disc(0.5, 1.0, bevel=1e-9).volume == pytest.approx(polygon * 0.25, rel=1e-6)
    assert hoop(np.array([(2.0, 0), (2.0, 1), (1.0, 1), (1.0, 0)])).volume == pytest.approx(polygon * 3)
    slanted, upright = (bar(np.zeros(3), end, 0.1) for end in (np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.0, 1.0])))
    assert slanted.volume == pytest.approx(upright.volume)


def test_a_plate_loses_its_opening() -> None:
    cells = np.ones((3, 3), dtype=bool)
    cells[1, 1] = False
    cuts = np.array([0.0, 1.0, 3.0, 4.0])
    assert plate(cells, cuts, cuts, thickness=0.5).volume == pytest.approx((16 - 4) * 0.5)


@pytest.mark.parametrize("mesh", [bevelled_box((0.4, 0.7, 1.1), bevel=0.01), cushion((0.5, 0.6, 0.15), radius=0.04),
                                  pillow((0.5, 0.4, 0.15)), disc(0.3, 0.02, bevel=0.002)])
def test_coordinates_are_in_metres(mesh) -> None:  # type: ignore[no-untyped-def]
    """Texture area equals surface area, less what oblique faces lose in projection: at most down to cos 55 degrees."""
    u, v = np.moveaxis(mesh.uvs[:, 1:] - mesh.uvs[:, :1], -1, 0)
    ratio = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / np.linalg.norm(mesh.area_normals, axis=1)
    assert ratio.min() > 0.5
    assert ratio.max() < 1.01
