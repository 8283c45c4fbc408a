"""Subdivision of cages against steps worked out by hand, limits, and what has to stay."""

import numpy as np
import pytest

from dataset_builder.geometry.cages import SHARPEST, Cage, at_boundary, refinement

CUBE = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
FACES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]])
RIM = [(0, 1), (1, 3), (3, 2), (2, 0)]
OCTAHEDRON = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
EIGHT = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


def cube(**what):
    return Cage(vertices=8, indices=FACES.ravel(), counts=np.full(6, 4), **what)


def grid(n):
    """n x n unit squares in the plane z = 0, and their vertices."""
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1)
    y, x = np.divmod(np.arange((n + 1) ** 2), n + 1)
    points = np.stack([x, y, 0 * x], axis=1).astype(float)
    return points, Cage(vertices=len(points), indices=quads, counts=np.full(n * n, 4))


def positions(cage, points, scheme="catmullClark", **what):
    rounds = refinement(cage, scheme, **what)
    for each in rounds:
        points = each.vertex_values(points)
    return points, rounds[-1].cage


def volume(points, cage):
    corners = points[cage.indices.reshape(-1, cage.counts[0])]
    return sum(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, k], corners[:, k + 1]))
               for k in range(1, cage.counts[0] - 1)) / 6


def test_one_step_of_a_cube_by_hand():
    """Face points at distance 1, edge points (3/4, 3/4, 0) and vertices at 5/9 of where they were."""
    points, finer = positions(cube(), CUBE, rounds=1)
    assert (len(points), len(finer.counts)) == (8 + 12 + 6, 24)
    np.testing.assert_allclose(points[:8], CUBE * 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(points[8:20])), np.tile([0, 0.75, 0.75], (12, 1)), atol=1e-15)
    np.testing.assert_allclose(np.sort(np.abs(points[20:])), np.tile([0, 0, 1], (6, 1)))


def test_a_cube_stays_closed_and_comes_to_its_limit():
    """The limit of a vertex of valence n is (n^2 v + 4 sum(e) + sum(f)) / (n (n + 5)) over its n neighbours e and the n
    vertices f across its faces (M. Halstead, M. Kass, T. DeRose, 1993): here (9 + 4 - 1) / 24 of it."""
    gaps, volumes = [], []
    for rounds in (1, 2, 3, 4):
        points, finer = positions(cube(), CUBE, rounds=rounds)
        assert len(points) - len(finer.indices) // 2 + len(finer.counts) == 2
        gaps.append(np.abs(points[:8] - CUBE / 2).max())
        volumes.append(volume(points, finer))
    np.testing.assert_allclose(gaps, 1 / 18 / 6.0 ** np.arange(4), err_msg="what is left of 5/9 - 1/2, by sixths")
    np.testing.assert_allclose(np.diff(volumes)[1:] / np.diff(volumes)[:-1], 0.25, atol=0.05)


