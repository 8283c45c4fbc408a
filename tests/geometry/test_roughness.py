"""Measured roughness, on meshes whose answers are worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.geometry.mesh import TriangleMesh, concatenate
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base
from dataset_builder.geometry.roughness import Roughness, measure_roughness, sample, spectrum_slope
from dataset_builder.geometry.subdivision import split_long_edges
from dataset_builder.seeding import rng


def measured(rough: TriangleMesh, clean: TriangleMesh, seed: int = 0) -> Roughness:
    return measure_roughness(rough, clean, rng(seed, "roughness"))


def moved(mesh: TriangleMesh, positions: np.ndarray) -> TriangleMesh:
    return replace(mesh, positions=positions)


@pytest.fixture
def ball(shapes) -> TriangleMesh:
    """A box's split sides, pushed onto the unit sphere."""
    mesh = split_long_edges(shapes["box"](), 0.05)
    return moved(mesh, mesh.positions / np.linalg.norm(mesh.positions, axis=1, keepdims=True))


@pytest.fixture
def sheet(shapes) -> TriangleMesh:
    """The unit square, open, of edges of 1/128."""
    return shapes["grid"](128)


def test_nothing_moved(ball):
    found = measured(ball, ball)
    assert max(found.rms, found.maximum, found.to_clean_95, found.to_rough_95) < 1e-6
    assert found.normal_median < 1e-3 and found.flipped == 0 and found.spectrum_slope == 0
    assert [found.volume, found.area, found.extent_x, found.extent_y, found.extent_z] == [1] * 5


def test_a_sphere_that_is_one_per_cent_larger(ball):
    """About its middle all normals stay, lengths grow by 1%, areas and volumes by its powers."""
    found = measured(moved(ball, 1.01 * ball.positions), ball)
    for distance in (found.rms, found.to_clean_rms, found.to_clean_95, found.to_rough_rms, found.to_rough_95):
        assert distance == pytest.approx(0.01, rel=0.01)
    assert found.radius == pytest.approx(1)
    assert found.normal_median < 0.5 and found.normal_95 < 2, "facets beside each other differ by about 2 degrees"
    assert found.area == pytest.approx(1.01**2) and found.volume == pytest.approx(1.01**3)
    assert [found.extent_x, found.extent_y, found.extent_z] == pytest.approx([1.01] * 3)


def test_a_lifted_plane_is_as_rough_as_it_is_high(sheet):
    """The square's radius is half its diagonal; it encloses nothing and has no height to compare with."""
    found = measured(moved(sheet, sheet.positions + np.array((0, 0, 0.01))), sheet)
    high = 0.01 / np.sqrt(0.5)
    for distance in (found.rms, found.maximum, found.to_clean_rms, found.to_clean_95, found.to_rough_rms,
                     found.to_rough_95):
        assert distance == pytest.approx(high, rel=1e-4)
    assert found.normal_95 < 1e-3 and found.area == pytest.approx(1)
    assert (found.volume, found.extent_x, found.extent_y, found.extent_z) == (0, 1, 1, 0)


