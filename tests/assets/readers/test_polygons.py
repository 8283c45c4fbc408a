"""Polygons become triangles of the same area, wound the same way, with all of their corners."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dataset_builder.assets.readers.polygons import triangulated

ELL = [(0, 0), (1, 0), (1, 0.3), (0.3, 0.3), (0.3, 1), (0, 1)]
"""0.3 + 0.7 * 0.3 = 0.51."""
DOORWAY = [(0, 0), (1, 0), (1, 2), (2, 2), (2, 0), (3, 0), (3, 3), (0, 3)]
"""A wall of 9 with a door of 2."""
FRAME = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
"""A square of 16 with a hole of 4, joined by the edge from (0, 0) to (1, 1)."""
STAR = [(np.cos(k * np.pi / 5) * (2 - k % 2), np.sin(k * np.pi / 5) * (2 - k % 2)) for k in range(10)]
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
CASES = {"ell": (ELL, 0.51), "doorway": (DOORWAY, 7), "frame": (FRAME, 12), "star": (STAR, 10 * np.sin(np.pi / 5)),
         "dart": ([(0, 0), (2, 1), (0, 2), (1, 1)], 1), "square": ([(0, 0), (1, 0), (1, 1), (0, 1)], 1),
         "on an edge": ([(0, 0), (1, 0), (2, 0), (2, 1), (0, 1)], 2),
         "on all edges": ([(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (1, 2), (0, 2), (0, 1)], 4),
         "twice": ([(0, 0), (0, 0), (1, 0), (1, 1), (1, 1), (0, 1)], 1)}


def solid(outline):
    return np.array([(*point, 0.0) for point in outline])


def areas(points, triangles):
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("turn", [np.eye(3), -np.eye(3), TURN, TURN[[1, 2, 0]]], ids=["plain", "mirrored", "a", "b"])
@pytest.mark.parametrize(("outline", "area"), CASES.values(), ids=CASES)
def test_area_and_winding_from_every_corner_on(outline, area, turn):
    plain = solid(outline)
    for start in range(len(outline)):
        for way in (1, -1):
            points = np.roll(plain[::way], start, axis=0) @ turn.T
            made = triangulated(points, np.arange(len(points)), np.array([len(points)]))
            found = areas(points, made.corners)
            np.testing.assert_allclose(found.sum(axis=0), way * area * (turn @ (0, 0, 1)) * np.linalg.det(turn),
                                       atol=1e-12)
            assert np.linalg.norm(found, axis=1).sum() == pytest.approx(area)
            assert len(made.crossed) == 0
            distinct = {tuple(point) for point in points}
            assert {tuple(points[corner]) for corner in made.corners.ravel()} == distinct


@pytest.mark.parametrize("outline", [ELL, DOORWAY, CASES["on an edge"][0], CASES["on all edges"][0]])
def test_every_edge_of_the_outline_is_an_edge_of_one_triangle(outline):
    """A corner that lies on a straight edge stays, or a neighbour that has it would not be met."""
    points, count = solid(outline), len(outline)
    corners = triangulated(points, np.arange(count), np.array([count])).corners
    edges = [(int(face[k]), int(face[(k + 1) % 3])) for face in corners for k in range(3)]
    assert all(edges.count((k, (k + 1) % count)) == 1 for k in range(count))
    assert len(corners) == count - 2


def test_many_polygons_keep_their_order_and_corners():
    points = np.concatenate([solid(DOORWAY), solid(ELL)[:, [2, 0, 1]], [(5, 5, 5)]])
    indices = np.array([0, 1, 2, *range(8), 14, 14, *range(8, 14), 3, 6, 7, 0])
    made = triangulated(points, indices, np.array([3, 8, 2, 6, 4]))
    assert made.owner.tolist() == [0] + [1] * 6 + [3] * 4 + [4] * 2
    firsts = np.array([0, 3, 11, 13, 19])
    assert (made.corners >= firsts[made.owner][:, None]).all()
    assert made.corners[0].tolist() == [0, 1, 2] and made.corners.max() == 22
    assert np.linalg.norm(areas(points, indices[made.corners])[made.owner == 3].sum(axis=0)) == pytest.approx(0.51)


@pytest.mark.parametrize("outline", [[(0, 0), (1, 0), (2, 0), (3, 0)], [(1, 1)] * 5, [(0, 0), (1, 0), (0, 0), (1, 0)]])
def test_what_has_no_area_becomes_a_fan_without_one(outline):
    points = solid(outline)
    made = triangulated(points, np.arange(len(points)), np.array([len(points)]))
    assert len(made.corners) == len(points) - 2
    assert not areas(points, made.corners).any()


def test_an_outline_that_crosses_itself_is_named():
    bow = solid([(0, 0), (2, 2), (2, 0), (0, 1)])
    square = solid(CASES["square"][0])
    made = triangulated(np.concatenate([square, bow]), np.arange(8), np.array([4, 4]))
    assert made.crossed.tolist() == [1]


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(radii=st.lists(st.floats(0.05, 1), min_size=4, max_size=40), turn=st.integers(0, 3))
def test_outlines_around_a_point_are_covered_once(radii, turn):
    """Spiky as they are, the angle grows along them: the area is that of the triangles from the centre."""
    angles = np.arange(len(radii)) / len(radii) * 2 * np.pi
    points = np.stack([np.cos(angles) * radii, np.sin(angles) * radii, 0 * angles], axis=1)
    around = np.roll(points, -1, axis=0)
    area = (points[:, 0] * around[:, 1] - points[:, 1] * around[:, 0]).sum() / 2
    rotated = np.roll(points, turn, axis=1) + 3
    made = triangulated(rotated, np.arange(len(radii)), np.array([len(radii)]))
    found = areas(rotated, made.corners)
    assert len(made.corners) == len(radii) - 2 and len(made.crossed) == 0
    assert np.linalg.norm(found, axis=1).sum() == pytest.approx(area)
    assert found.sum(axis=0)[(2 + turn) % 3] == pytest.approx(area)


def test_nothing_of_nothing():
    made = triangulated(np.zeros((0, 3)), np.zeros(0, int), np.zeros(0, int))
    assert made.corners.shape == (0, 3) and made.owner.shape == (0,)
