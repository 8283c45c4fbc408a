"""The stages of a fit: a coarse grid first, then the one asked for, distances begun from density's surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dataset_builder.geometry.marching import solid
from dataset_builder.rendering.field.field_grid import CHANNELS, resampled
from dataset_builder.rendering.field.field_mesh import density_of
from dataset_builder.rendering.field.field_model import (
    FIRST_COLOUR,
    FIRST_DENSITY,
    GAIN,
    OUTSIDE,
    SHIFT,
    UNIT,
    Kind,
)
from dataset_builder.rendering.field.field_step import Smoothness

COARSE = 64
"""Most cells along a side of the first grid."""
BUSY = 0.05
"""Optical depth of a coarse cell from which it holds something."""
REACH = 4.0
"""Value of a distance, 12 UNITs from the surface, from which a cell is fitted."""
BEGUN = 0.2
"""Opacity of a cell that distances are begun from."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Steps on one grid."""

    kind: Kind
    resolution: int
    steps: int
    rate: float
    """Of the first channel and of colour, at first; it falls to a tenth."""
    smooth: Smoothness
    sharpness: tuple[float, float] = (1.0, 1.0)
    """At its begin and at its end; see FieldModel."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Begin:
    """What a stage begins with."""

    values: np.ndarray
    """(R, R, R, 4)."""
    active: np.ndarray
    """(R, R, R) bool: cells that are fitted."""
    occupied: np.ndarray
    """(S, S, S) bool: cells that rays have to pass."""
    optical: np.ndarray
    """(S, S, S) optical depth of these cells."""


def stages_of(kind: Kind, resolution: int, steps: int) -> tuple[Stage, ...]:
    """The stages that `steps` are shared out to."""
    coarse = max(16, min(COARSE, resolution // 2))
    first = Stage(kind="density", resolution=coarse, steps=steps // 3, rate=0.15, smooth=Smoothness(variation=0.02))
    rest = steps - first.steps
    if kind == "density":
        return (first, Stage(kind="density", resolution=resolution, steps=rest, rate=0.15,
                             smooth=Smoothness(variation=0.02)))
    smooth = Smoothness(eikonal=0.02, bend=0.02)
    return (first, Stage(kind="sdf", resolution=resolution, steps=rest, rate=0.15, smooth=smooth,
                         sharpness=(0.75, 6.0)))


def first_begin(hull: np.ndarray) -> Begin:
    """An even haze in the hull (R, R, R)."""
    values = np.zeros((*hull.shape, CHANNELS), np.float32)
    values[hull] = (FIRST_DENSITY, FIRST_COLOUR, FIRST_COLOUR, FIRST_COLOUR)
    return Begin(values=values, active=inner(hull), occupied=hull, optical=np.zeros(hull.shape))


def next_begin(stage: Stage, before: np.ndarray, hull: np.ndarray) -> Begin:
    """What a stage takes over of the values (S, S, S, 4) of density that the one before it ended with."""
    optical = np.logaddexp(0, GAIN * before[..., 0] + SHIFT) * (before[..., 0] > 0)
    busy = ndimage.binary_dilation(optical > BUSY, np.ones((3, 3, 3), dtype=bool)) & hull
    if stage.kind == "sdf":
        before = as_distance(before)
        busy = (before[..., 0] > REACH) & hull
        optical = np.where(before[..., 0] > OUTSIDE, 1.0, 0.0)
    nearest = ((np.arange(stage.resolution) + 0.5) * (len(before) / stage.resolution)).astype(int)
    fine = busy[np.ix_(nearest, nearest, nearest)]
    return Begin(values=resampled(before, stage.resolution), active=inner(fine), occupied=busy, optical=optical)


def as_distance(density: np.ndarray) -> np.ndarray:
    """Values of a distance field (S, S, S, 4) whose surface is density's; colours stay."""
    inside = solid(density[..., 0], density_of(BEGUN)) >= density_of(BEGUN)
    deep = ndimage.distance_transform_edt(inside) - ndimage.distance_transform_edt(~inside)
    # Distances of middles from middles of the other kind: the surface lies halfway
    cells = np.where(inside, deep - 0.5, deep + 0.5)
    smooth = ndimage.gaussian_filter(cells, 0.7) * (2 / len(density) / UNIT)
    out = density.copy()
    out[..., 0] = OUTSIDE + np.clip(smooth, -OUTSIDE, OUTSIDE)
    return out


def inner(cells: np.ndarray) -> np.ndarray:
    """(R, R, R) bool without the outermost cells, whose neighbours are not all there."""
    found = np.zeros_like(cells)
    found[1:-1, 1:-1, 1:-1] = cells[1:-1, 1:-1, 1:-1]
    return found
