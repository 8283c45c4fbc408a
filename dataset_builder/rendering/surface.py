"""The surface of everything in a scene: one Mitsuba BSDF plugin that looks its material up by triangle.

A scene is one mesh with one BSDF, whatever it holds: face -> material row -> texels. The kernel that Dr.Jit compiles
for it is therefore the same for every scene, so it is compiled once and found in the cache ever after
(`docs/design.md`).

The model is metallic-roughness: f = f_d + f_s with
    f_s = F D G / (4 cos cos), GGX with Schlick's Fresnel term, F0 = mix(specular, base_color, metallic),
    f_d = base_color (1 - metallic) (1 - E(wi)) / pi,
where E is the directional reflectance of f_s seen from wi. Scaling the base by what the layer above leaves over, from
the viewer's side alone, is the albedo scaling of OpenPBR and of Cycles. It makes f_d Lambertian in the other direction,
so that outgoing radiance is exactly D * S + specular part with D = pi f_d and R = E, and D + R <= 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.assets.asset import Material
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.first_hit import FirstHit, cosine_direction, white_lambert
from dataset_builder.rendering.lobes import Lobes, evaluate, sample
from dataset_builder.rendering.reflectance import COSINES, MIN_ALPHA, ROUGHNESSES, split_sum_table
from dataset_builder.rendering.texels import pack

PLUGIN = "threedf_surface"


@dataclass(frozen=True, kw_only=True, eq=False)
class Textures:
    """`MaterialArrays` on the device, for as many meshes as name these materials."""

    factors: mi.Float
    extents: mi.UInt32
    texels: mi.Float

    @classmethod
    def upload(cls, materials: Sequence[Material]) -> "Textures":
        """Pack and copy."""
        arrays = pack(materials)
        return cls(factors=owned(mi.Float, arrays.factors), extents=owned(mi.UInt32, arrays.extents),
                   texels=owned(dr.float16_array_t(mi.Float), arrays.texels))


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialTable:
    """Materials, and the row of the material of each face of one mesh."""

    textures: Textures
    face_material: mi.UInt32


class Surface(mi.BSDF):
    """Two-sided metallic-roughness surfaces of one merged mesh; `bind` the arrays before use."""

    def __init__(self, props: mi.Properties):
        mi.BSDF.__init__(self, props)
        glossy = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        diffuse = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [diffuse, glossy]
        self.m_flags = diffuse | glossy
        self.split_sum = owned(mi.Float, split_sum_table())

    def bind(self, table: MaterialTable) -> None:
        """Take the materials of the mesh that is rendered next."""
        self.table = table

    # Layers of the first hit

    def first_hit(self, si: mi.SurfaceInteraction3f, light: mi.Vector3f, take_cosine: mi.Bool, sample1: mi.Float,
                  sample2: mi.Point2f, active: mi.Bool) -> FirstHit:
        """See `first_hit.FirstHit`; one look at the textures."""
        lobes = self._lobes(si, active)
        bs, _ = sample(lobes, si, sample1, sample2, active & ~take_cosine)
        wo = dr.select(take_cosine, cosine_direction(lobes.normal, sample2), bs.wo)
        em_value, em_density = evaluate(lobes, si, light)
        value, density = evaluate(lobes, si, wo)
        return FirstHit(diffuse=lobes.diffuse, em_value=em_value, em_density=em_density,
                        em_cosine=white_lambert(lobes.normal, si, light), wo=wo, value=value, density=density,
                        cosine=white_lambert(lobes.normal, si, wo))

    def reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, mi.Normal3f]:
        """(D, R, local shading normal) at a surface point."""
        lobes = self._lobes(si, active)
        return lobes.diffuse, lobes.specular, lobes.normal

    def eval_diffuse_reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """D: integral of f_d cos over the hemisphere, seen from si.wi."""
        return dr.select(active, self._lobes(si, active).diffuse, 0)

    # Scattering

    def eval(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """f cos, both lobes."""
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool) -> mi.Float:
        """Solid-angle density of `sample`."""
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f,
                 active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
        """f cos and the density of `sample`."""
        value, density = evaluate(self._lobes(si, active), si, wo)
        return dr.select(active, value, 0), dr.select(active, density, 0)

    def sample(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
               active: mi.Bool) -> tuple[mi.BSDFSample3f, mi.Color3f]:
        """A direction of the diffuse or the GGX lobe, picked in proportion to their reflectance."""
        return sample(self._lobes(si, active), si, sample1, sample2, active)

    def eval_pdf_sample(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, sample1: mi.Float,
                        sample2: mi.Point2f,
                        active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.BSDFSample3f, mi.Color3f]:
        """`eval_pdf` and `sample` at once, as path integrators ask."""
        lobes = self._lobes(si, active)
        value, density = evaluate(lobes, si, wo)
        return (dr.select(active, value, 0), dr.select(active, density, 0),
                *sample(lobes, si, sample1, sample2, active))

    def _lobes(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Lobes:
        """The two lobes at a surface point."""
        base, roughness, metallic, reflectance, normal = self._texels(si, active)
        viewer = dr.sign(mi.Frame3f.cos_theta(si.wi))
        normal = _facing(normal, viewer, si.wi)
        f0 = dr.lerp(mi.Color3f(reflectance), base, metallic)
        f90 = dr.minimum(dr.max(f0) * 50, 1)
        a, b = self._split_sum(dr.abs(dr.dot(si.wi, normal)), roughness, active)
        specular = f0 * a + f90 * b
        diffuse = base * (1 - metallic) * (1 - specular)
        return Lobes(diffuse=diffuse, specular=specular, f0=f0, f90=f90, normal=normal,
                     alpha=dr.maximum(roughness * roughness, MIN_ALPHA))

    def _texels(self, si: mi.SurfaceInteraction3f,
                active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.Float, mi.Float, mi.Normal3f]:
        """Material factors times bilinearly interpolated texels, repeating, at si.uv."""
        row = dr.gather(mi.UInt32, self.table.face_material, si.prim_index, active)
        colour = dr.gather(mi.Vector4f, self.table.textures.factors, 2 * row, active)
        scalar = dr.gather(mi.Vector4f, self.table.textures.factors, 2 * row + 1, active)
        extent = dr.gather(mi.Vector4u, self.table.textures.extents, row, active)
        low, high = self._bilinear(si.uv, extent, active)
        base = mi.Color3f(colour.x, colour.y, colour.z) * mi.Color3f(low.x, low.y, low.z)
        slope = mi.Vector2f(high.y, high.z)
        tilt = mi.Normal3f(slope.x, _handedness(si) * slope.y, dr.safe_sqrt(1 - dr.squared_norm(slope)))
        return base, colour.w * low.w, scalar.x * high.x, scalar.y, dr.normalize(tilt)

    def _bilinear(self, uv: mi.Point2f, extent: mi.Vector4u, active: mi.Bool) -> tuple[mi.Vector4f, mi.Vector4f]:
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
            low += weight * mi.Vector4f(dr.gather(half4, self.table.textures.texels, texel, active))
            high += weight * mi.Vector4f(dr.gather(half4, self.table.textures.texels, texel + 1, active))
        return low, high

    def _split_sum(self, cosine: mi.Float, roughness: mi.Float, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        """A and B of `reflectance.split_sum_table`, bilinear."""
        x = dr.clip(cosine, 0, 1) * (COSINES - 1)
        y = dr.clip(roughness, 0, 1) * (ROUGHNESSES - 1)
        column = dr.minimum(mi.UInt32(x), COSINES - 2)
        line = dr.minimum(mi.UInt32(y), ROUGHNESSES - 2)
        fx, fy = x - mi.Float(column), y - mi.Float(line)
        first = line * COSINES + column
        steps = (0, 1, COSINES, COSINES + 1)
        corners = [dr.gather(mi.Vector2f, self.split_sum, first + step, active) for step in steps]
        low, high = dr.lerp(corners[0], corners[1], fx), dr.lerp(corners[2], corners[3], fx)
        both = dr.lerp(low, high, fy)
        return both.x, both.y

    def to_string(self) -> str:
        """One line for logs."""
        return "Surface[]"


def _wrap(coordinate: mi.Float, size: mi.UInt32) -> mi.UInt32:
    """Integer texel of a floored coordinate, repeating; safe for negative and huge values."""
    share = coordinate / mi.Float(size)
    return dr.minimum(mi.UInt32((share - dr.floor(share)) * mi.Float(size) + 0.5), size - 1)


def _handedness(si: mi.SurfaceInteraction3f) -> mi.Float:
    """-1 where the texture is mirrored on the surface, so that its v axis runs against the shading frame's."""
    return dr.select(dr.dot(si.dp_dv, si.sh_frame.t) < 0, mi.Float(-1), mi.Float(1))


def _facing(normal: mi.Normal3f, viewer: mi.Float, wi: mi.Vector3f) -> mi.Normal3f:
    """The normal on the viewer's side; the unperturbed one where a normal map would tilt it out of sight."""
    turned = mi.Normal3f(normal.x, normal.y, normal.z * viewer)
    return dr.select(dr.dot(turned, wi) > 1e-3, turned, mi.Normal3f(0, 0, viewer))


def register() -> None:
    """Make the plugin known to Mitsuba under `PLUGIN`; once per variant."""
    mi.register_bsdf(PLUGIN, lambda props: Surface(props))
