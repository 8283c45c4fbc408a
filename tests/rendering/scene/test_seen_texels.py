"""How fine textures are for what a camera can see of them."""

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.scene import seen_texels
from dataset_builder.rendering.scene.seen_texels import MIN_SIDE, distances, repeat_lengths, seen_sides
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.rendering.surface.texels import pack
from dataset_builder.seeding import rng

SQUARE = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], dtype=float)


def sheets(places: list[float], repeats: float = 1.0, size: float = 1.0) -> Soup:
    """Squares of `size` metres across the view, each of a material of its own, at distances along +X from the origin,
    with a texture repeated so often along each side."""
    yz = SQUARE * size - size / 2
    corners = np.concatenate([np.concatenate([np.full((2, 3, 1), x), yz], axis=2) for x in places])
    count = len(places)
    materials = tuple(Material(name=f"{index}", base_color=(1, 1, 1)) for index in range(count))
    return Soup(corners=corners, normals=np.zeros_like(corners), uvs=np.tile(SQUARE * repeats, (count, 1, 1)),
                material=np.repeat(np.arange(count), 2), instance=np.ones(2 * count, int),
                part=np.zeros(2 * count, int), materials=materials)


def camera(width: int = 100) -> Pinhole:
    """At the origin, looking along +X, 90 degrees wide: a metre at a metre is half the frame."""
    return Pinhole(position=np.zeros(3), target=np.array([1.0, 0, 0]), fov=90, width=width, height=width)


@pytest.mark.parametrize(("repeats", "size", "side"), [(1, 1, 128), (4, 1, 32), (1, 2, 256), (100, 1, MIN_SIDE)])
def test_a_texture_is_as_fine_as_pixels_at_its_distance(repeats: float, size: float, side: int) -> None:
    """At 1 m a pixel is 1/50 m: 50 pixels a metre, two texels each, brought up to a power of two."""
    assert seen_sides(sheets([1.0], repeats, size), camera(), 2, 4096) == (side,)


def test_what_is_further_away_is_coarser_and_none_is_above_the_limit() -> None:
    sides = seen_sides(sheets([0.1, 1, 2, 4, 100]), camera(), 2, 512)
    assert sides == (512, 128, 64, 32, MIN_SIDE)
    assert seen_sides(sheets([1.0]), camera(width=400), 2, 4096) == (512,)


def test_what_lies_behind_the_camera_counts_by_its_distance() -> None:
    """It may show in a mirror."""
    assert seen_sides(sheets([-1.0]), camera(), 2, 4096) == seen_sides(sheets([1.0]), camera(), 2, 4096)


def test_materials_and_strips_of_triangles_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """In any order of the triangles, however many are looked at together."""
    soup, order = sheets([0.1, 1, 2, 4, 100]), rng(3, "order").permutation(10)
    expected = seen_sides(soup, camera(), 2, 512)
    monkeypatch.setattr(seen_texels, "STRIP", 3)
    assert seen_sides(soup.only(order), camera(), 2, 512) == expected


def test_slivers_of_the_unwrapping_do_not_decide() -> None:
    soup = sheets([1.0])
    sliver = np.array([[(1, 0, 0), (1, 1e-3, 0), (1, 0, 1e-3)]])
    with_sliver = Soup(corners=np.concatenate([soup.corners, sliver]), normals=np.zeros((3, 3, 3)),
                       uvs=np.concatenate([soup.uvs, np.zeros((1, 3, 2))]), material=np.zeros(3, int),
                       instance=np.ones(3, int), part=np.zeros(3, int), materials=soup.materials)
    assert seen_sides(with_sliver, camera(), 2, 4096) == seen_sides(soup, camera(), 2, 4096) == (128,)


def test_repeats_are_as_long_as_their_longest_way() -> None:
    """A sheet of 3 x 2 metres that shows one texture; turned texture coordinates change nothing."""
    corners = np.concatenate([SQUARE * (3, 2), np.zeros((2, 3, 1))], axis=2)
    c, s = np.cos(0.7), np.sin(0.7)
    assert repeat_lengths(corners, SQUARE) == pytest.approx([3, 3])
    assert repeat_lengths(corners, SQUARE @ np.array([[c, s], [-s, c]])) == pytest.approx([3, 3])
    assert np.isinf(repeat_lengths(corners, np.zeros((2, 3, 2)))).all()


def test_distances_are_those_of_the_nearest_of_many_points() -> None:
    draws = rng(3)
    corners, point = draws.normal(size=(40, 3, 3)), np.array([0.3, -0.2, 0.5])
    weights = draws.dirichlet((0.3, 0.3, 0.3), size=60_000)
    sampled = np.linalg.norm(np.einsum("wc,fck->fwk", weights, corners) - point, axis=2).min(axis=1)
    found = distances(point, corners)
    assert (found <= sampled + 1e-12).all() and (found > sampled - 0.05).all()
    assert distances(np.array([0.25, 0.25, 2.0]), np.array([[(0, 0, 0), (1, 0, 0), (0, 1, 0)]], float)) == [2]


def test_a_texture_of_two_materials_is_as_fine_as_the_nearer_needs() -> None:
    texture = Texture(base_color=np.ones((64, 64, 3), np.float32))
    near, far = (Material(name=name, base_color=(1, 1, 1), texture=texture) for name in ("near", "far"))
    assert pack([far, near], [16, 32]).extents[:, 1].tolist() == [32, 32]
    assert pack([far], [16]).extents[:, 1].tolist() == [16]
