"""Edges and shading normals of meshes whose answers are known."""

import time

import numpy as np
import pytest

from dataset_builder.geometry.edges import (
    consistent,
    corner_angles,
    corner_normals,
    crease_mask,
    dihedral_angles,
    edges_of,
    fans,
    find_edges,
)
from tests.geometry.closed import watertight


@pytest.mark.parametrize(("name", "characteristic"), [("box", 2), ("cylinder", 2), ("torus", 0), ("grid", 1)])
def test_euler_characteristic(shapes, name, characteristic):
    mesh = shapes[name]()
    assert len(mesh.positions) - len(edges_of(mesh.faces).vertices) + len(mesh.faces) == characteristic


def test_a_cube_has_twelve_right_angles_and_six_flat_diagonals(shapes):
    mesh = shapes["box"]()
    angles = np.sort(dihedral_angles(mesh, edges_of(mesh.faces)))
    np.testing.assert_allclose(angles, [0] * 6 + [90] * 12, atol=1e-12)


def test_dihedral_angles_of_a_cylinder(shapes):
    mesh = shapes["cylinder"](sides=20)
    angles = np.unique(dihedral_angles(mesh, edges_of(mesh.faces)).round(6))
    np.testing.assert_allclose(angles, [0, 18, 90])


def test_every_face_is_found_again_at_its_edges(shapes):
    edges = edges_of(shapes["torus"]().faces)
    for face, own in enumerate(edges.of_face):
        assert (edges.faces[own] == face).any(axis=1).all()


def test_creases_are_sharp_or_open_or_broken_edges(shapes):
    mesh = shapes["grid"](3)
    edges = edges_of(mesh.faces)
    assert (crease_mask(mesh, edges, crease_angle=30) == (edges.face_count == 1)).all()
    flipped = mesh.faces.copy()
    flipped[0] = flipped[0][::-1]
    broken = shapes["mesh"](mesh.positions, flipped)
    edges = edges_of(flipped)
    assert crease_mask(broken, edges, crease_angle=180)[edges.of_face[0]].all()


def test_three_faces_at_an_edge_are_a_crease(shapes):
    mesh = shapes["mesh"]([(0, 0, 0), (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0)], [(0, 1, 2), (1, 0, 3), (0, 1, 4)])
    edges = edges_of(mesh.faces)
    assert edges.face_count.max() == 3
    assert crease_mask(mesh, edges, crease_angle=180)[edges.face_count == 3].all()
    assert not consistent(edges).any()


def test_watertight(shapes):
    closed = shapes["vase"]()
    assert watertight(edges_of(closed.faces))
    assert not watertight(edges_of(closed.faces[1:]))


def test_pairs_name_edges_in_both_directions(shapes):
    edges = edges_of(shapes["box"]().faces)
    chosen = np.arange(len(edges.vertices)) % 3 == 0
    assert (find_edges(edges, edges.vertices[chosen][:, ::-1]) == chosen).all()
    assert not find_edges(edges, np.zeros((0, 2), int)).any()


def test_fans_of_a_cube_are_its_sides_or_its_corners(shapes):
    mesh = shapes["box"]()
    edges = edges_of(mesh.faces)
    whole = fans(edges, np.ones(len(edges.vertices), bool))
    split = fans(edges, ~crease_mask(mesh, edges, crease_angle=30))
    assert len(np.unique(whole)) == 8
    assert len(np.unique(split)) == 24
    for labels in (whole, split):
        for label in np.unique(labels):
            assert len(np.unique(mesh.faces[labels == label])) == 1


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