def test_distances_both_ways_differ_where_a_part_is_lost(sheet):
    """Half of the square has gone: what is left lies on the clean one, whose other half is 0 to 1/2 away from it."""
    half = replace(sheet, faces=sheet.faces[sheet.corners[..., 0].max(axis=1) < 0.5 + 1e-9],
                   uvs=sheet.uvs[:len(sheet.faces) // 2], material=sheet.material[:len(sheet.faces) // 2])
    found = measured(half, sheet)
    radius = np.sqrt(0.5)
    assert found.to_clean_95 < 1e-6 and found.area == pytest.approx(0.5)
    assert found.to_rough_rms == pytest.approx(np.sqrt(0.5 * 0.25 / 3) / radius, rel=0.01)
    assert found.to_rough_95 == pytest.approx(0.45 / radius, rel=0.01)
    assert (found.extent_x, found.extent_y) == pytest.approx((0.5, 1))


def test_a_sine_wave(shapes):
    """z = A sin(k x): A / sqrt 2 high, and steeper than A k |cos| at the share of the period where |cos| is larger."""
    amplitude, wave, columns = 0.004, 4 * 2 * np.pi, 4000
    low = np.column_stack([np.linspace(0, 1, columns + 1), np.zeros((columns + 1, 2))])
    here, above = np.arange(columns), np.arange(columns) + columns + 1
    strip = shapes["mesh"](np.concatenate([low, low + np.array((0, 1, 0))]), np.concatenate([
        np.column_stack([here, here + 1, above + 1]), np.column_stack([here, above + 1, above])]))
    height = amplitude * np.sin(wave * strip.positions[:, 0])
    found = measured(moved(strip, strip.positions + height[:, None] * np.array((0, 0, 1))), strip)
    assert found.to_clean_rms == pytest.approx(amplitude / np.sqrt(2) / np.sqrt(0.5), rel=0.01)
    assert found.to_clean_95 == pytest.approx(amplitude * np.sin(0.475 * np.pi) / np.sqrt(0.5), rel=0.01)
    assert found.normal_median == pytest.approx(np.degrees(np.arctan(amplitude * wave * np.sqrt(0.5))), rel=0.01)
    assert found.normal_95 == pytest.approx(np.degrees(np.arctan(amplitude * wave * np.sin(0.475 * np.pi))), rel=0.01)
    slope = np.sqrt(1 + (amplitude * wave * np.cos(np.linspace(0, 2 * np.pi, 4096))) ** 2).mean()
    assert found.area == pytest.approx(slope, rel=1e-3)


def test_a_tilted_plane(sheet):
    """Turned by 10 degrees about its middle line: every normal by 10 degrees, heights x tan 10 on its own slope."""
    tilt, x = np.radians(10), sheet.positions[:, 0] - 0.5
    turned = np.stack([np.cos(tilt) * x + 0.5, sheet.positions[:, 1], np.sin(tilt) * x], axis=1)
    found = measured(moved(sheet, turned), sheet)
    assert (found.normal_median, found.normal_95) == pytest.approx((10, 10), abs=1e-3)
    assert found.to_clean_rms == pytest.approx(np.sin(tilt) / np.sqrt(12) / np.sqrt(0.5), rel=1e-3)
    assert found.area == pytest.approx(1) and found.extent_x == pytest.approx(np.cos(tilt))


def test_one_flipped_face(shapes):
    """Of twelve equal ones; a sixth of the cube's volume comes from every side, and half of that from a face."""
    box = shapes["box"]()
    faces = box.faces.copy()
    faces[5] = faces[5, ::-1]
    found = measured(replace(box, faces=faces), box)
    assert found.flipped == pytest.approx(1 / 12) and found.normal_95 == pytest.approx(180)
    assert found.volume == pytest.approx(1 - 2 / 12) and found.area == pytest.approx(1)


def test_parts_that_touch_are_no_flipped_faces(shapes):
    """Two cubes share a side, where both of their sheets lie in one place and look opposite ways."""
    box = shapes["box"]()
    clean = concatenate([box, moved(box, box.positions + np.array((1, 0, 0)))])
    base = rough_base(clean, edge_length=0.1, rounds=1, crease_angle=30).mesh
    noisy = displace(base, sigma=0.002, radius=bounding_radius(clean), direction="isotropic", rng=rng(0))
    found = measured(noisy, clean)
    assert found.flipped == 0 and found.normal_95 < 15
    _, nearest = RayScene([(clean.positions, clean.faces, 1)]).closest(base.corners.mean(axis=1))
    assert np.mean(np.einsum("ij,ij->i", base.area_normals, nearest) < 0) > 0.02, "the nearest sheet would be wrong"


def test_roughness_follows_sigma(shapes):
    """Of isotropic noise, a flat surface feels the part along its normal; 0 where the base is exact."""
    clean = shapes["box"]()
    base = rough_base(clean, edge_length=0.05, rounds=1, crease_angle=30).mesh
    assert measured(base, clean).maximum < 1e-6
    for sigma in (0.002, 0.004):
        noisy = displace(base, sigma=sigma, radius=bounding_radius(clean), direction="isotropic", rng=rng(0))
        assert measured(noisy, clean).rms == pytest.approx(sigma, rel=0.05)


def test_figures_repeat_with_the_seed_and_barely_move_with_another(shapes):
    clean = shapes["vase"]()
    base = rough_base(clean, edge_length=0.02, rounds=1, crease_angle=30).mesh
    noisy = displace(base, sigma=0.01, radius=bounding_radius(clean), direction="normal", rng=rng(0))
    assert measured(noisy, clean, 1) == measured(noisy, clean, 1)
    one, other = (measured(noisy, clean, seed) for seed in (1, 2))
    assert one.to_clean_rms != other.to_clean_rms
    assert one.to_clean_rms == pytest.approx(other.to_clean_rms, rel=0.03)
    assert one.normal_median == pytest.approx(other.normal_median, rel=0.05)


def test_points_are_spread_by_area(shapes):
    """A face of nine tenths of the area gets nine tenths of the points, all inside their faces."""
    mesh = shapes["mesh"]([(0, 0, 0), (9, 0, 0), (0, 1, 0), (20, 0, 0), (21, 0, 0), (20, 1, 0)],
                          [(0, 1, 2), (3, 4, 5), (0, 0, 1)])
    points, normals = sample(mesh, 1000, rng(0))
    assert (points[:, 0] < 10).sum() == 900
    assert (points[:900, 0] / 9 + points[:900, 1] <= 1 + 1e-12).all() and (points >= 0).all()
    np.testing.assert_allclose(points[:900].mean(axis=0), [3, 1 / 3, 0], rtol=0.05)
    np.testing.assert_array_equal(normals, np.tile([0.0, 0, 1], (1000, 1)))


@pytest.mark.parametrize("exponent", [-2.5, -3.0, -3.5])
def test_the_slope_of_a_field_of_known_spectrum(exponent):
    """Fractal fields on a square of which a quarter is taken, so that their period is far beyond the band."""
    size, generator = 1024, rng(0, str(exponent))
    wave = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    wave[0, 0] = np.inf
    field = np.fft.ifft2(np.fft.fft2(generator.standard_normal((size, size))) * wave ** (exponent / 2)).real
    spots = generator.integers(0, size // 2, (2048, 2))
    points = np.column_stack([spots / (size // 2) * np.sqrt(2), np.zeros(2048)])
    upright = np.tile([0.0, 0, 1], (2048, 1))
    assert spectrum_slope(points, field[*spots.T], upright) == pytest.approx(exponent, abs=0.15)


def test_the_slope_of_white_noise_and_of_a_bulge():
    generator = rng(0)
    points = np.column_stack([generator.uniform(0, np.sqrt(2), (2048, 2)), np.zeros(2048)])
    upright = np.tile([0.0, 0, 1], (2048, 1))
    assert spectrum_slope(points, generator.standard_normal(2048), upright) == pytest.approx(-2, abs=0.05)
    assert spectrum_slope(points, np.sin(points[:, 0]), upright) == pytest.approx(-4, abs=0.05)


def test_two_sides_of_a_board_are_not_compared():
    """Both sides bulge smoothly, one of them a metre further out: across the board nothing is smooth."""
    generator = rng(0)
    points = np.column_stack([generator.uniform(0, np.sqrt(2), (2048, 2)), np.zeros(2048)])
    side = np.where(np.arange(2048) % 2, 1.0, -1.0)
    normals = np.column_stack([np.zeros((2048, 2)), side])
    assert spectrum_slope(points, np.sin(points[:, 0]) + side, normals) == pytest.approx(-4, abs=0.05)
    assert spectrum_slope(points, np.sin(points[:, 0]) + side, np.abs(normals)) > -2.1
