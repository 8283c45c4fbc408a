"""What happens at the first surface that a camera ray meets, for any Mitsuba BSDF.

`Surface` answers these questions itself, from one look at its textures; for every other BSDF they are put together from
Mitsuba's own interface: D from `eval_diffuse_reflectance`, no specular reflectance, the geometric shading normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

COSINE_SHARE = 0.25
"""Probability of the cosine lobe for a scattered direction that serves both image and shading; the rest goes to the
BSDF."""


@dataclass
class Towards:
    """What a surface does to light from one local direction: the lobes that have a density."""

    value: mi.Color3f
    """f cos."""
    pdf: mi.Float
    """The BSDF's sampling density."""
    cosine: mi.Float
    """cos / pi: both a white Lambertian surface and the density of a cosine lobe."""


@dataclass
class FirstHit:
    """What a surface does to light from given directions and from the scattered one, at one point; all are local.

    Values and pdfs are those of the lobes that have a density.
    """

    diffuse: mi.Color3f
    """D, the diffuse reflectance."""
    towards: list[Towards]
    """Of each direction that was given."""
    wo: mi.Vector3f
    """The scattered direction."""
    value: mi.Color3f
    """f cos of `wo`; 0 where it was drawn from a discrete lobe."""
    pdf: mi.Float
    """The BSDF's sampling density of `wo`; 0 where it was drawn from a discrete lobe."""
    cosine: mi.Float
    """cos / pi of `wo`."""
    delta: mi.Bool
    """Whether `wo` was drawn from a discrete lobe: a smooth pane or smooth glass."""
    null: mi.Bool
    """Whether that choice is to pass straight on."""
    delta_weight: mi.Color3f
    """f cos / p of that choice, given that the BSDF was asked and not the cosine lobe."""


def white_lambert(normal: mi.Normal3f, si: mi.SurfaceInteraction3f, wo: mi.Vector3f) -> mi.Float:
    """cos / pi about a local shading normal, on the viewer's side of the surface."""
    above = mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(wo) > 0
    return dr.select(above, dr.maximum(dr.dot(normal, wo), 0) * dr.inv_pi, 0)


def cosine_direction(normal: mi.Normal3f, sample: mi.Point2f) -> mi.Vector3f:
    """A local direction about a local normal, with density cos / pi."""
    return mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(sample))


def mixture_pdf(pdf: mi.Float, cosine: mi.Float, share: float) -> mi.Float:
    """Density of the scattered direction: the BSDF's and, for a share of them, a cosine lobe's, so that it is positive
    on the whole hemisphere. A share of 0 or 1 leaves no trace of the other in a kernel."""
    if share in (0, 1):
        return cosine if share else pdf
    return dr.lerp(pdf, cosine, share)


def first_hit(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], take_cosine: mi.Bool,
              sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool) -> FirstHit:
    """`FirstHit` of any BSDF pointer; `given` are local directions, such as that of a light sample."""
    return dr.dispatch(bsdf, _first_hit, si, given, take_cosine, sample1, sample2, active)


def reflectance(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f,
                active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, mi.Normal3f]:
    """(D, R, local shading normal turned to the viewer) of any BSDF pointer."""
    return dr.dispatch(bsdf, _reflectance, si, active)


def transparency(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    """Share of the light from behind that passes straight through any BSDF pointer, seen from si.wi: panes pass most
    of it, everything else none."""
    return dr.select(active, bsdf.eval_null_transmission(si, active), 0)


def coverage(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
    """Share of a surface that is there, of any BSDF pointer: all of it but for those of `Surface`."""
    return dr.dispatch(bsdf, _coverage, si, active)


def emission(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, active: mi.Bool, *, whole: bool) -> mi.Color3f:
    """Radiance that a surface, no lamp, sends out; whole: whether it is known to be there. Only those of `Surface`
    do."""
    return dr.select(active, dr.dispatch(bsdf, _emission if whole else _covered_emission, si, active), 0)


def _coverage(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Float:
    return bsdf.coverage(si, active) if hasattr(bsdf, "coverage") else mi.Float(1)


def _emission(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    return bsdf.emission(si, active) if hasattr(bsdf, "emission") else mi.Color3f(0)


def _covered_emission(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
    return bsdf.covered_emission(si, active) if hasattr(bsdf, "covered_emission") else mi.Color3f(0)


def _first_hit(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], take_cosine: mi.Bool,
               sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool) -> FirstHit:
    if hasattr(bsdf, "first_hit"):
        return bsdf.first_hit(si, given, take_cosine, sample1, sample2, active)
    ctx = mi.BSDFContext()
    normal = _viewer_normal(si)
    bs, weight = bsdf.sample(ctx, si, sample1, sample2, active & ~take_cosine)
    delta, null = mi.Bool(False), mi.Bool(False)
    if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta):
        delta = ~take_cosine & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        null = ~take_cosine & mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
    wo = dr.select(take_cosine, cosine_direction(normal, mi.Point2f(sample1, sample2.y)), bs.wo)
    towards = [Towards(mi.Color3f(value), pdf, white_lambert(normal, si, each))
               for each in given for value, pdf in [bsdf.eval_pdf(ctx, si, each, active)]]
    value, pdf = bsdf.eval_pdf(ctx, si, wo, active)
    return FirstHit(diffuse=mi.Color3f(bsdf.eval_diffuse_reflectance(si, active)), towards=towards, wo=wo,
                    value=dr.select(delta, 0, mi.Color3f(value)), pdf=dr.select(delta, 0, pdf),
                    cosine=white_lambert(normal, si, wo), delta=delta, null=null,
                    delta_weight=dr.select(delta, mi.Color3f(weight), 0))


def _reflectance(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f,
                 active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, mi.Normal3f]:
    if hasattr(bsdf, "reflectance"):
        return bsdf.reflectance(si, active)
    return mi.Color3f(bsdf.eval_diffuse_reflectance(si, active)), mi.Color3f(0), _viewer_normal(si)


def _viewer_normal(si: mi.SurfaceInteraction3f) -> mi.Normal3f:
    return mi.Normal3f(0, 0, dr.select(mi.Frame3f.cos_theta(si.wi) < 0, mi.Float(-1), mi.Float(1)))