def test_loop_of_an_octahedron_by_hand():
    """A vertex of valence 4 keeps 1 - 4 beta of itself, beta = (5/8 - (3/8)^2) / 4; its neighbours cancel out."""
    cage = Cage(vertices=6, indices=EIGHT.ravel(), counts=np.full(8, 3))
    points, finer = positions(cage, OCTAHEDRON, "loop", rounds=1)
    beta = (5 / 8 - (3 / 8) ** 2) / 4
    np.testing.assert_allclose(points[:6], OCTAHEDRON * (1 - 4 * beta), atol=1e-15)
    np.testing.assert_allclose(np.sort(np.abs(points[6:])), np.tile([0, 3 / 8, 3 / 8], (12, 1)), atol=1e-15)
    assert (len(finer.counts), len(points) - len(finer.indices) // 2 + len(finer.counts)) == (32, 2)
    assert volume(points, finer) > 0


@pytest.mark.parametrize("rounds", [1, 2, 3])
def test_sharp_creases_of_all_edges_keep_the_cube(rounds):
    pairs = np.concatenate([np.stack([FACES[:, k], FACES[:, (k + 1) % 4]], axis=1) for k in range(4)])
    sharp = cube(creases=pairs, crease_sharpness=np.full(24, SHARPEST))
    points, finer = positions(sharp, CUBE, rounds=rounds)
    assert volume(points, finer) == pytest.approx(8)
    bilinear, same = positions(cube(), CUBE, "bilinear", rounds=rounds)
    assert volume(bilinear, same) == pytest.approx(8)


def test_a_crease_around_a_face_stays_in_its_plane_and_makes_a_circle():
    """A closed sharp crease is a cubic B-spline of its own vertices, whatever else the cage does."""
    points, _ = positions(cube(creases=np.array(RIM), crease_sharpness=np.full(4, SHARPEST)), CUBE, rounds=1)
    np.testing.assert_allclose(points[:4], np.column_stack([CUBE[:4, :2] * 0.75, np.full(4, -1)]))
    assert np.abs(points[4:8] - CUBE[4:] * 5 / 9).max() < 1e-12


@pytest.mark.parametrize(("sharpness", "z"), [(0.0, -5 / 9), (0.5, (-5 / 9 - 1) / 2), (1.0, -1.0), (3.0, -1.0)])
def test_part_of_a_crease_lies_between(sharpness, z):
    points, _ = positions(cube(creases=np.array(RIM), crease_sharpness=np.full(4, sharpness)), CUBE, rounds=1)
    np.testing.assert_allclose(points[:4, 2], z)


def test_sharpness_ends_after_its_rounds():
    one, two = (positions(cube(creases=np.array(RIM), crease_sharpness=np.full(4, float(s))), CUBE, rounds=3)[0]
                for s in (1, 2))
    assert one[:4, 2].min() > -1 and two[:4, 2].min() > -1
    assert two[:4, 2].mean() < one[:4, 2].mean()


def test_a_sharp_vertex_stays():
    corners = np.zeros(8)
    corners[7] = SHARPEST
    points, _ = positions(cube(corner_sharpness=corners), CUBE, rounds=3)
    np.testing.assert_array_equal(points[7], CUBE[7])
    assert np.linalg.norm(points[0]) < 1


@pytest.mark.parametrize(("boundary", "corner"), [("edgeAndCorner", (0, 0)), ("edgeOnly", (0.25 / 2, 0.25 / 2))])
def test_boundaries(boundary, corner):
    """Flat stays flat; a boundary vertex follows its boundary, so that a corner is cut or stays."""
    points, cage = grid(3)
    found, _ = positions(cage, points, rounds=1, boundary=boundary)
    np.testing.assert_allclose(found[:, 2], 0)
    np.testing.assert_allclose(found[0, :2], corner)
    np.testing.assert_allclose(found[1, :2], (1, 0))
    np.testing.assert_array_equal(np.flatnonzero(~at_boundary(cage)), [4])


def test_values_at_corners_are_linear_and_stay_within_their_face():
    points, cage = grid(2)
    rounds = refinement(cage, "bilinear", rounds=2)
    values = points[cage.indices]
    for each in rounds:
        points, values = each.vertex_values(points), each.corner_values(values)
    np.testing.assert_allclose(values, points[rounds[-1].cage.indices])


def test_values_at_corners_of_triangles():
    cage = Cage(vertices=6, indices=EIGHT.ravel(), counts=np.full(8, 3))
    (each,) = refinement(cage, "loop", rounds=1)
    flat = OCTAHEDRON[cage.indices]
    ends = each.corner_values(flat).reshape(-1, 3, 3)
    np.testing.assert_allclose(np.abs(ends).sum(axis=2), 1)
    with pytest.raises(ValueError, match="expected triangles alone"):
        refinement(cube(), "loop", rounds=1)


def test_faces_of_all_sizes_and_faces_that_share_an_edge_of_three():
    """A pentagon becomes five quadrilaterals; an edge of three faces is sharp and makes nothing infinite."""
    turns = np.arange(5) * 2 * np.pi / 5
    pentagon = np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    points, finer = positions(Cage(vertices=5, indices=np.arange(5), counts=np.array([5])), pentagon, rounds=1)
    assert finer.counts.tolist() == [4] * 5
    np.testing.assert_allclose(points[:5], pentagon)
    book = Cage(vertices=5, indices=np.array([0, 1, 2, 0, 1, 3, 0, 1, 4]), counts=np.full(3, 3))
    where = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    found, _ = positions(book, where, rounds=2)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[:, 2].max(), 1)


def test_every_point_is_a_mean_of_the_cage():
    """Weights of each new vertex sum to 1, whatever is sharp."""
    generator = np.random.default_rng(5)
    pairs = generator.integers(0, 8, (20, 2))
    what = cube(creases=pairs, crease_sharpness=generator.uniform(0, 4, 20),
                corner_sharpness=generator.uniform(0, 2, 8))
    for each in refinement(what, "catmullClark", rounds=3):
        np.testing.assert_allclose(each.vertex_values(np.ones((each.of_vertices.shape[1], 1))), 1)
