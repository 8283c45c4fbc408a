"""All radiometric layers of one geometry under one light, along the same paths: the custom Mitsuba integrator.

At the first surface point x the rendering equation (Kajiya, "The rendering equation", SIGGRAPH 1986) is solved twice,

    I = L_e + integral of f L_i cos,        S = integral of L_i cos / pi,

for the BSDF f and for a white Lambertian surface; every other surface keeps its material. Emitter samples and scattered
directions serve both, weighted by f cos / p for I and by cos / (pi p) for S, with p a mixture of the BSDF's density and
a cosine lobe, so that S is well sampled on mirrors too. Directions of delta lobes, which clear glass has, serve I
alone. Where only one of I and S is wanted, p is the BSDF's density alone, or the cosine lobe. L_i is found by an
ordinary path tracer with multiple importance sampling; see `path_tracer.incident_radiance`.

`trace` is the estimator; `LightingIntegrator` wraps it as the plugin `threedf_lighting`, so that `mi.render` gives the
image; `sampling.estimate` calls it on lists of pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.channels_left import pack
from dataset_builder.rendering.surface.first_hit import FirstHit, emission, first_hit, mixture_pdf
from dataset_builder.rendering.surface.nesting import beyond
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.light_sampling import (
    EVERYTHING,
    World,
    balance,
    in_air,
    sample_emitter,
)
from dataset_builder.rendering.transport.path_tracer import PathStart, incident_radiance
from dataset_builder.rendering.transport.portals import Portals
from dataset_builder.rendering.transport.sight import first_met

PLUGIN = "threedf_lighting"


@dataclass(frozen=True, kw_only=True)
class Radiometry:
    """What one path gives; None for what was not wanted."""

    image: mi.Color3f
    """Outgoing radiance."""
    shading: mi.Color3f
    """Raw lighting."""
    specular: mi.Color3f
    """Specular part of the radiance, emission included."""
    air: mi.Color3f
    """What fog adds to the radiance before the first surface, less what it takes."""
    valid: mi.Bool
    """Whether there is such a surface."""

    def channels(self, name: str) -> mi.Color3f:
        """A field by name, or the square of `name` in `name_squared`."""
        values = getattr(self, name.removesuffix("_squared"))
        return values * values if name.endswith("_squared") else values


def trace(scene: mi.Scene, sampler: mi.Sampler, rest: mi.Sampler, ray: mi.Ray3f, max_depth: mi.UInt32,
          rr_depth: mi.UInt32, active: mi.Bool = True, *, features: frozenset[str] = frozenset(),
          fog: Fog | None = None, portals: Portals | None = None, wanted: frozenset[str] = EVERYTHING) -> Radiometry:
    """One path per lane. max_depth and rr_depth as in Mitsuba's `path`: edges of the longest path, start of roulette;
    an edge ends on a surface or where fog scatters, and panes and gaps that a path passes straight end none.
    sampler makes the random numbers up to the first scattering, `rest` those after it; they may be one and the same.
    features: `glass`, `thin`, `dispersion`, `coverage` and `emission` where the scene has them, see
    `example_plan.Feature`; others are not looked at. What the ray meets first is chosen by coverage, and then whole.
    portals: what samples of the dome go through; None for all round.
    wanted: fields of the result; what serves none of them is neither drawn nor computed.

    `specular` is I minus what the diffuse lobe of the first hit sends and minus `air`, estimated from the same samples,
    so that I = D S + specular + air holds for every single path with D taken at its first hit.
    """
    world = World(scene, max_depth, rr_depth, features, fog, portals, wanted)
    active = mi.Bool(active)
    si, end = first_met(world, ray, sampler, active)

    # Emission of the first surface
    L_e = si.emitter(scene).eval(si, active)
    if world.emission:
        L_e += emission(si.bsdf(ray), si, active & si.is_valid(), whole=True)
    image, shading, specular = mi.Color3f(L_e), mi.Color3f(0), mi.Color3f(L_e)
    active_next = active & si.is_valid() & (max_depth > 1)

    # Sample an emitter, for both: I += f cos w L_e T / p, S += cos / pi w L_e T / p
    ds, em_weight = sample_emitter(world, si, sampler.next_2d(active_next), active_next)
    take_cosine, sample1, sample2 = choice_of_lobe(world, sampler, active_next)
    hit = first_hit(si.bsdf(ray), si, [si.to_local(ds.d)], take_cosine, sample1, sample2, active_next)
    light = hit.towards[0]
    mis = dr.select(ds.delta, 1, balance(ds.pdf, mixture_pdf(light.pdf, light.cosine, world.cosine_share)))
    direct = dr.select(active_next & (ds.pdf != 0), em_weight * mis, 0)
    image += light.value * direct
    shading += light.cosine * direct
    specular += (light.value - hit.diffuse * light.cosine) * direct

    # Sample a direction, for both: I += f cos / p L_i, S += cos / (pi p) L_i
    weight_image, weight_shading, start = scattered(world, si, hit, active_next & ~take_cosine)
    active_bsdf = active_next & ((start.pdf > 0) | start.delta)
    L_i = incident_radiance(world, rest, start, active_bsdf)
    image += weight_image * L_i
    shading += weight_shading * L_i
    specular += (weight_image - hit.diffuse * weight_shading) * L_i

    # Fog before the first surface
    air = mi.Color3f(0)
    if fog is not None and world.image:
        air = _air(world, fog, sampler, rest, ray, end, image, active)
    found = {"image": image + air, "shading": shading, "specular": specular, "air": air}
    return Radiometry(**{name: each if name in wanted else None for name, each in found.items()},
                      valid=active & si.is_valid())


def choice_of_lobe(world: World, sampler: mi.Sampler, active: mi.Bool) -> tuple[mi.Bool, mi.Float, mi.Point2f]:
    """Whether to take the cosine lobe, and three uniform numbers of which (sample1, sample2.y) are a stratified pair:
    the first picks among lobes, and what is left of its chance is the direction's, see `lobes.scatter`."""
    pair, spare, share = sampler.next_2d(active), sampler.next_1d(active), world.cosine_share
    if share in (0, 1):
        return mi.Bool(world.shading), pair.x, mi.Point2f(spare, pair.y)
    take_cosine = pair.x < share
    sample1 = dr.select(take_cosine, pair.x / share, (pair.x - share) / (1 - share))
    return take_cosine, dr.minimum(sample1, dr.one_minus_epsilon(mi.Float)), mi.Point2f(spare, pair.y)


