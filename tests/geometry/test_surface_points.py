"""No point of a triangle is further than the spacing from a point that stands for it, and there are not too many."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.geometry import surface_points as module
from dataset_builder.geometry.surface_points import surface_points
from dataset_builder.seeding import rng


def points_on(corners: np.ndarray, spacing: float) -> np.ndarray:
    return np.concatenate([np.zeros((0, 3)), *surface_points(corners, spacing)])


def inside_of(corners: np.ndarray, draws: np.random.Generator, count: int) -> np.ndarray:
    """Points on triangles at random, their corners among them."""
    weights = draws.dirichlet([0.7, 0.7, 0.7], (len(corners), count))
    weights = np.concatenate([weights, np.broadcast_to(np.eye(3), (len(corners), 3, 3))], axis=1)
    return (weights @ corners).reshape(-1, 3)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 10_000), size=st.sampled_from([0.01, 0.2, 1.0, 3.0]), flat=st.sampled_from([1.0, 0.05, 0.0]))
def test_every_point_is_near_one_that_stands_for_it(seed: int, size: float, flat: float) -> None:
    """Flat: needles, and triangles without area."""
    draws = rng(seed)
    corners = draws.normal(size=(3, 3, 3)) * size * [1, 1, flat]
    corners[:, 2] = corners[:, 0] + flat * (corners[:, 2] - corners[:, 0]) + (1 - flat) * 0.4 * (corners[:, 1]
                                                                                                 - corners[:, 0])
    found = points_on(corners, 0.1)
    for point in inside_of(corners, draws, 60):
        assert np.linalg.norm(found - point, axis=1).min() <= 0.1 + 1e-9


def test_points_lie_on_their_triangles() -> None:
    corners = np.array([[[0, 0, 0], [3, 0, 0], [0, 2, 0]]], float)
    x, y, z = points_on(corners, 0.05).T
    assert (z == 0).all() and min(x.min(), y.min()) >= 0 and (x / 3 + y / 2).max() <= 1 + 1e-12
    assert 0.95 * 3 / 0.05**2 < len(x) < 1.5 * 3 / 0.05**2


def test_a_sliver_costs_its_length() -> None:
    """10 m long, 2 cm wide, its tip at an end or in the middle."""
    for tip in (0.0, 5.0, 10.0):
        assert len(points_on(np.array([[[0, 0, 0], [10, 0, 0], [tip, 0.02, 0]]]), 0.025)) < 3 * 10 / 0.025


def test_pieces_do_not_change_what_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    corners = rng(1).normal(size=(50, 3, 3))
    whole = points_on(corners, 0.1)
    monkeypatch.setattr(module, "CHUNK", 500)
    assert len(list(surface_points(corners, 0.1))) > 10
    assert np.array_equal(points_on(corners, 0.1), whole)
    assert points_on(np.zeros((0, 3, 3)), 0.1).shape == (0, 3)
