"""Grids of four channels over [-1, 1]^3: what a field stores, and how it is looked up between cells."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.assets.field_file import CHANNELS
from dataset_builder.rendering.buffers import owned


@dataclass(kw_only=True, eq=False)
class Corners:
    """The eight cells about each point, by their bits x, y, z."""

    values: list[mi.Vector4f]
    fraction: mi.Vector3f
    """Where the point lies between their middles."""

    def value(self) -> mi.Vector4f:
        """Interpolated between the middles of cells."""
        f = self.fraction
        rows = [dr.lerp(self.values[k], self.values[k + 1], f.x) for k in (0, 2, 4, 6)]
        return dr.lerp(dr.lerp(rows[0], rows[1], f.y), dr.lerp(rows[2], rows[3], f.y), f.z)

    def gradient(self) -> mi.Vector3f:
        """Of the first channel as it is interpolated, per cell."""
        v, f = [value.x for value in self.values], self.fraction
        slopes = []
        for axis, (one, other) in enumerate(((1, 2), (0, 2), (0, 1))):
            a, b = f[one], f[other]
            step = [v[k | (1 << axis)] - v[k] for k in (0, 1 << one, 1 << other, (1 << one) | (1 << other))]
            slopes.append(dr.lerp(dr.lerp(step[0], step[1], a), dr.lerp(step[2], step[3], a), b))
        return mi.Vector3f(*slopes)


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldGrid:
    """Which cells have a row in a table of values, on the device."""

    active: np.ndarray
    """(R, R, R) bool by z, y, x."""
    rows: mi.UInt32
    """Row of each cell plus 1, 0 for none."""
    cells: mi.UInt32
    """Cell of each row."""
    side: mi.UInt32
    """R."""

    @classmethod
    def of(cls, active: np.ndarray) -> FieldGrid:
        """A grid whose rows are in the order of cells."""
        cells = np.flatnonzero(active.ravel())
        rows = np.zeros(active.size, np.uint32)
        rows[cells] = np.arange(1, len(cells) + 1, dtype=np.uint32)
        return cls(active=active, rows=owned(mi.UInt32, rows), cells=owned(mi.UInt32, cells.astype(np.uint32)),
                   side=dr.opaque(mi.UInt32, len(active)))

    def corners(self, table: mi.Float, point: mi.Point3f, active: mi.Bool) -> Corners:
        """Values of the cells about points; points outside of the outermost middles have those of the border."""
        at, first = place(point, self.side)
        values = []
        for k in range(8):
            row = dr.gather(mi.UInt32, self.rows, first + cell_offset(k, self.side), active)
            values.append(dr.gather(mi.Vector4f, table, row - 1, active & (row > 0)))
        return Corners(values=values, fraction=at)

    def dense(self, table: np.ndarray) -> np.ndarray:
        """(R, R, R, 4) of a table's (V, 4) values."""
        full = np.zeros((*self.active.shape, CHANNELS), np.float32)
        full[self.active] = table
        return full


def dense_corners(grid: mi.Float, side: mi.UInt32, point: mi.Point3f, active: mi.Bool) -> Corners:
    """`FieldGrid.corners` of a grid in which every cell has its values."""
    at, first = place(point, side)
    return Corners(values=[dr.gather(mi.Vector4f, grid, first + cell_offset(k, side), active) for k in range(8)],
                   fraction=at)


def place(point: mi.Point3f, side: mi.UInt32) -> tuple[mi.Vector3f, mi.UInt32]:
    """Where points lie between the middles of eight cells, and the first of these cells."""
    at = mi.Vector3f(dr.clip((point * 0.5 + 0.5) * mi.Float(side) - 0.5, 0, mi.Float(side) - 1))
    low = dr.minimum(mi.Vector3u(at), side - 2)
    return at - mi.Vector3f(low), (low.z * side + low.y) * side + low.x


def cell_offset(corner: int, side: mi.UInt32) -> mi.UInt32:
    """From the first of eight cells to the one of bits x, y, z."""
    found = mi.UInt32(corner & 1)
    if corner & 2:
        found += side
    if corner & 4:
        found += side * side
    return found


def resampled(grid: np.ndarray, side: int) -> np.ndarray:
    """(side, side, side, C) of a grid (R, R, R, C), interpolated between the middles of cells."""
    for axis in range(3):
        at = np.clip((np.arange(side) + 0.5) * (grid.shape[axis] / side) - 0.5, 0, grid.shape[axis] - 1)
        low = np.minimum(at.astype(int), grid.shape[axis] - 2)
        share = (at - low).astype(np.float32).reshape([-1 if k == axis else 1 for k in range(4)])
        grid = np.take(grid, low, axis) * (1 - share) + np.take(grid, low + 1, axis) * share
    return grid