def scattered(world: World, si: mi.SurfaceInteraction3f, hit: FirstHit,
              by_bsdf: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, PathStart]:
    """Weights for I and S of what arrives from the scattered direction, and the ray that looks there: f cos / p and
    cos / (pi p), p the mixture, or f cos / p of the delta lobe alone for I, and 0 for S."""
    pdf = mixture_pdf(hit.pdf, hit.cosine, world.cosine_share)
    inverse_pdf = dr.select(pdf > 0, dr.rcp(pdf), 0)
    weight_image, weight_shading = hit.value * inverse_pdf, mi.Color3f(hit.cosine * inverse_pdf)
    delta, depth = mi.Bool(False), mi.UInt32(1)
    prior_throughput = dr.maximum(dr.max(weight_image) if world.image else 0,
                                  dr.max(weight_shading) if world.shading else 0)
    if world.image and (world.glass or world.thin):
        delta = by_bsdf & hit.delta
        weight_image = dr.select(delta, hit.delta_weight / (1 - world.cosine_share), weight_image)
        weight_shading = dr.select(delta, 0, weight_shading)
        # Radiance is thinner in glass, and thickens again where it leaves: no reason to end the path
        transmitted = mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(hit.wo) < 0
        prior_throughput = dr.select(delta | transmitted, 1, prior_throughput)
        if world.thin:
            depth = dr.select(delta & hit.null, mi.UInt32(0), depth)
    channels, direction, inside = mi.Float(0), si.to_world(hit.wo), mi.UInt32(0)
    if world.dispersion:
        channels = pack((weight_image if world.image else 0) + (weight_shading if world.shading else 0))
    if world.nested:
        inside = beyond(si.bsdf(), si, mi.UInt32(0), direction, si.is_valid())
    return weight_image, weight_shading, PathStart(
        point=si, direction=direction, pdf=pdf, delta=delta, depth=depth, prior_throughput=prior_throughput,
        channels=channels, inside=inside)


def _air(world: World, fog: Fog, sampler: mi.Sampler, rest: mi.Sampler, ray: mi.Ray3f, end: mi.Float,
         surface: mi.Color3f, active: mi.Bool) -> mi.Color3f:
    """What fog adds to `surface`, the radiance that sets out at the ray's end, less what it takes.

    The equation of transfer of a homogeneous medium (Pharr et al. 2023, section 14.1): with T the transmittance to the
    ray's end, (1 - T) (albedo L_scattered - surface). What the fog takes is known; L_scattered is estimated from one
    point, drawn where the fog would scatter the ray if it did.
    """
    segment = fog.segment(ray.o, ray.d, end)
    opacity = fog.opacity(segment)
    active_next = active & (segment.length > 0) & (world.max_depth > 1)
    point = in_air(ray, fog.sample_distance_within(segment, sampler.next_1d(active_next)))

    # Sample an emitter
    ds, em_weight = sample_emitter(world, point, sampler.next_2d(active_next), active_next)
    phase = fog.phase(dr.dot(ray.d, ds.d))
    mis = dr.select(ds.delta, 1, balance(ds.pdf, phase))
    direct = dr.select(active_next & (ds.pdf != 0), phase * em_weight * mis, 0)

    # Sample a direction
    direction, pdf = fog.sample_phase(ray.d, sampler.next_2d(active_next))
    start = PathStart(point=point, direction=direction, pdf=pdf, delta=mi.Bool(False), depth=mi.UInt32(1),
                      prior_throughput=fog.albedo * opacity, channels=mi.Float(0), inside=mi.UInt32(0))
    L_i = incident_radiance(world, rest, start, active_next)
    return opacity * (fog.albedo * (direct + L_i) - surface)


class LightingIntegrator:
    """Mitsuba plugin: the image, with raw lighting and specular part as AOVs. Parameters: max_depth, rr_depth, features
    (of `trace`, separated by spaces)."""

    def __init__(self, props: mi.Properties):
        mi.SamplingIntegrator.__init__(self, props)
        self.max_depth = props.get("max_depth", 8)
        self.rr_depth = props.get("rr_depth", 5)
        self.features = frozenset(props.get("features", "").split())

    def sample(self, scene: mi.Scene, sampler: mi.Sampler, ray: mi.Ray3f, medium: Any = None,
               active: mi.Bool = True) -> tuple[mi.Color3f, mi.Bool, list[mi.Float]]:
        """Radiance, validity and the AOVs of one ray."""
        max_depth, rr_depth = (dr.opaque(mi.UInt32, depth) for depth in (self.max_depth, self.rr_depth))
        found = trace(scene, sampler, sampler, ray, max_depth, rr_depth, active, features=self.features)
        return found.image, found.valid, [*found.shading, *found.specular]

    def aov_names(self) -> list[str]:
        """Channels after the colour."""
        return ["s.R", "s.G", "s.B", "spec.R", "spec.G", "spec.B"]
