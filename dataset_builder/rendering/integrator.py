"""All radiometric layers of one geometry under one light, along the same paths: the custom Mitsuba integrator.

At the first surface point x the BSDF f is split into what it is (for I) and what a white Lambertian surface would be
(for S); every other surface keeps its material. Light samples and scattered directions serve both, weighted by
f cos / p for I and by cos / (pi p) for S, with p a mixture of the BSDF's density and a cosine lobe, so that S is well
sampled on mirrors too. What follows the first hit is an ordinary path tracer with multiple importance sampling (Veach,
"Robust Monte Carlo methods for light transport simulation", 1997, sections 9.2 and 10.4).

`trace` is the estimator; `LightingIntegrator` wraps it as the plugin `threedf_lighting`, so that `mi.render` gives the
frame; `rendering.estimate` calls it on lists of pixels.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.first_hit import COSINE_SHARE, first_hit, mixture

PLUGIN = "threedf_lighting"
MAX_SURVIVAL = 0.95


@dataclass(frozen=True, kw_only=True)
class Radiometry:
    """What one path gives: outgoing radiance, raw lighting, and the specular part of the radiance (emission
    included)."""

    image: mi.Color3f
    shading: mi.Color3f
    specular: mi.Color3f
    valid: mi.Bool


def trace(scene: mi.Scene, sampler: mi.Sampler, rest: mi.Sampler, ray: mi.Ray3f, max_depth: mi.UInt32,
          rr_depth: mi.UInt32, active: mi.Bool = True) -> Radiometry:
    """One path per lane. max_depth and rr_depth as in Mitsuba's `path`: edges of the longest path, start of roulette.
    sampler makes the random numbers up to the first scattering, `rest` those after it; they may be one and the same.

    `specular` is I minus what the diffuse lobe of the first hit sends, estimated from the same samples, so that
    I = D S + specular holds for every single path with D taken at its first hit.
    """
    active = mi.Bool(active)
    si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=active)
    emitted = si.emitter(scene).eval(si, active)
    image, shading, specular = mi.Color3f(emitted), mi.Color3f(0), mi.Color3f(emitted)
    lit = active & si.is_valid() & (max_depth > 1)

    # Light sampled from the first hit, and a direction scattered from it, for both
    ds, em_weight = scene.sample_emitter_direction(si, sampler.next_2d(lit), True, lit)
    take_cosine = sampler.next_1d(lit) < COSINE_SHARE
    hit = first_hit(si.bsdf(ray), si, si.to_local(ds.d), take_cosine, sampler.next_1d(lit), sampler.next_2d(lit), lit)
    mis = dr.select(ds.delta, 1, _balance(ds.pdf, mixture(hit.em_density, hit.em_cosine)))
    direct = dr.select(lit & (ds.pdf != 0), em_weight * mis, 0)
    image += hit.em_value * direct
    shading += hit.em_cosine * direct
    specular += (hit.em_value - hit.diffuse * hit.em_cosine) * direct

    # What arrives from the scattered direction
    density = mixture(hit.density, hit.cosine)
    going = lit & (density > 0)
    inverse = dr.select(going, dr.rcp(density), 0)
    w_image, w_shading = hit.value * inverse, mi.Color3f(hit.cosine * inverse)
    scale = dr.maximum(dr.max(w_image), dr.max(w_shading))
    later = _follow(scene, rest, si, si.to_world(hit.wo), density, max_depth, rr_depth, going, scale)
    image += w_image * later
    shading += w_shading * later
    specular += (w_image - hit.diffuse * w_shading) * later
    return Radiometry(image=image, shading=shading, specular=specular, valid=active & si.is_valid())


@dr.syntax
def _follow(scene: mi.Scene, sampler: mi.Sampler, si: mi.SurfaceInteraction3f, direction: mi.Vector3f,
            density: mi.Float, max_depth: mi.UInt32, rr_depth: mi.UInt32, active: mi.Bool,
            scale: mi.Float) -> mi.Color3f:
    """Radiance that arrives at `si` from `direction`, which was drawn with `density`; throughput starts at one.

    `scale` is the weight the result gets, which Russian roulette goes by.
    """
    ctx = mi.BSDFContext()
    ray = si.spawn_ray(direction)
    result, throughput = mi.Color3f(0), mi.Color3f(1)
    depth, active = mi.UInt32(1), mi.Bool(active)
    prev_si, prev_pdf, prev_delta = mi.Interaction3f(si), mi.Float(density), mi.Bool(False)
    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)

        # Emitter met by the ray
        ds = mi.DirectionSample3f(scene, si, prev_si)
        em_pdf = scene.pdf_emitter_direction(prev_si, ds, ~prev_delta)
        mis = dr.select(prev_delta, 1, _balance(prev_pdf, em_pdf))
        result += throughput * si.emitter(scene).eval(si, active) * mis

        # Light sampled from here
        active_next = active & si.is_valid() & (depth + 1 < max_depth)
        bsdf = si.bsdf(ray)
        active_em = active_next & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        ds, em_weight = scene.sample_emitter_direction(si, sampler.next_2d(active_em), True, active_em)
        active_em &= ds.pdf != 0
        value, pdf, bs, weight = bsdf.eval_pdf_sample(ctx, si, si.to_local(ds.d), sampler.next_1d(active_next),
                                                      sampler.next_2d(active_next), active_next)
        mis = dr.select(ds.delta, 1, _balance(ds.pdf, pdf))
        result += dr.select(active_em, throughput * value * em_weight * mis, 0)

        # Scattered direction and Russian roulette
        throughput *= dr.select(active_next, weight, 0)
        ray = si.spawn_ray(si.to_world(bs.wo))
        prev_si, prev_pdf = mi.Interaction3f(si), bs.pdf
        prev_delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        depth += 1
        survive = dr.minimum(scale * dr.max(throughput), MAX_SURVIVAL)
        roulette = depth >= rr_depth
        active = active_next & (dr.max(throughput) != 0) & (~roulette | (sampler.next_1d(active_next) < survive))
        throughput = dr.select(roulette, throughput * dr.rcp(survive), throughput)
    return result


def _balance(pdf: mi.Float, other: mi.Float) -> mi.Float:
    """Balance heuristic, and 1 where the other technique cannot make the sample (Veach 1997, equation 9.8)."""
    return dr.select(other > 0, pdf / (pdf + other), 1)



class LightingIntegrator(mi.SamplingIntegrator):
    """Mitsuba plugin: the image, with raw lighting and specular part as AOVs. Parameters: max_depth, rr_depth."""

    def __init__(self, props: mi.Properties):
        mi.SamplingIntegrator.__init__(self, props)
        self.max_depth = props.get("max_depth", 8)
        self.rr_depth = props.get("rr_depth", 5)

    def sample(self, scene: mi.Scene, sampler: mi.Sampler, ray: mi.Ray3f, medium: Any = None,
               active: mi.Bool = True) -> tuple[mi.Color3f, mi.Bool, list[mi.Float]]:
        """Radiance, validity and the AOVs of one ray."""
        max_depth, rr_depth = (dr.opaque(mi.UInt32, depth) for depth in (self.max_depth, self.rr_depth))
        found = trace(scene, sampler, sampler, ray, max_depth, rr_depth, active)
        return found.image, found.valid, [*found.shading, *found.specular]

    def aov_names(self) -> list[str]:
        """Channels after the colour."""
        return ["s.R", "s.G", "s.B", "spec.R", "spec.G", "spec.B"]


def register() -> None:
    """Make the plugin known to Mitsuba under `PLUGIN`; once per variant."""
    mi.register_integrator(PLUGIN, lambda props: LightingIntegrator(props))
