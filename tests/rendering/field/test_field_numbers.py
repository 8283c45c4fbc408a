"""What fields compute with, against NumPy: look-ups and slopes between cells, slabs of known density, spans of rays."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from dataset_builder.geometry.marching import largest_parts, level_mesh, solid
from dataset_builder.geometry.visual_hull import cell_middles, visual_hull
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_grid import FieldGrid, dense_corners, resampled
from dataset_builder.rendering.field.field_mesh import density_of
from dataset_builder.rendering.field.field_model import GAIN, OUTSIDE, SHIFT, UNIT, FieldModel, weights
from dataset_builder.rendering.field.field_pixels import spans
from tests.rendering.field.ball_views import BALL, CENTRE, RADIUS, ball_images, sphere_directions

SIDE = 9


def points_of(array: np.ndarray) -> "mi.Point3f":
    return mi.Point3f(*(owned(mi.Float, values) for values in array.T.astype(np.float32)))


@pytest.fixture(scope="module")
def grid() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(SIDE,) * 3 + (4,)).astype(np.float32)


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1.1, 1.1, size=(500, 3))


def interpolated(grid: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Between middles of cells; beyond the outermost their values."""
    at = np.clip((points * 0.5 + 0.5) * SIDE - 0.5, 0, SIDE - 1)[:, ::-1].T
    return np.stack([map_coordinates(grid[..., k].astype(np.float64), at, order=1) for k in range(4)], axis=1)


def test_a_look_up_is_trilinear(grid: np.ndarray, points: np.ndarray) -> None:
    found = dense_corners(owned(mi.Float, grid), dr.opaque(mi.UInt32, SIDE), points_of(points), mi.Bool(True)).value()
    assert np.allclose(np.array(found).T, interpolated(grid, points), atol=1e-4)


def test_cells_without_a_row_are_zero(grid: np.ndarray, points: np.ndarray) -> None:
    active = np.random.default_rng(2).random((SIDE,) * 3) < 0.4
    sparse = FieldGrid.of(active)
    table = grid[active]
    found = sparse.corners(owned(mi.Float, table), points_of(points), mi.Bool(True)).value()
    assert np.allclose(np.array(found).T, interpolated(grid * active[..., None], points), atol=1e-4)
    assert np.array_equal(sparse.dense(table), grid * active[..., None])


def test_the_slope_is_that_of_the_look_up(grid: np.ndarray) -> None:
    """Central differences within cells."""
    cells = np.random.default_rng(3).integers(0, SIDE - 1, size=(200, 3))
    inside = (cells + 0.5 + np.random.default_rng(4).uniform(0.1, 0.9, size=(200, 3))) * (2 / SIDE) - 1
    corners = dense_corners(owned(mi.Float, grid), dr.opaque(mi.UInt32, SIDE), points_of(inside), mi.Bool(True))
    step = 0.01 * 2 / SIDE
    slopes = [(interpolated(grid, inside + step * axis) - interpolated(grid, inside - step * axis))[:, 0] / 0.02
              for axis in np.eye(3)]
    assert np.allclose(np.array(corners.gradient()).T, np.stack(slopes, axis=1), atol=2e-3)


def test_resampling_is_the_look_up(grid: np.ndarray) -> None:
    assert np.allclose(resampled(grid, 14).reshape(-1, 4), interpolated(grid, cell_middles(14)), atol=1e-5)
    assert np.array_equal(resampled(grid, SIDE), grid)


def test_slabs_let_through_what_they_should() -> None:
    """exp(-sum) passes, and weights sum to the opacity."""
    optical = np.random.default_rng(5).exponential(0.3, size=(100, 16))
    found = np.array(weights(owned(mi.Float, optical.astype(np.float32)), 16)).reshape(100, 16)
    assert np.allclose(1 - found.sum(1), np.exp(-optical.sum(1)), atol=1e-5)
    before = np.cumsum(optical, axis=1) - optical
    assert np.allclose(found, np.exp(-before) * (1 - np.exp(-optical)), atol=1e-5)


