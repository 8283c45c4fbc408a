"""Splats that move: their ellipsoids and what they look like go with them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_harmonics import COUNTS, harmonics_turn, splat_basis
from dataset_builder.geometry.splat_moves import chosen, joined, moved, turn_matrices, turn_quaternions
from tests.assets.splat_files import directions, random_cloud

TURN = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()
MIRROR = np.diag([1.0, -1.0, 1.0]) @ TURN


def affine(linear: np.ndarray, offset: tuple[float, ...] = (0.1, -0.2, 3.0)) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, offset
    return matrix


def covariances(cloud: SplatCloud) -> np.ndarray:
    axes = turn_matrices(cloud.turns) * cloud.scales[:, None, :].astype(np.float64)
    return axes @ axes.transpose(0, 2, 1)


def test_functions_are_orthonormal() -> None:
    """Over 20,000 directions, whose mean is good to about 1e-4."""
    values = splat_basis(directions(20_000), 16)
    assert np.allclose(4 * np.pi * values.T @ values / len(values), np.eye(16), atol=2e-3)


def test_signs_are_those_of_trainers() -> None:
    x, y, z = 0.36, 0.48, 0.8
    expected = [0.28209479, -0.48860251 * y, 0.48860251 * z, -0.48860251 * x, 1.09254843 * x * y,
                -1.09254843 * y * z, 0.31539157 * (2 * z * z - x * x - y * y), -1.09254843 * x * z,
                0.54627422 * (x * x - y * y), -0.59004359 * y * (3 * x * x - y * y), 2.89061144 * x * y * z,
                -0.45704579 * y * (4 * z * z - x * x - y * y), 0.37317633 * z * (2 * z * z - 3 * x * x - 3 * y * y),
                -0.45704579 * x * (4 * z * z - x * x - y * y), 1.44530572 * z * (x * x - y * y),
                -0.59004359 * x * (x * x - 3 * y * y)]
    assert np.allclose(splat_basis(np.array([x, y, z]), 16), expected, atol=1e-8)


@pytest.mark.parametrize("matrix", [TURN, MIRROR, np.eye(3), np.diag([1.0, 1.0, -1.0])])
def test_a_turned_function_has_turned_values(matrix: np.ndarray) -> None:
    coefficients = np.random.default_rng(1).normal(size=16)
    seen = directions(50)
    turned = splat_basis(seen, 16) @ harmonics_turn(matrix) @ coefficients
    assert np.allclose(turned, splat_basis(seen @ matrix, 16) @ coefficients, atol=1e-12)


def test_a_turn_is_orthogonal_and_keeps_degrees() -> None:
    turn = harmonics_turn(TURN)
    assert np.allclose(turn @ turn.T, np.eye(16), atol=1e-12)
    assert np.allclose(turn, harmonics_turn(TURN.T).T, atol=1e-12)
    assert not turn[:4, 4:].any() and not turn[0, 1:].any()


@pytest.mark.parametrize("linear", [2.5 * TURN, 0.4 * MIRROR, np.diag([1.0, 2.0, 0.3]) @ TURN,
                                    np.array([[1, 0.5, 0], [0, -2, 0.2], [0.1, 0, 1]])])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_ellipsoids_go_with_the_matrix(linear: np.ndarray, degree: int) -> None:
    cloud = random_cloud(degree=degree)
    found = moved(cloud, affine(linear))
    assert np.allclose(covariances(found), linear @ covariances(cloud) @ linear.T, rtol=1e-4, atol=1e-7)
    assert np.allclose(found.centres, cloud.centres @ linear.T + (0.1, -0.2, 3.0), atol=1e-5)
    assert np.allclose(np.linalg.norm(found.turns, axis=1), 1, atol=1e-6) and (found.scales > 0).all()
    assert found.harmonics.shape == cloud.harmonics.shape


def test_colours_go_with_the_turn() -> None:
    cloud = random_cloud()
    found = moved(cloud, affine(3.0 * TURN))
    seen = directions(20)
    before = np.einsum("dk,nkc->dnc", splat_basis(seen @ TURN, 16), cloud.harmonics)
    assert np.allclose(np.einsum("dk,nkc->dnc", splat_basis(seen, 16), found.harmonics), before, atol=1e-5)


def test_there_and_back() -> None:
    cloud, matrix = random_cloud(), affine(1.7 * TURN)
    back = moved(moved(cloud, matrix), np.linalg.inv(matrix))
    assert np.allclose(back.centres, cloud.centres, atol=1e-5) and np.allclose(back.scales, cloud.scales, rtol=1e-5)
    assert np.allclose(back.turns, cloud.turns, atol=1e-5) and np.allclose(back.harmonics, cloud.harmonics, atol=1e-5)


def test_quaternions_are_w_first() -> None:
    quarter = turn_matrices(np.array([[np.sqrt(0.5), 0, 0, np.sqrt(0.5)]]))[0]
    assert np.allclose(quarter @ [1, 0, 0], [0, 1, 0], atol=1e-12)
    assert np.allclose(turn_quaternions(quarter[None]), [[np.sqrt(0.5), 0, 0, np.sqrt(0.5)]])


def test_joined_takes_the_highest_degree() -> None:
    found = joined([random_cloud(degree=1), random_cloud(10, degree=3)])
    assert found.harmonics.shape == (60, 16, 3) and not found.harmonics[:50, 4:].any()
    assert len(chosen(found, np.arange(60) < 7)) == 7 and COUNTS[-1] == 16
