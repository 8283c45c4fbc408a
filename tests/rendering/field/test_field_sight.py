"""What images see of a hollow box, with and without a hole in its side, and what is solid therefore."""

import numpy as np
import pytest

from dataset_builder.geometry.marching import level_mesh, solid
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field.field_sight import seen_cells

SIDE, LOW, HIGH = 40, 10, 30
"""Cells of the grid, and the first and last that the box takes along each axis."""


def box(hole: int) -> np.ndarray:
    """Optical depths of a box with walls of two cells, and a square hole in one of them."""
    optical = np.zeros((SIDE,) * 3)
    optical[LOW:HIGH, LOW:HIGH, LOW:HIGH] = 5
    optical[LOW + 2:HIGH - 2, LOW + 2:HIGH - 2, LOW + 2:HIGH - 2] = 0
    middle = slice(SIDE // 2 - hole // 2, SIDE // 2 + hole - hole // 2)
    optical[HIGH - 2:HIGH, middle, middle] = 0
    return optical


def from_all_sides(count: int = 40) -> PosedImages:
    k = np.arange(count) + 0.5
    height = 1 - 2 * k / count
    ways = np.stack([np.sqrt(1 - height**2) * np.cos(2.4 * k), np.sqrt(1 - height**2) * np.sin(2.4 * k), height], 1)
    poses = np.tile(np.eye(4), (count, 1, 1))
    for pose, way in zip(poses, ways, strict=True):
        right = np.cross(way, [0.3, 0.5, 0.8])
        right /= np.linalg.norm(right)
        pose[:3, :4] = np.stack([right, np.cross(-way, right), -way, 4 * way], axis=1)
    return PosedImages(pixels=np.zeros((count, 64, 64, 4), np.float32), poses=poses,
                       focal=np.full((count, 2), 70.0), centre=np.full((count, 2), 32.0))


def looked_at(optical: np.ndarray) -> np.ndarray:
    images = from_all_sides()
    return seen_cells(optical, images, np.arange(len(images.pixels)), centre=np.zeros(3), radius=1.0)


@pytest.mark.parametrize("hole", [0, 4])
def test_the_inside_is_not_seen_and_the_outside_is(hole: int) -> None:
    seen = looked_at(box(hole))
    inside = seen[LOW + 3:HIGH - 3, LOW + 3:HIGH - 3, LOW + 3:HIGH - 3]
    assert inside.mean() <= (0.12 if hole else 0)
    around = np.ones((SIDE,) * 3, bool)
    around[LOW:HIGH, LOW:HIGH, LOW:HIGH] = False
    # The corners of the grid are out of every picture
    around &= np.linalg.norm(np.stack(np.mgrid[:SIDE, :SIDE, :SIDE]) - SIDE / 2 + 0.5, axis=0) < SIDE / 2
    assert seen[around].all()


def test_what_is_not_seen_is_solid() -> None:
    """A box of 20 cells, whose hole a cube of three passes: by itself it is a bowl."""
    optical = box(4)
    values = np.where(optical > 0, 1.0, 0.0)
    whole = float((HIGH - LOW) ** 3)
    bowl, filled = (level_mesh(solid(values, 0.5, *seen), 0.5) for seen in ((), (looked_at(optical),)))
    assert bowl is not None and filled is not None
    assert bowl.volume < 0.5 * whole and filled.volume > 0.93 * whole


def test_a_wide_mouth_stays_open() -> None:
    """A box without its lid is a bowl, and seen as one."""
    optical = box(SIDE)
    seen = looked_at(optical)
    assert seen[LOW + 3:HIGH, LOW + 3:HIGH - 3, LOW + 3:HIGH - 3].mean() > 0.9


def test_blocks_stand_for_their_cells() -> None:
    fine = box(0).repeat(4, 0).repeat(4, 1).repeat(4, 2)
    seen = looked_at(fine)
    assert seen.shape == fine.shape and not seen[72:88, 72:88, 72:88].any() and seen[:30, 70:90, 70:90].all()
