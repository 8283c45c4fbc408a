"""The surface of everything in a scene: one Mitsuba BSDF plugin that looks its material up by triangle.

A scene is one mesh with one BSDF, whatever it holds: face -> material row -> texels. The kernel that Dr.Jit compiles
for it is therefore the same for every scene that calls for the same features, so it is compiled once and found in the
cache ever after (`docs/design.md`). What the surface is, is told in `docs/materials.md`: `layering` says what each
layer weighs, `lobes`, `glass` and `sheen` what it does, `material_table` where its numbers come from.
"""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import drjit as dr
import mitsuba as mi

from dataset_builder.label.example_plan import Feature
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface import lobes as scattering
from dataset_builder.rendering.surface.first_hit import (
    FirstHit,
    Towards,
    cosine_direction,
    mixture_pdf,
    white_lambert,
)
from dataset_builder.rendering.surface.glass import alike
from dataset_builder.rendering.surface.later_hit import LightBounce, VertexHit, bounced, scattered, seen_from
from dataset_builder.rendering.surface.layering import Reflectances, lobes_of
from dataset_builder.rendering.surface.lobes import Lobes
from dataset_builder.rendering.surface.material_table import MaterialTable, look_up
from dataset_builder.rendering.surface.reflectance import interpolated, split_sum_table
from dataset_builder.rendering.surface.sheen import sheen_table

PLUGIN = "threedf_surface"
PLAIN_SHARE = 0.1
"""Probability of a cosine lobe about the geometric normal for light that a surface sends on."""
FEATURES = frozenset(get_args(Feature)) - {"fog"}
"""Everything a surface can be compiled with."""


