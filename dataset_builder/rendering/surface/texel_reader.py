"""Texels at a point of a surface: where a texture repeats, is mirrored or ends, and what lies between its texels."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.texels import ALONG_V, CLAMP, MIRROR, MORE, NEAREST


class TexelReader:
    """Bilinear texels of one texture at one point. mapped: whether it may have more planes, ends and squares; else it
    repeats."""

    def __init__(self, extents: mi.UInt32, texels: mi.Float, uv: mi.Point2f, row: mi.UInt32, mapped: bool,
                 active: mi.Bool):
        self.texels, self.active = texels, active
        self.extent = dr.gather(mi.Vector4u, extents, row, active)
        width, height, how = self.extent.y, self.extent.z, self.extent.w
        x = uv.x * mi.Float(width) - 0.5
        y = (1 - uv.y) * mi.Float(height) - 0.5
        if mapped:
            # The middle of a texel is its own value
            x, y = (dr.select((how & NEAREST) != 0, dr.floor(at + 0.5), at) for at in (x, y))
        x0, y0 = dr.floor(x), dr.floor(y)
        if mapped:
            columns, lines = _ends(x0, width, how), _ends(y0, height, how >> ALONG_V)
        else:
            column, line = _wrap(x0, width), _wrap(y0, height)
            columns = column, dr.select(column + 1 == width, 0, column + 1)
            lines = line, dr.select(line + 1 == height, 0, line + 1)
        fx, fy = x - x0, y - y0
        weights = ((1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy)
        corners = ((columns[0], lines[0]), (columns[1], lines[0]), (columns[0], lines[1]), (columns[1], lines[1]))
        self.corners = [(i, j, weight) for (i, j), weight in zip(corners, weights, strict=True)]

    def plane(self, index: int) -> tuple[mi.Vector4f, mi.Vector4f]:
        """Eight interpolated channels of a plane as two vectors; of a plane that is not there, ones."""
        first, width, active = self.extent.x, self.extent.y, self.active
        if index:
            has = (self.extent.w & MORE) != 0
            first, active = first + index * width * self.extent.z, active & has
        low, high = mi.Vector4f(0), mi.Vector4f(0)
        for i, j, weight in self.corners:
            texel = 2 * (first + j * width + i)
            half4 = dr.float16_array_t(mi.Vector4f)
            low += weight * mi.Vector4f(dr.gather(half4, self.texels, texel, active))
            high += weight * mi.Vector4f(dr.gather(half4, self.texels, texel + 1, active))
        return (dr.select(has, low, 1), dr.select(has, high, 1)) if index else (low, high)


def _ends(first: mi.Float, size: mi.UInt32, how: mi.UInt32) -> tuple[mi.UInt32, mi.UInt32]:
    """Texels of a floored coordinate and of the next, as `how` says where the texture ends."""
    period = size << (how & MIRROR)
    last = mi.Float(size) - 1

    def texel(at: mi.Float) -> mi.UInt32:
        # Repeating twice the size and turning back mirrors; what repeats once has nothing to turn back
        at = dr.select((how & CLAMP) != 0, dr.clip(at, 0, last), at)
        folded = _wrap(at, period)
        return dr.minimum(folded, 2 * size - 1 - folded)

    return texel(first), texel(first + 1)


def _wrap(coordinate: mi.Float, size: mi.UInt32) -> mi.UInt32:
    """Integer texel of a floored coordinate, repeating; safe for negative and huge values."""
    share = coordinate / mi.Float(size)
    return dr.minimum(mi.UInt32((share - dr.floor(share)) * mi.Float(size) + 0.5), size - 1)
