"""Spherical harmonics against quadrature, hand-made values, and the irradiance of environments that have one."""

import numpy as np
import pytest
import torch

from dataset_builder.geometry.harmonics import COSINE, COUNT, basis, irradiance, rotation

CASES = np.random.default_rng(3).normal(size=(5, 3, 3))
"""Five random matrices, made orthogonal where they are used."""


def directions(turns=96, heights=48):
    """(N, 3) directions and (N,) weights that integrate polynomials over the sphere to rounding."""
    z, weight = np.polynomial.legendre.leggauss(heights)
    angle = 2 * np.pi * np.arange(turns) / turns
    z, angle = (grid.ravel() for grid in np.meshgrid(z, angle, indexing="ij"))
    flat = np.sqrt(1 - z**2)
    points = np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=-1)
    return points, np.repeat(weight, turns) * 2 * np.pi / turns


def functions(points):
    return np.stack(basis(*points.T), axis=-1)


def orthogonal(matrix):
    return np.linalg.qr(matrix)[0]


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


def test_the_basis_is_orthonormal():
    points, weights = directions()
    gram = (functions(points) * weights[:, None]).T @ functions(points)
    assert np.allclose(gram, np.eye(COUNT), atol=1e-13)


@pytest.mark.parametrize(("direction", "values"), [
    ((1, 0, 0), [0.282095, 0, 0, 0.488603, 0, 0, -0.315392, 0, 0.546274]),
    ((0, 1, 0), [0.282095, 0.488603, 0, 0, 0, 0, -0.315392, 0, -0.546274]),
    ((0, 0, -1), [0.282095, 0, -0.488603, 0, 0, 0, 0.630783, 0, 0]),
    ((0.6, 0.8, 0), [0.282095, 0.390882, 0, 0.293162, 0.524423, 0, -0.315392, 0, -0.152957]),
    ((0, 0.6, 0.8), [0.282095, 0.293162, 0.390882, 0, 0, 0.524423, 0.290161, 0, -0.196659]),
    ((0.8, 0, 0.6), [0.282095, 0, 0.293162, 0.390882, 0, 0, 0.025231, 0.524423, 0.349615]),
])
def test_values_by_hand(direction, values):
    """From the constants that Ramamoorthi and Hanrahan print: 0.282095, 0.488603, 1.092548, 0.315392, 0.546274."""
    assert np.allclose(basis(*direction), values, atol=2e-6)


def test_any_library_computes_the_same():
    points, _ = directions(6, 4)
    theirs = torch.stack(basis(*torch.from_numpy(points).T), dim=-1)
    assert theirs.shape == (24, COUNT) and np.array_equal(theirs.numpy(), functions(points))


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("matrix", CASES)
def test_rotation_turns_functions(matrix, mirror):
    turn, points = orthogonal(matrix) * [mirror, 1, 1], directions(8, 5)[0]
    coefficients = np.arange(1.0, 1 + COUNT)
    before = functions(points @ turn) @ coefficients
    assert np.allclose(functions(points) @ (rotation(turn) @ coefficients), before, atol=1e-12)


def test_rotations_follow_each_other():
    one, other = orthogonal(CASES[0]), orthogonal(CASES[1])
    assert np.allclose(rotation(one @ other), rotation(one) @ rotation(other), atol=1e-12)
    assert np.allclose(rotation(one).T @ rotation(one), np.eye(COUNT), atol=1e-12)
    assert np.allclose(rotation(np.eye(3)), np.eye(COUNT), atol=1e-12)


def test_a_quarter_turn_by_hand():
    """About z, x goes to y: f = Y_11, a lobe along x, becomes Y_1-1."""
    turned = rotation(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]))
    assert np.allclose(turned[:, 3], np.eye(COUNT)[1], atol=1e-12)
    assert np.allclose(turned[:, 8], -np.eye(COUNT)[8], atol=1e-12)


def test_cosine_factors_are_those_of_the_cut_off_cosine():
    points, weights = directions(4, 2000)
    lobe = np.maximum(points[:, 2], 0) * weights
    legendre = (np.ones(len(points)), points[:, 2], (3 * points[:, 2] ** 2 - 1) / 2)
    assert np.allclose([lobe @ each for each in legendre], COSINE[[0, 1, 4]], atol=1e-5)
    assert np.allclose(COSINE, np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5]))


def test_irradiance_of_an_even_sky_is_pi_times_its_radiance():
    lighting = np.zeros((COUNT, 3))
    lighting[0] = np.sqrt(4 * np.pi) * np.array([1, 2, 0.5])
    found = irradiance(lighting, directions(5, 4)[0])
    assert np.allclose(found, np.pi * np.array([1, 2, 0.5]))


def test_irradiance_of_one_direction_follows_the_cosine():
    """Best fit of degree 2 to max(cos, 0): 1/4 + cos/2 + 5/32 (3 cos^2 - 1), off by at most 0.1 (at grazing: 3/32)."""
    sun, normals = unit(0.3, -0.5, 0.8), directions(64, 32)[0]
    found = irradiance(np.array(basis(*sun))[:, None], normals)[:, 0]
    cosine = normals @ sun
    assert np.allclose(found, 1 / 4 + cosine / 2 + 5 / 32 * (3 * cosine**2 - 1), atol=1e-12)
    assert np.abs(found - np.maximum(cosine, 0)).max() < 0.1


def test_irradiance_of_a_smooth_sky_is_the_integral():
    """Radiance of degree 2 has no more to it than its coefficients: the cosine integral is met exactly."""
    points, weights = directions(96, 400)
    lighting = np.random.default_rng(8).normal(size=(COUNT, 3))
    for normal in np.eye(3):
        arriving = functions(points) @ lighting * np.maximum(points @ normal, 0)[:, None]
        assert np.allclose(weights @ arriving, irradiance(lighting, normal), atol=2e-3)
