"""Splitting long edges leaves the surface as it is."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.refine import split_long_edges
from tests.geometry.closed import watertight

CLOSED = ["box", "chamfered", "cylinder", "vase", "torus"]


def edge_lengths(mesh):
    ends = mesh.positions[edges_of(mesh.faces).vertices]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


@pytest.mark.parametrize("name", CLOSED)
@pytest.mark.parametrize("length", [0.31, 0.07])
def test_no_edge_stays_long_and_nothing_moves(shapes, name, length):
    mesh = shapes[name]()
    fine = split_long_edges(mesh, length)
    assert edge_lengths(fine).max() <= length
    assert watertight(edges_of(fine.faces))
    assert fine.volume == pytest.approx(mesh.volume, rel=1e-12)
    np.testing.assert_array_equal(fine.bounds, mesh.bounds)
    area = np.linalg.norm(mesh.area_normals, axis=1).sum()
    assert np.linalg.norm(fine.area_normals, axis=1).sum() == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize(("long", "count"), [([0], 2), ([0, 1], 3), ([0, 1, 2], 4)])
@pytest.mark.parametrize("turn", range(3))
def test_one_two_or_three_halved_edges(shapes, long, count, turn):
    triangle = {1: [(0, 0), (1.6, 0), (0.8, 0.5)], 2: [(0, 0), (1.5, 0), (1.2, 1.05)],
                3: [(0, 0), (1.9, 0), (0.9, 1.6)]}
    corners = np.pad(np.array(triangle[len(long)]), ((0, 0), (0, 1)))
    fine = split_long_edges(shapes["mesh"](np.roll(corners, turn, axis=0), [(0, 1, 2)]), 1.1)
    assert len(fine.faces) == count
    assert (fine.area_normals[:, 2] > 0).all()


def test_uvs_are_linear_in_position(shapes):
    mesh = shapes["chamfered"]()
    fine = split_long_edges(mesh, 0.1)
    np.testing.assert_allclose(fine.uvs, fine.corners[..., :2], atol=1e-15)


def test_materials_follow_their_faces(shapes):
    box = shapes["box"]()
    sides = shapes["mesh"](box.positions, box.faces).material + np.repeat(np.arange(6), 2)
    fine = split_long_edges(replace(box, material=sides), 0.2)
    normals = fine.area_normals / np.linalg.norm(fine.area_normals, axis=1, keepdims=True)
    for side in range(6):
        assert len(np.unique(normals[fine.material == side].round(9) + 0.0, axis=0)) == 1


def test_a_budget_stops_an_explosion(shapes):
    with pytest.raises(UserError, match=r"edges of at most 0.0001 m need at least \d+ faces, more than the 4000000"):
        split_long_edges(shapes["box"](), 1e-4)
    with pytest.raises(UserError, match="more than the 100 allowed; raise edge_length"):
        split_long_edges(shapes["mesh"]([(0, 0, 0), (9, 0, 0), (9, 1e-6, 0)], [(0, 1, 2)]), 0.1, max_faces=100)
    with pytest.raises(UserError, match="expected > 0 m, got 0"):
        split_long_edges(shapes["box"](), 0.0)
