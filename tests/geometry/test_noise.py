"""Vertex noise has the standard deviation that it was asked for, and nothing else moves it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dataset_builder.errors import UserError
from dataset_builder.geometry.noise import bounding_radius, displace, vertex_normals
from dataset_builder.seeding import rng

ERROR_RATE = 1e-6
"""Chance that a right generator fails one chi-square interval; the seeds are fixed, so it is drawn once."""


def moved(mesh, sigma=0.01, radius=2.0, direction="isotropic", seed=0):
    noisy = displace(mesh, sigma=sigma, radius=radius, direction=direction, rng=rng(seed, "noise"))
    return noisy.positions - mesh.positions


def within_interval(values, deviation):
    """Whether the sum of squares of `values` lies in the central chi-square interval of error rate ERROR_RATE."""
    statistic = float(np.sum((values / deviation) ** 2))
    low, high = chi2.ppf([ERROR_RATE / 2, 1 - ERROR_RATE / 2], df=values.size)
    return low < statistic < high


@pytest.mark.parametrize("sigma", [0.001, 0.02])
@pytest.mark.parametrize("radius", [0.3, 2.0])
def test_standard_deviation_per_axis(shapes, sigma, radius):
    offsets = moved(shapes["torus"](100, 60), sigma, radius)
    assert all(within_interval(offsets[:, axis], sigma * radius) for axis in range(3))
    assert not within_interval(offsets[:, 0] * 1.1, sigma * radius)
    correlation = np.corrcoef(offsets.T) - np.eye(3)
    assert np.abs(correlation).max() < 5 / np.sqrt(len(offsets))


def test_standard_deviation_along_the_normal(shapes):
    mesh = shapes["torus"](100, 60)
    offsets = moved(mesh, 0.01, 0.5, "normal")
    along = np.einsum("ij,ij->i", offsets, vertex_normals(mesh))
    assert within_interval(along, 0.005)
    np.testing.assert_allclose(offsets, along[:, None] * vertex_normals(mesh), atol=1e-15)


def test_sigma_zero_is_the_same_bit_for_bit(shapes):
    mesh = shapes["vase"]()
    for direction in ("isotropic", "normal"):
        same = displace(mesh, sigma=0.0, radius=0.3, direction=direction, rng=rng(3))
        assert same.positions.tobytes() == mesh.positions.tobytes()


def test_noise_depends_on_the_generator_alone(shapes):
    mesh = shapes["vase"]()
    np.random.seed(0)
    first = moved(mesh, seed=5)
    np.random.seed(1)
    np.testing.assert_array_equal(first, moved(mesh, seed=5))
    assert not np.array_equal(first, moved(mesh, seed=6))


def test_levels_are_multiples_of_one_pattern(shapes):
    mesh = shapes["vase"]()
    np.testing.assert_allclose(moved(mesh, sigma=0.04), 4 * moved(mesh, sigma=0.01), atol=1e-14)


def test_noise_of_a_vertex_does_not_depend_on_faces_or_places(shapes):
    mesh = shapes["vase"]()
    other = shapes["mesh"](mesh.positions * 3 + 1, mesh.faces[::-2])
    np.testing.assert_allclose(moved(mesh), moved(other), atol=1e-14)


def test_bounding_radius_of_a_box(shapes):
    mesh = shapes["box"]((0.2, 0.3, 0.6))
    assert bounding_radius(mesh) == pytest.approx(0.35)
    assert bounding_radius(replace(mesh, positions=mesh.positions + np.array((5, -7, 9)))) == pytest.approx(0.35)


def test_vertices_that_no_face_uses_do_not_count(shapes):
    mesh = shapes["mesh"]([(0, 0, 0), (2, 0, 0), (0, 0, 0.1), (99, 99, 99)], [(0, 1, 2)])
    assert bounding_radius(mesh) == pytest.approx(np.hypot(1, 0.05))


@pytest.mark.parametrize(("sigma", "radius", "message"), [
    (-0.1, 1.0, "sigma: expected a finite number >= 0, got -0.1"), (float("nan"), 1.0, "sigma.*got nan"),
    (0.1, -1.0, "radius: expected a finite number >= 0, got -1"),
])
def test_wrong_numbers_are_named(shapes, sigma, radius, message):
    with pytest.raises(UserError, match=message):
        displace(shapes["box"](), sigma=sigma, radius=radius, direction="isotropic", rng=rng(0))
