"""What rays see of a fitted field."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import ndimage

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_grid import dense_corners
from dataset_builder.rendering.field.field_model import OUTSIDE, FieldModel, Kind, radiance
from dataset_builder.rendering.field.field_rays import ball_span
from dataset_builder.rendering.field.looks import Look

STEP = 0.75
"""Of a ray where something is, cells."""
BLOCK = 4
"""Cells along the side of a block that is known to be empty or not."""
LEFT = 1e-4
"""Transmittance at which a ray ends."""
THIN = {"density": 1.0, "sdf": OUTSIDE - 6}
"""Value of a cell up to which it counts as empty: an optical depth of 1e-4, or 6 UNITs from a surface."""


@dataclass(kw_only=True, eq=False)
class _SeenGrid:
    """A grid on the device."""

    model: FieldModel
    grid: mi.Float
    side: mi.UInt32
    empty: mi.Float
    """See `empty_blocks`."""
    blocks: mi.UInt32
    """Along a side."""


def grid_look(file: FieldFile) -> Look:
    """How rays see a field that is a grid. One kernel serves all fields of a kind."""
    assert file.grid is not None and file.record.kind != "splats"
    side = dr.opaque(mi.UInt32, len(file.grid))
    sharpness = dr.opaque(mi.Float, file.numbers.get("sharpness", 1.0))
    empty = owned(mi.Float, empty_blocks(file.grid[..., 0], file.record.kind))
    seen = _SeenGrid(model=FieldModel(kind=file.record.kind, cell=2 / mi.Float(side), sharpness=sharpness),
                     grid=owned(mi.Float, file.grid), side=side, empty=empty,
                     blocks=dr.opaque(mi.UInt32, -(-len(file.grid) // BLOCK)))
    scale, radius = dr.opaque(mi.Float, file.numbers["scale"]), dr.opaque(mi.Float, file.radius)
    centre = mi.Point3f(*(dr.opaque(mi.Float, value) for value in file.centre))

    def look(origin: mi.Point3f, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
        colour, opacity = _gathered(seen, mi.Point3f((origin - centre) / radius), mi.Vector3f(direction), active)
        return colour * scale, opacity

    return look


@dr.syntax
def _gathered(seen: _SeenGrid, o: mi.Point3f, d: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
    """Radiance and opacity of rays in the unit frame."""
    cell, blocks = seen.model.cell, seen.blocks
    t, end = ball_span(o, d)
    step, limit = STEP * cell, -np.log(LEFT)
    depth, colour = mi.Float(0), mi.Color3f(0)
    # Middles of steps
    t += 0.5 * step
    going = active & (t < end)
    while going:
        point = o + t * d
        block = mi.Vector3u(dr.clip((point * 0.5 + 0.5) * (mi.Float(seen.side) / BLOCK), 0, mi.Float(blocks) - 1))
        free = dr.gather(mi.Float, seen.empty, (block.z * blocks + block.y) * blocks + block.x)
        if free > 0:
            # So many blocks about this one are empty
            t += dr.maximum(free - 1, 0) * (BLOCK * cell) + step
        else:
            corners = dense_corners(seen.grid, seen.side, point, mi.Bool(True))
            value = corners.value()
            optical = seen.model.optical(corners, value, d, step)
            colour += dr.exp(-depth) * (1 - dr.exp(-optical)) * radiance(value)
            depth += optical
            t += step
        going &= (t < end) & (depth < limit)
    return colour, 1 - dr.exp(-depth)


def empty_blocks(values: np.ndarray, kind: Kind) -> np.ndarray:
    """(B^3,) float32, distance of each block of cells from the next that is not empty, in blocks along the longest
    axis; 0 for one that is not. A block that a point between cells may draw on counts for its neighbours."""
    side = -(-len(values) // BLOCK) * BLOCK
    full = np.zeros((side,) * 3, dtype=bool)
    full[:len(values), :len(values), :len(values)] = values > THIN[kind]
    full = ndimage.binary_dilation(full, np.ones((3, 3, 3), dtype=bool))
    n = side // BLOCK
    some = full.reshape(n, BLOCK, n, BLOCK, n, BLOCK).any(axis=(1, 3, 5))
    if not some.any():
        return np.full(n**3, 2.0 * n, np.float32)
    return ndimage.distance_transform_cdt(~some, metric="chessboard").astype(np.float32).ravel()
