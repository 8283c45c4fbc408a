"""Splats along rays: against sums by hand and in NumPy, colours and depths included."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_harmonics import splat_basis
from dataset_builder.geometry.splat_moves import joined, moved, turn_matrices
from dataset_builder.rendering.field.splat_look import EXTENT, LEFT, splat_sight
from dataset_builder.rendering.field.splat_mesh import seen_along
from tests.assets.splat_files import SH0, ball, random_cloud

AHEAD = np.array([[0.0, 0.0, -1.0]])


def splat(colour: float = 0.5, opacity: float = 0.8, centre: tuple[float, float, float] = (0, 0, 0),
          scales: tuple[float, float, float] = (0.1, 0.1, 0.1), srgb: bool = False) -> SplatCloud:
    """One splat of a grey."""
    return SplatCloud(centres=np.float32([centre]), scales=np.float32([scales]), turns=np.float32([[1, 0, 0, 0]]),
                      opacities=np.float32([opacity]), harmonics=np.full((1, 1, 3), (colour - 0.5) / SH0, np.float32),
                      srgb=srgb)


def seen(cloud: SplatCloud, origins: np.ndarray, ways: np.ndarray,
         radius: float = 1.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return seen_along(splat_sight(cloud, np.array([0.1, 0, 0]), radius), origins, ways)


def composed(cloud: SplatCloud, origin: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, float]:
    """Front to back over all splats that a ray enters, in float64."""
    whitening = (turn_matrices(cloud.turns) / cloud.scales[:, None, :]).transpose(0, 2, 1)
    o, d = np.einsum("nij,nj->ni", whitening, origin - cloud.centres), whitening @ way
    a, b, c = (d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - EXTENT**2
    entry = np.where(b * b > a * c, (-b - np.sqrt(np.maximum(b * b - a * c, 0))) / a, -1)
    light, through = np.zeros(3), 1.0
    for number in np.flatnonzero(entry > 0)[np.argsort(entry[entry > 0])]:
        near = ((o[number] - b[number] / a[number] * d[number])**2).sum()
        opacity = min(cloud.opacities[number] * np.exp(-near / 2), 0.9999)
        towards = cloud.centres[number] - origin
        functions = splat_basis(towards / np.linalg.norm(towards), cloud.harmonics.shape[1])
        light += through * opacity * np.maximum(0.5 + functions @ cloud.harmonics[number], 0)
        through *= 1 - opacity
        if through < LEFT:
            break
    return light, 1 - through


def test_one_splat() -> None:
    """Its middle, one and two standard deviations aside, and past its end."""
    origins = np.array([[0, 0, 3.0], [0.1, 0, 3], [0, 0.2, 3], [0.31, 0, 3], [0, 0, -3]])
    light, opacity, depth = seen(splat(0.7), origins, np.repeat(AHEAD, 5, axis=0))
    expected = 0.8 * np.exp([0, -0.5, -2, -np.inf, -np.inf])
    assert np.allclose(opacity, expected, atol=1e-6)
    assert np.allclose(light, 0.7 * expected[:, None], atol=1e-6)
    assert np.allclose(depth, [3, 0, 0, 0, 0], atol=1e-5)


def test_splats_cover_each_other() -> None:
    """0.8 of 0.9 before 0.5 of 0.2, from either side; depth is where half is blocked."""
    cloud = joined([splat(0.9, 0.8, (0, 0, 0.5)), splat(0.2, 0.5, (0, 0, -0.5))])
    light, opacity, depth = seen(cloud, np.array([[0, 0, 3.0], [0, 0, -3]]), np.concatenate([AHEAD, -AHEAD]))
    assert np.allclose(light[:, 0], [0.8 * 0.9 + 0.2 * 0.5 * 0.2, 0.5 * 0.2 + 0.5 * 0.8 * 0.9], atol=1e-6)
    assert np.allclose(opacity, 0.9, atol=1e-6) and np.allclose(depth, [2.5, 2.5], atol=1e-5)


def test_splats_in_one_place_both_count() -> None:
    cloud = joined([splat(0.5, 0.5), splat(0.5, 0.5, scales=(0.1, 0.1, 0.0999))])
    assert np.allclose(seen(cloud, np.array([[0, 0, 3.0]]), AHEAD)[1], 0.75, atol=1e-6)


def test_encoded_colours_are_blended_encoded() -> None:
    """0.75 encoded, a third opaque: what is covered has the radiance of all of it."""
    light, opacity, _ = seen(splat(0.75, 1 / 3, srgb=True), np.array([[0, 0, 3.0]]), AHEAD)
    assert np.allclose(light, linear_from_srgb(np.array(0.75)) / 3, atol=1e-5)
    assert np.allclose(opacity, 1 / 3, atol=1e-6)
    two = joined([splat(0.9, 0.8, (0, 0, 0.5), srgb=True), splat(0.3, 1, (0, 0, -0.5), srgb=True)])
    assert np.allclose(seen(two, np.array([[0, 0, 3.0]]), AHEAD)[0],
                       linear_from_srgb(np.array(0.8 * 0.9 + 0.2 * 0.3)), atol=1e-3)


@pytest.mark.parametrize("cloud", [ball(3000, srgb=False), replace(random_cloud(300), srgb=False),
                                   replace(random_cloud(300, degree=0, seed=1), srgb=False)])
def test_many_splats_as_in_numpy(cloud: SplatCloud) -> None:
    """Colours to 0.01 on average: where many enter at almost one place, float32 swaps some."""
    draws = np.random.default_rng(0)
    origins = draws.normal(size=(80, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    ways = draws.uniform(-0.8, 0.8, (80, 3)) - origins
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    light, opacity, _ = seen(cloud, origins, ways, radius=3.0)
    expected = [composed(cloud, origin, way) for origin, way in zip(origins, ways, strict=True)]
    assert np.abs(opacity - [each for _, each in expected]).max() < 2 * LEFT
    assert np.abs(light - [each for each, _ in expected]).mean() < 0.01
    assert np.median(np.abs(light - [each for each, _ in expected])) < 5e-3


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_turned_cloud_looks_alike_from_a_turned_place(degree: int) -> None:
    cloud = random_cloud(100, degree=degree)
    matrix = np.eye(4)
    matrix[:3, :3] = 0.5 * Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
    matrix[:3, 3] = 0.1, 0.05, -0.1
    draws = np.random.default_rng(0)
    origins, ways = 3 * np.repeat(-AHEAD, 50, axis=0), draws.uniform(-0.3, 0.3, (50, 3)) + AHEAD
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    one = seen_along(splat_sight(cloud, np.zeros(3), 3.0), origins, ways)
    two = seen_along(splat_sight(moved(cloud, matrix), matrix[:3, 3], 1.5),
                     origins @ matrix[:3, :3].T + matrix[:3, 3], ways @ (2 * matrix[:3, :3]).T)
    assert np.abs(one[1] - two[1]).max() < 1e-3
    assert np.median(np.abs(one[0] - two[0])) < 1e-4 and np.abs(one[0] - two[0]).mean() < 5e-3


def test_two_clouds_share_their_kernels() -> None:
    def hashes(cloud: SplatCloud, radius: float) -> set[str]:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            seen(cloud, np.array([[0, 0, 3.0]] * 40), np.repeat(AHEAD, 40, axis=0), radius)
            return {str(kernel["hash"]) for kernel in dr.kernel_history([dr.KernelType.JIT])}

    assert mi.variant()
    first = hashes(ball(100, srgb=False), 1.5)
    assert first and hashes(ball(333, srgb=True, seed=3), 2.5) == first