def test_opacity_of_a_cell_is_its_own_at_any_resolution() -> None:
    raw = density_of(0.3)
    assert np.logaddexp(0, GAIN * raw + SHIFT) == pytest.approx(-np.log(0.7))
    for cell in (0.1, 0.01):
        model = FieldModel(kind="density", cell=mi.Float(cell), sharpness=mi.Float(1))
        optical = model.optical(None, mi.Vector4f(raw, 0, 0, 0), mi.Vector3f(0, 0, 1), mi.Float(cell))
        assert 1 - np.exp(-optical[0]) == pytest.approx(0.3, abs=1e-4)


@pytest.mark.parametrize("way", [1, -1])
def test_a_distance_lets_through_the_ratio_of_logistics(way: int) -> None:
    """A plane z = 0, solid below: NeuS's opacity on the way down, none on the way up."""
    side, sharp = 16, 0.3
    values = np.zeros((side,) * 3 + (4,), np.float32)
    values[..., 0] = OUTSIDE - cell_middles(side)[:, 2].reshape((side,) * 3) / UNIT
    height = 0.03
    corners = dense_corners(owned(mi.Float, values), dr.opaque(mi.UInt32, side), mi.Point3f(0, 0, height),
                            mi.Bool(True))
    model = FieldModel(kind="sdf", cell=mi.Float(2 / side), sharpness=mi.Float(sharp))
    optical = model.optical(corners, corners.value(), mi.Vector3f(0, 0, -way), mi.Float(0.02))[0]
    passed = [1 / (1 + np.exp(-sharp * (height + half) / UNIT)) for half in (0.01, -0.01)]
    assert np.exp(-optical) == pytest.approx(passed[1] / passed[0] if way == 1 else 1, abs=1e-4)


def test_spans_hold_what_is_occupied() -> None:
    side = 32
    occupied = np.linalg.norm(cell_middles(side), axis=1).reshape((side,) * 3) < 0.5
    heights = np.linspace(-0.9, 0.9, 50)
    near, far = (np.array(each) for each in spans(
        points_of(np.stack([np.full(50, -3.0), heights, np.zeros(50)], axis=1)), mi.Vector3f(1, 0, 0), occupied,
        np.zeros(occupied.shape)))
    half = np.sqrt(np.maximum(0.25 - heights**2, 0))
    deep = half > 0.15
    assert (near[deep] <= 3 - half[deep] + 2 / side).all() and (near[deep] > 3 - half[deep] - 0.2).all()
    assert (far[deep] >= 3 + half[deep] - 2 / side).all() and (far[deep] < 3 + half[deep] + 0.2).all()
    assert (far[np.abs(heights) > 0.6] == 0).all()


def test_a_hull_holds_the_object_and_little_else() -> None:
    hull = visual_hull(ball_images(sphere_directions(24), size=64), np.arange(24), 32, centre=np.array(CENTRE),
                       radius=RADIUS).ravel()
    distance = np.linalg.norm(cell_middles(32), axis=1)
    assert hull[distance < BALL].all() and not hull[distance > BALL + 0.2].any()
    tight = visual_hull(ball_images(sphere_directions(24), size=64), np.arange(24), 32, centre=np.array(CENTRE),
                        radius=RADIUS, slack=0, whole=0).ravel()
    assert not (tight & ~hull).any() and tight.sum() == pytest.approx((distance < BALL).sum(), rel=0.15)


def test_what_cannot_be_reached_is_solid() -> None:
    """A hollow ball with a pinhole, and a speck beside it: one closed surface, and the volume of the whole ball."""
    side = 32
    middles = cell_middles(side)
    distance = np.linalg.norm(middles, axis=1)
    values = np.where((distance < 0.7) & (distance > 0.4), 1.0, 0.0)
    values[(np.abs(middles[:, :2]) < 1 / side).all(axis=1) & (middles[:, 2] > 0)] = 0
    values[np.linalg.norm(middles - 0.85, axis=1) < 0.05] = 1
    whole = level_mesh(solid(values.reshape((side,) * 3), 0.5), 0.5, 2 / side)
    mesh, parts, dropped = largest_parts(whole)
    assert (parts, dropped) == (1, 1)
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=0.05)
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    assert level_mesh(np.zeros((4, 4, 4)), 0.5) is None
