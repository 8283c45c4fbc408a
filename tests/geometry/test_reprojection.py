"""A plane seen from two sides, where everything is known; what is hidden or out of the frame has no like."""

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.geometry.reprojection import View, correspond
from dataset_builder.seeding import rng

SIZE = 96
NORMAL, OFFSET = np.array([0.2, -0.9, 0.4]) / np.linalg.norm([0.2, -0.9, 0.4]), 0.3


def camera_at(*position: float) -> Pinhole:
    return Pinhole(position=np.array(position), target=np.array([0.0, -0.3, 0.1]), fov=40.0, width=SIZE, height=SIZE)


def plane_view(camera: Pinhole) -> View:
    """The plane NORMAL . x = OFFSET."""
    ways = camera.directions(np.arange(SIZE) + 0.5, np.arange(SIZE)[:, None] + 0.5)
    depth = (OFFSET - NORMAL @ camera.position) / (ways @ NORMAL)
    return View(camera=camera, depth=depth, inside=depth > 0)


def painted(view: View) -> np.ndarray:
    """(H, W, 3) what the plane has painted on it: waves as long as thirty pixels or so."""
    points = view.camera.unproject(view.depth)
    return np.sin(5 * points) * np.array([1.0, 0.7, 0.4])


HERE, THERE = plane_view(camera_at(0.5, -3.0, 1.2)), plane_view(camera_at(-0.2, -2.8, 1.6))


def test_a_painted_plane_is_the_same_from_both_sides() -> None:
    """Bilinear error of sin(5 x) at pixels of 0.023 m, which are 0.11 of a wave's radian: at most 2 x 0.11^2 / 8."""
    both = correspond(HERE, THERE)
    assert both.pixels.mean() > 0.7
    assert np.abs(both.here(painted(HERE)) - both.there(painted(THERE))).max() < 4e-3
    assert both.weights.sum(axis=0) == pytest.approx(np.ones(both.pixels.sum()))
    # The check can fail: with the camera elsewhere by half a pixel it is off by more
    moved = Pinhole(position=THERE.camera.position, target=THERE.camera.target + np.array([0.012, 0.0, 0.0]), fov=40.0,
                    width=SIZE, height=SIZE)
    wrong = correspond(HERE, View(camera=moved, depth=THERE.depth, inside=THERE.inside))
    assert np.abs(wrong.here(painted(HERE)) - wrong.there(painted(THERE))).max() > 2e-2


def test_a_view_is_its_own_like_but_for_the_rim() -> None:
    both = correspond(HERE, HERE)
    values = rng(0).normal(size=(SIZE, SIZE, 3))
    assert both.pixels[1:-1, 1:-1].mean() > 0.9
    assert np.abs(both.here(values) - both.there(values)).max() < 1e-9


def test_what_something_hides_has_no_like() -> None:
    depth = THERE.depth.copy()
    depth[20:60, 30:70] *= 0.8
    hidden = np.zeros((SIZE, SIZE), bool)
    hidden[20:60, 30:70] = True
    before, after = correspond(HERE, THERE), correspond(HERE, View(camera=THERE.camera, depth=depth,
                                                                   inside=THERE.inside))
    assert (before.pixels >= after.pixels).all()
    landed = np.zeros((SIZE, SIZE), bool)
    landed.ravel()[after.corners] = True
    assert not (landed & hidden).any() and after.pixels.sum() < before.pixels.sum() - 0.5 * hidden.sum()
    assert np.abs(after.here(painted(HERE)) - after.there(painted(THERE))).max() < 4e-3


def test_only_what_counts_in_both_has_a_like() -> None:
    left = np.arange(SIZE) < SIZE // 2
    cut = View(camera=THERE.camera, depth=THERE.depth, inside=THERE.inside & left)
    both = correspond(View(camera=HERE.camera, depth=HERE.depth, inside=HERE.inside & ~left), cut)
    assert not (both.pixels & left).any() and (both.corners % SIZE < SIZE // 2).all()
    nothing = correspond(HERE, View(camera=THERE.camera, depth=THERE.depth, inside=np.zeros((SIZE, SIZE), bool)))
    assert not nothing.pixels.any() and nothing.there(painted(THERE)).shape == (0, 3)


def test_what_is_behind_the_other_camera_has_no_like() -> None:
    away = Pinhole(position=np.array([0.5, -3.0, 1.2]), target=np.array([1.0, -9.0, 1.2]), fov=40.0, width=SIZE,
                   height=SIZE)
    assert not correspond(HERE, View(camera=away, depth=THERE.depth, inside=THERE.inside)).pixels.any()
