"""Materials on the device, and what they are at a point of a surface: face -> row of factors -> texels.

Fields of effects that a kernel leaves out are None, so that nothing of them is looked up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface.texels import needs, pack

QUADS = 4
"""Groups of four factors in a row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Textures:
    """`MaterialArrays` on the device, for as many meshes as name these materials."""

    factors: mi.Float
    extents: mi.UInt32
    texels: mi.Float
    needs: frozenset[str] = frozenset()
    """Features that they call for."""

    @classmethod
    def upload(cls, materials: Sequence[Material], texture_size: int = 4096) -> Textures:
        """Pack and copy; sides of textures are limited to `texture_size`. Raises PlanError as `texels.pack` does."""
        arrays = pack(materials, texture_size)
        return cls(factors=owned(mi.Float, arrays.factors), extents=owned(mi.UInt32, arrays.extents),
                   texels=owned(dr.float16_array_t(mi.Float), arrays.texels), needs=needs(materials))


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialTable:
    """The materials of one mesh."""

    textures: Textures
    face_material: mi.UInt32
    """Row of the material of each face."""


@dataclass
class SurfacePoint:
    """A material at a point."""

    base: mi.Color3f
    roughness: mi.Float
    metallic: mi.Float
    specular: mi.Float
    normal: mi.Normal3f
    """Local, on the front side."""
    coat: mi.Float | None = None
    coat_roughness: mi.Float | None = None
    sheen: mi.Color3f | None = None
    sheen_roughness: mi.Float | None = None
    transmission: mi.Float | None = None
    ior: mi.Float | None = None
    thin: mi.Float | None = None
    """1 for panes, else 0."""
    abbe: mi.Float | None = None


def look_up(table: MaterialTable, features: frozenset[str], si: mi.SurfaceInteraction3f,
            active: mi.Bool) -> SurfacePoint:
    """Material factors times bilinearly interpolated texels, repeating, at si.uv."""
    row = dr.gather(mi.UInt32, table.face_material, si.prim_index, active)

    def quad(index: int) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, table.textures.factors, QUADS * row + index, active)

    colour, scalar = quad(0), quad(1)
    point = SurfacePoint(base=mi.Color3f(colour.x, colour.y, colour.z), roughness=colour.w, metallic=scalar.x,
                         specular=scalar.y, normal=mi.Normal3f(0, 0, 1))
    if "textures" in features:
        _multiply_texels(point, table.textures, si, row, active)
    if "coat" in features:
        point.coat, point.coat_roughness = scalar.z, scalar.w
    if "sheen" in features:
        fibres = quad(2)
        point.sheen, point.sheen_roughness = mi.Color3f(fibres.x, fibres.y, fibres.z), fibres.w
    if features & {"glass", "thin"}:
        glass = quad(3)
        point.transmission, point.ior, point.thin, point.abbe = glass.x, glass.y, glass.z, glass.w
    return point


def _multiply_texels(point: SurfacePoint, textures: Textures, si: mi.SurfaceInteraction3f, row: mi.UInt32,
                     active: mi.Bool) -> None:
    extent = dr.gather(mi.Vector4u, textures.extents, row, active)
    low, high = _bilinear(textures, si.uv, extent, active)
    point.base = point.base * mi.Color3f(low.x, low.y, low.z)
    point.roughness, point.metallic = point.roughness * low.w, point.metallic * high.x
    slope = mi.Vector2f(high.y, high.z)
    tilt = mi.Normal3f(slope.x, _handedness(si) * slope.y, dr.safe_sqrt(1 - dr.squared_norm(slope)))
    point.normal = dr.normalize(tilt)


def _bilinear(textures: Textures, uv: mi.Point2f, extent: mi.Vector4u,
              active: mi.Bool) -> tuple[mi.Vector4f, mi.Vector4f]:
    """Eight interpolated texel channels as two vectors. extent = (first texel, width, height, 0)."""
    width, height = extent.y, extent.z
    x = uv.x * mi.Float(width) - 0.5
    y = (1 - uv.y) * mi.Float(height) - 0.5
    x0, y0 = dr.floor(x), dr.floor(y)
    column, line = _wrap(x0, width), _wrap(y0, height)
    next_column = dr.select(column + 1 == width, 0, column + 1)
    next_line = dr.select(line + 1 == height, 0, line + 1)
    fx, fy = x - x0, y - y0
    low, high = mi.Vector4f(0), mi.Vector4f(0)
    for i, j, weight in ((column, line, (1 - fx) * (1 - fy)), (next_column, line, fx * (1 - fy)),
                         (column, next_line, (1 - fx) * fy), (next_column, next_line, fx * fy)):
        texel = 2 * (extent.x + j * width + i)
        half4 = dr.float16_array_t(mi.Vector4f)
        low += weight * mi.Vector4f(dr.gather(half4, textures.texels, texel, active))
        high += weight * mi.Vector4f(dr.gather(half4, textures.texels, texel + 1, active))
    return low, high


def _wrap(coordinate: mi.Float, size: mi.UInt32) -> mi.UInt32:
    """Integer texel of a floored coordinate, repeating; safe for negative and huge values."""
    share = coordinate / mi.Float(size)
    return dr.minimum(mi.UInt32((share - dr.floor(share)) * mi.Float(size) + 0.5), size - 1)


def _handedness(si: mi.SurfaceInteraction3f) -> mi.Float:
    """-1 where the texture is mirrored on the surface, so that its v axis runs against the shading frame's."""
    return dr.select(dr.dot(si.dp_dv, si.sh_frame.t) < 0, mi.Float(-1), mi.Float(1))
