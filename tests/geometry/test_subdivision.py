"""Edges are split without moving the surface; Loop subdivision keeps creases, and is Open3D's where there are none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import crease_mask, edges_of
from dataset_builder.geometry.raycast import open3d
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.subdivision import fixed_vertices, loop, split_long_edges, subdivision_matrix
from tests.geometry.closed import watertight

CLOSED = ["box", "chamfered", "cylinder", "vase", "torus"]
NO_CREASES = np.zeros((0, 2), int)


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
    with pytest.raises(UserError, match=r"12 faces are more than the 11 allowed before .* 4,000,000 at most"):
        split_long_edges(shapes["box"](), 1.0, max_faces=11)
    with pytest.raises(UserError, match="more than the 100 allowed; raise edge_length"):
        split_long_edges(shapes["mesh"]([(0, 0, 0), (9, 0, 0), (9, 1e-6, 0)], [(0, 1, 2)]), 0.1, max_faces=100)
    with pytest.raises(UserError, match="expected > 0 m, got 0"):
        split_long_edges(shapes["box"](), 0.0)


def sharp_edges(mesh, angle=30.0):
    edges = edges_of(mesh.faces)
    return edges, crease_mask(mesh, edges, crease_angle=angle)


def open3d_loop(mesh, rounds):
    o3d = open3d()
    # Copies: Open3D refuses read-only arrays.
    other = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(mesh.positions.copy()),
                                      o3d.utility.Vector3iVector(mesh.faces.copy()))
    return np.asarray(other.subdivide_loop(rounds).vertices)


def tetrahedron(shapes):
    corners = [(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)]
    return shapes["mesh"](corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


@pytest.mark.parametrize("rounds", [1, 2, 3])
@pytest.mark.parametrize("name", ["torus", "box", "tetrahedron"])
def test_equals_open3d_without_creases(shapes, name, rounds):
    """Valences 3 (tetrahedron), 4 and 5 (box), 6 (torus): Warren's weights, not Loop's."""
    mesh = tetrahedron(shapes) if name == "tetrahedron" else shapes[name]()
    ours, theirs = loop(mesh, rounds=rounds, creases=NO_CREASES)[0].positions, open3d_loop(mesh, rounds)
    assert len(ours) == len(theirs)
    assert cKDTree(theirs).query(ours)[0].max() < 1e-9
    assert cKDTree(ours).query(theirs)[0].max() < 1e-9


@pytest.mark.parametrize("name", ["box", "chamfered", "cylinder", "vase", "torus", "grid"])
def test_rows_of_the_operator_sum_to_one(shapes, name):
    mesh = shapes[name]()
    edges, sharp = sharp_edges(mesh)
    matrix = subdivision_matrix(edges, sharp, fixed_vertices(mesh, edges, sharp, corner_angle=30))
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-14)
    assert matrix.data.min() >= 0


def test_a_sharp_cube_stays_a_cube(shapes):
    mesh = shapes["box"]()
    fine, creases = loop(mesh, rounds=3, creases=sharp_edges(mesh)[1])
    assert fine.volume == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(fine.bounds, mesh.bounds, atol=1e-14)
    on_surface = np.abs(np.abs(fine.positions).max(axis=1) - 0.5)
    assert on_surface.max() < 1e-14
    assert len(creases) == 12 * 8
    sharp_again = edges_of(fine.faces).vertices[sharp_edges(fine)[1]]
    np.testing.assert_array_equal(np.unique(creases, axis=0), np.unique(sharp_again, axis=0))


def test_crease_tags_are_inherited_and_not_measured_again(shapes):
    mesh = shapes["torus"]()
    edges = edges_of(mesh.faces)
    ring = edges.vertices[(edges.vertices % 12 == 0).all(axis=1)]
    fine, creases = loop(mesh, rounds=2, creases=ring, corner_angle=180)
    assert len(ring) == 24 and len(creases) == 24 * 4
    valence = np.bincount(creases.ravel(), minlength=len(fine.positions))
    assert set(valence) == {0, 2}
    assert not sharp_edges(fine)[1].any()


def test_a_crease_curve_follows_the_cubic_spline_rule(shapes):
    """A rim between two vertices: 1/8, 3/4, 1/8 for the old one, its midpoints for the new."""
    mesh = shapes["cylinder"](sides=32)
    rim = np.flatnonzero((mesh.positions[:, 2] == 0) & (np.hypot(*mesh.positions[:, :2].T) > 0.1))
    fine, _ = loop(mesh, rounds=1, creases=sharp_edges(mesh)[1])
    shrunk = 0.3 * (3 / 4 + np.cos(2 * np.pi / 32) / 4)
    np.testing.assert_allclose(np.hypot(*fine.positions[rim, :2].T), shrunk, rtol=1e-12)


def test_a_sharp_turn_of_a_crease_is_a_corner(shapes):
    mesh = shapes["grid"](4)
    corners = np.flatnonzero(np.isin(mesh.positions[:, :2], (0, 1)).all(axis=1))
    edges, sharp = sharp_edges(mesh)
    for angle, kept in ((30, True), (95, False)):
        fixed = fixed_vertices(mesh, edges, sharp, corner_angle=angle)
        np.testing.assert_array_equal(np.flatnonzero(fixed), corners if kept else [])
        fine, _ = loop(mesh, rounds=2, creases=sharp, corner_angle=angle)
        area = np.linalg.norm(fine.area_normals, axis=1).sum() / 2
        assert (area == pytest.approx(1)) == kept
        assert (fine.positions[corners] == mesh.positions[corners]).all() == kept


def test_fans_that_touch_in_a_vertex_keep_it(shapes):
    """Two cones tip to tip: no edge is sharp enough, but no rule may average over both."""
    cone = shapes["lathe"]([(0.0, 0.0), (1.0, 0.1), (0.0, 0.2)], 16)
    mesh = shapes["mesh"](np.concatenate([cone.positions, cone.positions + np.array((0, 0, 0.2))]),
                          np.concatenate([cone.faces, cone.faces + len(cone.positions)]))
    mesh = repair(mesh)[0]
    edges = edges_of(mesh.faces)
    fixed = fixed_vertices(mesh, edges, np.zeros(len(edges.vertices), bool), corner_angle=30)
    np.testing.assert_allclose(mesh.positions[fixed], [(0, 0, 0.2)], atol=1e-15)


@pytest.mark.parametrize("name", ["box", "chamfered", "cylinder", "vase", "torus"])
def test_no_crack_and_linear_uvs(shapes, name):
    mesh = shapes[name]()
    fine, _ = loop(mesh, rounds=2, creases=sharp_edges(mesh)[1])
    assert watertight(edges_of(fine.faces))
    assert len(fine.faces) == 16 * len(mesh.faces)
    parents = np.repeat(mesh.uvs, 16, axis=0)
    assert (fine.uvs >= parents.min(axis=1, keepdims=True) - 1e-12).all()
    assert (fine.uvs <= parents.max(axis=1, keepdims=True) + 1e-12).all()
    area = lambda uvs: np.abs(np.linalg.det(uvs[:, 1:] - uvs[:, :1])).sum()  # noqa: E731
    assert area(fine.uvs) == pytest.approx(area(mesh.uvs), rel=1e-9)


def test_uvs_agree_across_every_edge_inside_a_chart(shapes):
    mesh = shapes["torus"]()
    fine, _ = loop(mesh, rounds=1, creases=NO_CREASES)
    uvs = np.full((len(fine.positions), 2), np.nan)
    uvs[fine.faces.ravel()] = fine.uvs.reshape(-1, 2)
    np.testing.assert_allclose(uvs[fine.faces], fine.uvs, atol=1e-12)


def test_zero_rounds_change_nothing(shapes):
    mesh = shapes["vase"]()
    edges, sharp = sharp_edges(mesh)
    same, creases = loop(mesh, rounds=0, creases=sharp)
    assert same is mesh
    np.testing.assert_array_equal(creases, edges.vertices[sharp])


def test_a_sheet_modelled_from_both_sides_stays_within_itself(shapes):
    """Its sides share midpoints, so that edges with four faces appear after the first round."""
    sheet = shapes["mesh"]([(5, 5, 5), (6, 5, 5), (5, 6, 5)], [(0, 1, 2), (0, 2, 1)])
    fine, _ = loop(sheet, rounds=3, creases=NO_CREASES)
    assert (fine.positions >= 5).all() and (fine.positions.sum(axis=1) <= 16 + 1e-12).all()
