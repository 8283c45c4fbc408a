"""The rough base keeps the shape of the clean mesh; noise has the deviation asked for, and nothing else moves it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import crease_mask, edges_of
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base, vertex_normals
from dataset_builder.geometry.subdivision import loop
from dataset_builder.seeding import rng
from tests.geometry.closed import watertight

ERROR_RATE = 1e-6
"""Chance that a right generator fails one chi-square interval; the seeds are fixed, so it is drawn once."""
SOLIDS = [("box", {}), ("box", {"size": (0.04, 0.05, 0.9)}), ("chamfered", {}),
          ("chamfered", {"size": 0.3, "chamfer": 0.01}), ("cylinder", {}),
          ("cylinder", {"radius": 0.02, "height": 0.7}), ("cylinder", {"sides": 64}), ("vase", {}),
          ("vase", {"sides": 64})]


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
def test_wrong_noise_is_named(shapes, sigma, radius, message):
    with pytest.raises(UserError, match=message):
        displace(shapes["box"](), sigma=sigma, radius=radius, direction="isotropic", rng=rng(0))


@pytest.mark.parametrize(("name", "how"), SOLIDS)
@pytest.mark.parametrize("rounds", [0, 1, 2])
def test_volume_within_one_percent_and_extent_within_half(shapes, name, how, rounds):
    mesh = shapes[name](**how)
    rough = rough_base(mesh, edge_length=0.05, rounds=rounds, crease_angle=30).mesh
    assert abs(rough.volume / mesh.volume - 1) < 0.01
    np.testing.assert_allclose(np.ptp(rough.bounds, axis=0), np.ptp(mesh.bounds, axis=0), rtol=0.005)
    ends = rough.positions[edges_of(rough.faces).vertices]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max() < 0.05 * 1.5


@pytest.mark.parametrize("sides", [16, 32])
@pytest.mark.parametrize("rounds", [1, 2, 3])
def test_balance_takes_out_most_of_what_plain_loop_shrinks(shapes, sides, rounds):
    mesh = shapes["cylinder"](sides=sides)
    edges = edges_of(mesh.faces)
    plain, _ = loop(mesh, rounds=rounds, creases=crease_mask(mesh, edges, crease_angle=30))
    rough = rough_base(mesh, edge_length=1, rounds=rounds, crease_angle=30).mesh
    assert len(plain.faces) == len(rough.faces)
    assert plain.volume / mesh.volume < 1 - 0.07 * (16 / sides) ** 2 / 4
    assert abs(rough.volume / mesh.volume - 1) < 0.3 * (1 - plain.volume / mesh.volume)


def test_balance_leaves_flat_sides_flat_and_within_their_outline(shapes):
    mesh = shapes["box"]((1.0, 0.02, 0.3))
    rough = rough_base(mesh, edge_length=0.03, rounds=2, crease_angle=30).mesh
    np.testing.assert_allclose(rough.bounds, mesh.bounds, atol=1e-12)
    area = np.linalg.norm(mesh.area_normals, axis=1).sum()
    assert np.linalg.norm(rough.area_normals, axis=1).sum() == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("rounds", [1, 2])
def test_a_cube_stays_exactly_a_cube(shapes, rounds):
    rough = rough_base(shapes["box"](), edge_length=0.1, rounds=rounds, crease_angle=30).mesh
    assert rough.volume == pytest.approx(1, abs=1e-12)
    assert np.abs(np.abs(rough.positions).max(axis=1) - 0.5).max() < 1e-14


@pytest.mark.parametrize("name", ["box", "chamfered", "cylinder", "vase", "torus"])
@pytest.mark.parametrize("direction", ["isotropic", "normal"])
def test_no_crack_opens(shapes, name, direction):
    base = rough_base(shapes[name](), edge_length=0.1, rounds=1, crease_angle=30)
    noisy = displace(base.mesh, sigma=0.01, radius=0.5, direction=direction, rng=np.random.default_rng(1))
    assert watertight(edges_of(noisy.faces))
    assert len(np.unique(noisy.positions, axis=0)) == len(noisy.positions)
    outside = noisy.volume
    shifted = noisy.positions + np.array((10, -20, 30))
    assert replace(noisy, positions=shifted).volume == pytest.approx(outside, rel=1e-8)


def test_wrong_numbers_are_named(shapes):
    with pytest.raises(UserError, match="rounds: expected >= 0, got -1"):
        rough_base(shapes["box"](), edge_length=0.1, rounds=-1, crease_angle=30)
    with pytest.raises(UserError, match="more than the 31 allowed"):
        rough_base(shapes["box"](), edge_length=0.1, rounds=1, crease_angle=30, max_faces=127)
