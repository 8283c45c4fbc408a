"""Materials on the device, and what they are at a point of a surface: face -> row of factors -> texels.

Fields of effects that a kernel leaves out are None, so that nothing of them is looked up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.assets.asset import HALF_STEP, Material
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface.nesting import Sides, body_rows, inside_of, sides_of
from dataset_builder.rendering.surface.texel_reader import TexelReader
from dataset_builder.rendering.surface.texels import FACTORS, needs, pack
from dataset_builder.rendering.surface.vertex_colours import VertexColours

QUADS = FACTORS // 4
"""Groups of four factors in a row."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Textures:
    """`MaterialArrays` on the device, for as many meshes as name these materials."""

    factors: mi.Float
    extents: mi.UInt32
    texels: mi.Float
    bodies: mi.Float
    """See `nesting.body_rows`."""
    needs: frozenset[str] = frozenset()
    """Features that they call for."""

    @classmethod
    def upload(cls, materials: Sequence[Material], texture_size: int | Sequence[int] = 4096,
               sky: float = 1.0) -> Textures:
        """Pack and copy; see `texels.pack`. Raises PlanError as that does."""
        arrays = pack(materials, texture_size, sky)
        return cls(factors=owned(mi.Float, arrays.factors), extents=owned(mi.UInt32, arrays.extents),
                   texels=owned(dr.float16_array_t(mi.Float), arrays.texels),
                   bodies=owned(mi.Float, body_rows(arrays.bodies)), needs=needs(materials))


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialTable:
    """The materials of one mesh."""

    textures: Textures
    face_material: mi.UInt32
    """Row of the material of each face."""
    vertices: VertexColours | None = None
    """None where all are white."""

    @property
    def needs(self) -> frozenset[str]:
        """Features that materials and vertices call for."""
        return self.textures.needs | (frozenset() if self.vertices is None else self.vertices.needs)


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
    body: mi.UInt32 | None = None
    """Number of the body of glass, 0 for none that knows others."""
    sides: Sides | None = None
    """What is on its other side."""
    emission: mi.Color3f | None = None
    """Radiance."""
    coverage: mi.Float | None = None
    """Share of the surface that is there."""


def look_up(table: MaterialTable, features: frozenset[str], si: mi.SurfaceInteraction3f,
            active: mi.Bool) -> SurfacePoint:
    """Material factors times texels at si.uv, times the colours of vertices."""
    row = dr.gather(mi.UInt32, table.face_material, si.prim_index, active)

    def quad(index: int) -> mi.Vector4f:
        return dr.gather(mi.Vector4f, table.textures.factors, QUADS * row + index, active)

    colour, scalar = quad(0), quad(1)
    point = SurfacePoint(base=mi.Color3f(colour.x, colour.y, colour.z), roughness=colour.w, metallic=scalar.x,
                         specular=scalar.y, normal=mi.Normal3f(0, 0, 1))
    alpha, texels = mi.Float(1), None
    if "textures" in features:
        texels = TexelReader(table.textures.extents, table.textures.texels, si.uv, row, "maps" in features, active)
        alpha = _multiply_texels(point, texels, si)
    if table.vertices is not None and "colours" in features:
        corner = table.vertices.at(si, active)
        point.base, alpha = point.base * mi.Color3f(corner.x, corner.y, corner.z), alpha * corner.w
    if "coat" in features:
        point.coat, point.coat_roughness = scalar.z, scalar.w
    if "sheen" in features:
        fibres = quad(2)
        point.sheen, point.sheen_roughness = mi.Color3f(fibres.x, fibres.y, fibres.z), fibres.w
    if features & {"glass", "thin"}:
        glass = quad(3)
        point.transmission, point.ior, point.thin, point.abbe = glass.x, glass.y, glass.z, glass.w
    if "nested" in features:
        point.body = mi.UInt32(quad(5).y)
        point.sides = sides_of(table.textures.bodies, point.body, inside_of(si.time), is_outside(si))
    if features & {"emission", "coverage"}:
        own = quad(4)
        point.emission = mi.Color3f(own.x, own.y, own.z) if "emission" in features else None
        point.coverage = _coverage(alpha * own.w, quad(5).x) if "coverage" in features else None
    if texels is not None and "maps" in features:
        _multiply_more(point, texels)
    return point


def is_outside(si: mi.SurfaceInteraction3f) -> mi.Bool:
    """Whether the viewer is on the outer side of a body."""
    return dr.dot(si.to_world(si.wi), si.n) > 0


def _coverage(alpha: mi.Float, cutoff: mi.Float) -> mi.Float:
    """Alpha, or whether it reaches the cutoff where there is one.

    Weights of interpolation add up to a hair more or less than 1; what is whole must stay whole, or light leaks.
    """
    whole = alpha > 1 - HALF_STEP / 2
    return dr.select(cutoff < 0, dr.select(whole, 1, alpha), dr.select(alpha >= cutoff, mi.Float(1), 0))


def _multiply_texels(point: SurfacePoint, texels: TexelReader, si: mi.SurfaceInteraction3f) -> mi.Float:
    """Multiply what every texture has; alpha is returned."""
    low, high = texels.plane(0)
    point.base = point.base * mi.Color3f(low.x, low.y, low.z)
    point.roughness, point.metallic = point.roughness * low.w, point.metallic * high.x
    slope = mi.Vector2f(high.y, high.z)
    tilt = mi.Normal3f(slope.x, _handedness(si) * slope.y, dr.safe_sqrt(1 - dr.squared_norm(slope)))
    point.normal = dr.normalize(tilt)
    return high.w


def _multiply_more(point: SurfacePoint, texels: TexelReader) -> None:
    """Multiply what few textures have, of what the kernel has at all."""
    low, high = texels.plane(1)
    point.specular = point.specular * low.w
    if point.emission is not None:
        point.emission = point.emission * mi.Color3f(low.x, low.y, low.z)
    if point.transmission is not None:
        point.transmission = point.transmission * high.x
    if point.coat is not None:
        point.coat, point.coat_roughness = point.coat * high.y, point.coat_roughness * high.z
    if point.sheen is not None:
        colour, _ = texels.plane(2)
        point.sheen = point.sheen * mi.Color3f(colour.x, colour.y, colour.z)
        point.sheen_roughness = point.sheen_roughness * high.w


def _handedness(si: mi.SurfaceInteraction3f) -> mi.Float:
    """-1 where the texture is mirrored on the surface, so that its v axis runs against the shading frame's."""
    return dr.select(dr.dot(si.dp_dv, si.sh_frame.t) < 0, mi.Float(-1), mi.Float(1))