class Surface:
    """Two-sided surfaces of one merged mesh; `bind` the arrays before use. `plugins` makes a BSDF of it."""

    def __init__(self, props: mi.Properties):
        mi.BSDF.__init__(self, props)
        self.split_sum = owned(mi.Float, split_sum_table())
        self.sheen = owned(mi.Float, sheen_table())
        self._declare(FEATURES)

    def bind(self, table: MaterialTable, features: frozenset[str] | None = None) -> None:
        """Take the materials of the mesh that is rendered next. features: what is compiled, everything if None; names
        that mean nothing to a surface are passed over. Raises ValueError where a material needs one that is missing."""
        if features is not None and not table.needs <= features:
            raise ValueError(f"surface: materials need {sorted(table.needs - features)}, which the kernel "
                             f"would leave out; features are {sorted(features)}")
        self.table = table
        self._declare(FEATURES if features is None else FEATURES & features)

    def _declare(self, features: frozenset[str]) -> None:
        """Tell Mitsuba what this surface can do; components in the order of `lobes`."""
        self.features = features
        flag, sides = mi.BSDFFlags, mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        kinds = [flag.DiffuseReflection, flag.GlossyReflection]
        if features & {"glass", "thin"}:
            kinds += [flag.GlossyTransmission, flag.DeltaReflection, flag.DeltaTransmission]
        if features & {"thin", "coverage"}:
            kinds.append(flag.Null)
        self.m_components = [kind | sides for kind in kinds]
        flags = self.m_components[0]
        for component in self.m_components[1:]:
            flags |= component
        self.m_flags = flags

    # The first hit, which is there

    def first_hit(self, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], take_cosine: mi.Bool,
                  sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool) -> FirstHit:
        """See `first_hit.FirstHit`; one look at the textures."""
        lobes = self._lobes(si, active)
        drawn = scattering.scatter(lobes, si, sample1, sample2)
        wo = dr.select(take_cosine, cosine_direction(lobes.normal, mi.Point2f(sample1, sample2.y)), drawn.wo)
        towards = [Towards(*scattering.evaluate(lobes, si, each), white_lambert(lobes.normal, si, each))
                   for each in given]
        value, pdf = scattering.evaluate(lobes, si, wo)
        delta, null = drawn.delta & ~take_cosine, drawn.null & ~take_cosine
        valid = drawn.valid | take_cosine
        cosine = white_lambert(lobes.normal, si, wo)
        return FirstHit(diffuse=lobes.diffuse, towards=towards, wo=wo,
                        value=dr.select(valid & ~delta, value, 0), pdf=dr.select(valid & ~delta, pdf, 0),
                        cosine=dr.select(valid, cosine, 0), delta=delta, null=null,
                        delta_weight=dr.select(delta, drawn.delta_weight, 0))

    def vertex_hit(self, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], sample1: mi.Float,
                   sample2: mi.Point2f, active: mi.Bool) -> VertexHit:
        """See `later_hit.VertexHit`; one look at the textures."""
        lobes = self._lobes(si, active, whole=False)
        shared, (bs, weight) = _alike(lobes), scattering.sample(lobes, si, sample1, sample2, active)
        if shared is not lobes:
            dense = (bs.pdf > 0) & ~mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
            bs.pdf = dr.select(dense, scattering.evaluate(shared, si, bs.wo)[1], bs.pdf)
        return scattered([scattering.evaluate(shared, si, each) for each in given], bs, weight)

    def light_bounce(self, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
                     active: mi.Bool) -> LightBounce:
        """See `later_hit.light_bounce`; one look at the textures from each side of the path."""
        lobes = self._lobes(si, active, whole=False)
        # A cosine lobe about the geometric normal for a share of directions: where shading normals lie another way, few
        # of the BSDF's find what a path from the camera would see, or none
        outward = si.to_local(si.n)
        outward = mi.Normal3f(dr.mulsign(outward, dr.dot(outward, si.wi)))
        plain = sample1 < PLAIN_SHARE
        sample1 = dr.select(plain, 0, (sample1 - PLAIN_SHARE) / (1 - PLAIN_SHARE))
        bs, drawn = scattering.sample(lobes, si, sample1, sample2, active)
        valid = plain | (bs.pdf > 0)
        bs.wo = dr.select(plain, cosine_direction(outward, sample2), bs.wo)
        bs.sampled_type = dr.select(plain, mi.UInt32(+mi.BSDFFlags.DiffuseReflection), bs.sampled_type)
        cosine = dr.maximum(dr.dot(outward, bs.wo), 0) * dr.inv_pi
        pdf = mixture_pdf(scattering.evaluate(lobes, si, bs.wo)[1], cosine, PLAIN_SHARE)
        pdf, drawn = dr.select(valid, pdf, 0), drawn / (1 - PLAIN_SHARE)
        seen = seen_from(si, bs.wo)
        there = self._lobes(seen, active, whole=False)
        if lobes.glass is not None and there.glass is not None:
            # What lies above smooth glass takes of the light by the direction that it is seen from
            drawn = drawn * dr.select(lobes.glass.weight > 0, there.glass.weight / lobes.glass.weight, 1)
        return bounced(si, bs, drawn, pdf, *scattering.evaluate(_alike(there), seen, si.wi))

    def reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, mi.Normal3f]:
        """(D, R, local shading normal) at a surface point."""
        lobes = self._lobes(si, active)
        return lobes.diffuse, scattering.reflectance(lobes, si), lobes.normal

    def eval_diffuse_reflectance(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """D: integral of f_d cos over the hemisphere, seen from si.wi."""
        return dr.select(active, self._lobes(si, active).diffuse, 0)

    def eval_null_transmission(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """What passes straight on: through a smooth pane, tinted once, and past what is not there."""
        if not self.features & {"thin", "coverage"}:
            return mi.Color3f(0)
        return dr.select(active, scattering.transparency(self._lobes(si, active, whole=False), si), 0)

    def coverage(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
        """Share of the surface that is there."""
        if "coverage" not in self.features:
            return mi.Float(1)
        return look_up(self.table, self.features, si, active).coverage

    def body(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.UInt32:
        """Number of the body of glass that the surface bounds; see `nesting`."""
        if "nested" not in self.features:
            return mi.UInt32(0)
        return look_up(self.table, self.features, si, active).body

    def emission(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """Radiance that the surface sends out where it is there, to both sides."""
        if "emission" not in self.features:
            return mi.Color3f(0)
        return look_up(self.table, self.features, si, active).emission

    def covered_emission(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """The same on average."""
        if "emission" not in self.features:
            return mi.Color3f(0)
        point = look_up(self.table, self.features, si, active)
        return point.emission if point.coverage is None else point.emission * point.coverage

    # Scattering

    def eval(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """f cos, all lobes but the discrete ones."""
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, active: mi.Bool) -> mi.Float:
        """Solid-angle density of `sample`, of all lobes but the discrete ones."""
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f,
                 active: mi.Bool) -> tuple[mi.Color3f, mi.Float]:
        """f cos and the density of `sample`."""
        value, pdf = scattering.evaluate(self._lobes(si, active, whole=False), si, wo)
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def sample(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
               active: mi.Bool) -> tuple[mi.BSDFSample3f, mi.Color3f]:
        """A direction of one of the lobes, picked in proportion to what they reflect or pass."""
        return scattering.sample(self._lobes(si, active, whole=False), si, sample1, sample2, active)

    def eval_pdf_sample(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, sample1: mi.Float,
                        sample2: mi.Point2f,
                        active: mi.Bool) -> tuple[mi.Color3f, mi.Float, mi.BSDFSample3f, mi.Color3f]:
        """`eval_pdf` and `sample` at once, as path integrators ask."""
        lobes = self._lobes(si, active, whole=False)
        value, pdf = scattering.evaluate(lobes, si, wo)
        return (dr.select(active, value, 0), dr.select(active, pdf, 0),
                *scattering.sample(lobes, si, sample1, sample2, active))

    def _lobes(self, si: mi.SurfaceInteraction3f, active: mi.Bool, whole: bool = True) -> Lobes:
        """The lobes at a surface point. whole: whether it is known to be there."""
        tables = Reflectances(
            split_sum=lambda cosine, roughness: interpolated(mi.Vector2f, self.split_sum, cosine, roughness, active),
            sheen=lambda cosine, roughness: interpolated(mi.Float, self.sheen, cosine, roughness, active))
        point = look_up(self.table, self.features, si, active)
        lobes = lobes_of(point, self.features, si, tables)
        lobes.coverage = None if whole else point.coverage
        return lobes

    def to_string(self) -> str:
        """One line for logs."""
        return "Surface[]"


def _alike(lobes: Lobes) -> Lobes:
    """The same with densities that both ends of a path can tell, see `glass.alike`."""
    if lobes.glass is None or len(lobes.glass.indices) == 1:
        return lobes
    return replace(lobes, glass=alike(lobes.glass))
