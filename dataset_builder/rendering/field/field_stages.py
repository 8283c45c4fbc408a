"""The stages of a fit: a coarse grid first, then the one asked for, distances begun from density's surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dataset_builder.assets.field_file import CHANNELS
from dataset_builder.geometry.marching import solid
from dataset_builder.rendering.field.field_grid import resampled
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
RATE = 0.15
"""Of a stage, at first; it falls to a tenth."""
SHARPNESS = 1.5, 8.0
"""Of a distance field, from the begin of its fit to its end, per cell; see FieldModel."""
REACH = 4.0
"""Value of a distance, 12 UNITs from the surface, from which a cell is fitted."""
BEGUN = 0.2
"""Opacity of a cell that distances are begun from."""


@dataclass(frozen=True, kw_only=True)
class FitStage:
    """Steps on one grid."""

    kind: Kind
    resolution: int
    steps: int
    rate: float
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


def stages_of(kind: Kind, resolution: int, steps: int) -> tuple[FitStage, ...]:
    """The stages that `steps` are shared out to."""
    coarse = max(16, min(COARSE, resolution // 2))
    even, parts = Smoothness(variation=0.02), 3 if kind == "density" else 4
    first = FitStage(kind="density", resolution=coarse, steps=steps // parts, rate=RATE, smooth=even)
    if kind == "density":
        return first, FitStage(kind="density", resolution=resolution, steps=steps - first.steps, rate=RATE, smooth=even)
    second = FitStage(kind="density", resolution=resolution, steps=steps // parts, rate=RATE, smooth=even)
    low, high = (value * UNIT * resolution / 2 for value in SHARPNESS)
    third = FitStage(kind="sdf", resolution=resolution, steps=steps - first.steps - second.steps, rate=RATE,
                     smooth=Smoothness(eikonal=0.1, bend=0.3), sharpness=(low, high))
    return first, second, third


def first_begin(hull: np.ndarray) -> Begin:
    """An even haze in the hull (R, R, R)."""
    values = np.zeros((*hull.shape, CHANNELS), np.float32)
    values[hull] = (FIRST_DENSITY, FIRST_COLOUR, FIRST_COLOUR, FIRST_COLOUR)
    return Begin(values=values, active=inner(hull), occupied=hull, optical=np.zeros(hull.shape))


def next_begin(stage: FitStage, before: np.ndarray, hull: np.ndarray) -> Begin:
    """What a stage takes over of the values (S, S, S, 4) of density that the one before it ended with."""
    hull = enlarged(hull, len(before))
    optical = np.logaddexp(0, GAIN * before[..., 0] + SHIFT) * (before[..., 0] > 0)
    busy = ndimage.binary_dilation(optical > BUSY, np.ones((3, 3, 3), dtype=bool)) & hull
    if stage.kind == "sdf":
        before = as_distance(before)
        busy = (before[..., 0] > REACH) & hull
        optical = np.where(before[..., 0] > OUTSIDE, 1.0, 0.0)
    fine = enlarged(busy, stage.resolution)
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


def enlarged(cells: np.ndarray, side: int) -> np.ndarray:
    """(side, side, side) of an array (S, S, S): each cell as the one of those that its middle lies in."""
    nearest = ((np.arange(side) + 0.5) * (len(cells) / side)).astype(int)
    return cells[np.ix_(nearest, nearest, nearest)]


def inner(cells: np.ndarray) -> np.ndarray:
    """(R, R, R) bool without the outermost cells, whose neighbours are not all there."""
    found = np.zeros_like(cells)
    found[1:-1, 1:-1, 1:-1] = cells[1:-1, 1:-1, 1:-1]
    return found
