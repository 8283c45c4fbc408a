"""What happens at surfaces after the first, for any Mitsuba BSDF: on a path from the camera, and on one from a lamp.

`Surface` answers these questions from one look at its textures for each side that it is seen from; the rest is put
together from Mitsuba's own interface, as in `first_hit`.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass
class VertexHit:
    """What a surface does to light from given local directions, and where it scatters a path from the camera to."""

    values: list[mi.Color3f]
    """f cos of each direction that was given."""
    pdfs: list[mi.Float]
    """The BSDF's sampling density of each."""
    wo: mi.Vector3f
    """The scattered direction."""
    weight: mi.Color3f
    """f cos / p of it."""
    pdf: mi.Float
    eta: mi.Float
    """Relative index of refraction along it."""
    delta: mi.Bool
    """Whether a delta lobe left no other choice."""
    passed: mi.Bool
    """Whether the path goes straight on, through a pane or past what is not there."""


@dataclass
class LightBounce:
    """How a surface sends on light that arrives from si.wi."""

    wo: mi.Vector3f
    """Where to, local."""
    weight: mi.Color3f
    """What the flux is multiplied by; see `light_bounce`."""
    pdf: mi.Float
    """Density with which a path from the camera would go on to si.wi if it came from `wo`; 0 where a delta lobe was
    taken."""
    delta: mi.Bool
    passed: mi.Bool
    """Whether the light goes straight on, as if there were no surface."""


def vertex_hit(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], sample1: mi.Float,
               sample2: mi.Point2f, active: mi.Bool) -> VertexHit:
    """`VertexHit` of any BSDF pointer."""
    return dr.dispatch(bsdf, _vertex_hit, si, given, sample1, sample2, active)


def light_bounce(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
                 active: mi.Bool) -> LightBounce:
    """`LightBounce` of any BSDF pointer: a direction d drawn as for a path that comes from b = si.wi, with density p.

    Light and camera have to agree on f, which shading normals and refraction make unsymmetric: it is that of a path
    from the camera that comes from d and leaves to b. With n the geometric normal and cosines without sign, the flux is
    multiplied by f(d -> b) cos_s(b) cos_n(d) / (cos_n(b) p(d)) (Veach 1997, sections 5.2 and 5.3), cos_s the cosine
    that f comes with. For a delta lobe, which has weight w for paths from b, that is w eta^2 cos_n(d) cos_s(b) /
    (cos_n(b) cos_s(d)), eta the relative index along d, whose square w was divided by.
    """
    return dr.dispatch(bsdf, _light_bounce, si, sample1, sample2, active)


def bounced(si: mi.SurfaceInteraction3f, bs: mi.BSDFSample3f, drawn: mi.Color3f, pdf: mi.Float, value: mi.Color3f,
            pdf_back: mi.Float) -> LightBounce:
    """`LightBounce` of a direction drawn as for a path that comes from si.wi: `bs` and its weight `drawn`. pdf: p of
    it. value, pdf_back: f cos and density towards si.wi of a path that comes from there."""
    delta, passed = (mi.has_flag(bs.sampled_type, flag) for flag in (mi.BSDFFlags.Delta, mi.BSDFFlags.Null))
    cos_there, cos_back = (dr.abs(dr.dot(si.n, si.to_world(each))) for each in (bs.wo, si.wi))
    foreshortened = dr.select(cos_back > 0, cos_there / cos_back, 0)
    tilt = dr.abs(mi.Frame3f.cos_theta(si.wi)) / dr.abs(mi.Frame3f.cos_theta(bs.wo))
    weight = dr.select(pdf > 0, value * (foreshortened / pdf), 0)
    weight = dr.select(delta, drawn * (dr.square(bs.eta) * foreshortened * tilt), weight)
    return LightBounce(wo=bs.wo, weight=dr.select(passed, drawn, weight), pdf=dr.select(delta | passed, 0, pdf_back),
                       delta=delta & ~passed, passed=passed)


def seen_from(si: mi.SurfaceInteraction3f, wi: mi.Vector3f) -> mi.SurfaceInteraction3f:
    """The same point of a surface, seen from another local direction."""
    seen = mi.SurfaceInteraction3f(si)
    seen.wi = wi
    return seen


def _light_bounce(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
                  active: mi.Bool) -> LightBounce:
    if hasattr(bsdf, "light_bounce"):
        return bsdf.light_bounce(si, sample1, sample2, active)
    bs, drawn = bsdf.sample(mi.BSDFContext(), si, sample1, sample2, active)
    back = bsdf.eval_pdf(mi.BSDFContext(), seen_from(si, bs.wo), si.wi, active)
    return bounced(si, bs, drawn, bs.pdf, *back)


def _vertex_hit(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, given: list[mi.Vector3f], sample1: mi.Float,
                sample2: mi.Point2f, active: mi.Bool) -> VertexHit:
    if hasattr(bsdf, "vertex_hit"):
        return bsdf.vertex_hit(si, given, sample1, sample2, active)
    found = [bsdf.eval_pdf(mi.BSDFContext(), si, each, active) for each in given]
    return scattered(found, *bsdf.sample(mi.BSDFContext(), si, sample1, sample2, active))


def scattered(found: list[tuple[mi.Color3f, mi.Float]], bs: mi.BSDFSample3f, weight: mi.Color3f) -> VertexHit:
    """The answer of a BSDF, from what it evaluates and samples."""
    delta, passed = (mi.has_flag(bs.sampled_type, flag) for flag in (mi.BSDFFlags.Delta, mi.BSDFFlags.Null))
    return VertexHit(values=[mi.Color3f(value) for value, _ in found], pdfs=[mi.Float(pdf) for _, pdf in found],
                     wo=bs.wo, weight=mi.Color3f(weight), pdf=bs.pdf, eta=bs.eta, delta=delta & ~passed, passed=passed)
