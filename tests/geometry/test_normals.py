"""Shading normals: smooth inside, split at creases, never broken."""

import time

import numpy as np
import pytest

from dataset_builder.geometry.edges import crease_mask, edges_of
from dataset_builder.geometry.normals import corner_angles, corner_normals


def test_a_cube_has_the_normals_of_its_sides(shapes):
    mesh = shapes["box"]()
    sides = mesh.area_normals / np.linalg.norm(mesh.area_normals, axis=1, keepdims=True)
    np.testing.assert_allclose(corner_normals(mesh), np.repeat(sides[:, None], 3, axis=1), atol=1e-15)


def test_a_smooth_cube_has_its_diagonals(shapes):
    """Weights are angles: three right angles meet in a corner, however its sides are cut into triangles."""
    mesh = shapes["box"]()
    np.testing.assert_allclose(corner_normals(mesh, crease_angle=180), mesh.corners / np.sqrt(0.75), atol=1e-12)


def test_a_cylinder_is_round_at_its_side_and_sharp_at_its_rims(shapes):
    mesh = shapes["cylinder"](sides=32)
    normals = corner_normals(mesh, crease_angle=30)
    flat = np.abs(mesh.area_normals[:, 2]) > 1e-12
    np.testing.assert_allclose(np.abs(normals[flat]), np.broadcast_to((0, 0, 1), normals[flat].shape), atol=1e-12)
    outwards = mesh.corners[~flat] * (1, 1, 0) / 0.3
    np.testing.assert_allclose(np.einsum("fij,fij->fi", normals[~flat], outwards), 1, atol=2e-3)


def test_given_creases_win_over_the_angle(shapes):
    mesh = shapes["box"]()
    edges = edges_of(mesh.faces)
    creases = edges.vertices[crease_mask(mesh, edges, crease_angle=30)]
    np.testing.assert_array_equal(corner_normals(mesh, creases=creases), corner_normals(mesh, crease_angle=30))
    none = corner_normals(mesh, creases=np.zeros((0, 2), int))
    np.testing.assert_array_equal(none, corner_normals(mesh, crease_angle=180))


def test_angles_of_a_triangle_sum_to_pi(shapes):
    np.testing.assert_allclose(corner_angles(shapes["chamfered"]()).sum(axis=1), np.pi)


@pytest.mark.parametrize("faces", [[(0, 1, 3)], [(0, 0, 1)], [(0, 1, 2), (0, 1, 3)], [(0, 1, 2), (2, 1, 0)],
                                   [(0, 1, 2), (1, 0, 3), (0, 0, 0)]])
@pytest.mark.parametrize("angle", [0, 180])
def test_degenerate_faces_have_unit_normals(shapes, faces, angle):
    mesh = shapes["mesh"]([(0, 0, 0), (1, 0, 0), (0, 1, 0), (2, 0, 0)], faces)
    normals = corner_normals(mesh, crease_angle=angle)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1)


def test_a_hundred_thousand_faces_take_no_time(shapes):
    mesh = shapes["torus"](300, 170)
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        corner_normals(mesh)
        seconds.append(time.perf_counter() - start)
    assert len(mesh.faces) > 100_000 and min(seconds) < 2
