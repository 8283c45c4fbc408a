"""All radiometric layers of one geometry under one light, along the same paths: the custom Mitsuba integrator.

At the first surface point x the BSDF f is split into what it is (for I) and what a white Lambertian surface would be
(for S); every other surface keeps its material. Light samples and scattered directions serve both, weighted by
f cos / p for I and by cos / (pi p) for S, with p a mixture of the BSDF's density and a cosine lobe, so that S is well
sampled on mirrors too. Directions of delta lobes, which clear glass has, serve I alone. What follows the first hit is
an ordinary path tracer with multiple importance sampling; see `follow`.

`trace` is the estimator; `LightingIntegrator` wraps it as the plugin `threedf_lighting`, so that `mi.render` gives the
frame; `rendering.estimate` calls it on lists of pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.plugin_class import plugin_class
from dataset_builder.rendering.surface.first_hit import COSINE_SHARE, FirstHit, first_hit, mixture
from dataset_builder.rendering.transport.fog import Fog
from dataset_builder.rendering.transport.light_sampling import World, balance, carried, in_air, sample_light
from dataset_builder.rendering.transport.path_tracer import Start, follow

PLUGIN = "threedf_lighting"


@dataclass(frozen=True, kw_only=True)
class Radiometry:
    """What one path gives: outgoing radiance, raw lighting, the specular part of the radiance (emission included), and
    what fog adds to the radiance before the first surface, less what it takes; valid: there is such a surface."""

    image: mi.Color3f
    shading: mi.Color3f
    specular: mi.Color3f
    air: mi.Color3f
    valid: mi.Bool


def trace(scene: mi.Scene, sampler: mi.Sampler, rest: mi.Sampler, ray: mi.Ray3f, max_depth: mi.UInt32,
          rr_depth: mi.UInt32, active: mi.Bool = True, *, features: frozenset[str] = frozenset(),
          fog: Fog | None = None) -> Radiometry:
    """One path per lane. max_depth and rr_depth as in Mitsuba's `path`: edges of the longest path, start of roulette;
    an edge ends on a surface or where fog scatters, and panes that a path passes straight end none.
    sampler makes the random numbers up to the first scattering, `rest` those after it; they may be one and the same.
    features: `glass` and `thin` where the scene has them, see `example_plan.Feature`; others are not looked at.

    `specular` is I minus what the diffuse lobe of the first hit sends and minus `air`, estimated from the same samples,
    so that I = D S + specular + air holds for every single path with D taken at its first hit.
    """
    world = World(scene, max_depth, rr_depth, features, fog)
    active = mi.Bool(active)
    si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True, active=active)
    emitted = si.emitter(scene).eval(si, active)
    image, shading, specular = mi.Color3f(emitted), mi.Color3f(0), mi.Color3f(emitted)
    lit = active & si.is_valid() & (max_depth > 1)

    # Light sampled from the first hit, and a direction scattered from it, for both
    ds, em_weight = sample_light(world, si, sampler.next_2d(lit), lit)
    take_cosine = sampler.next_1d(lit) < COSINE_SHARE
    hit = first_hit(si.bsdf(ray), si, si.to_local(ds.d), take_cosine, sampler.next_1d(lit), sampler.next_2d(lit), lit)
    mis = dr.select(ds.delta, 1, balance(ds.pdf, mixture(hit.em_density, hit.em_cosine)))
    direct = dr.select(lit & (ds.pdf != 0), em_weight * mis, 0)
    image += hit.em_value * direct
    shading += hit.em_cosine * direct
    specular += (hit.em_value - hit.diffuse * hit.em_cosine) * direct

    # What arrives from the scattered direction
    w_image, w_shading, start = _scattered(world, si, hit, lit & ~take_cosine)
    going = lit & ((start.density > 0) | start.delta)
    later = follow(world, rest, start, going)
    image += w_image * later
    shading += w_shading * later
    specular += (w_image - hit.diffuse * w_shading) * later
    air = mi.Color3f(0) if fog is None else _air(world, fog, sampler, rest, ray, si.t, image, active)
    return Radiometry(image=image + air, shading=shading, specular=specular, air=air, valid=active & si.is_valid())


def _scattered(world: World, si: mi.SurfaceInteraction3f, hit: FirstHit,
               by_bsdf: mi.Bool) -> tuple[mi.Color3f, mi.Color3f, Start]:
    """Weights for I and S of what arrives from the scattered direction, and the ray that looks there."""
    density = mixture(hit.density, hit.cosine)
    inverse = dr.select(density > 0, dr.rcp(density), 0)
    w_image, w_shading = hit.value * inverse, mi.Color3f(hit.cosine * inverse)
    delta, edges = mi.Bool(False), mi.UInt32(1)
    scale = dr.maximum(dr.max(w_image), dr.max(w_shading))
    if world.glass or world.thin:
        delta = by_bsdf & hit.delta
        w_image = dr.select(delta, hit.delta_weight / (1 - COSINE_SHARE), w_image)
        w_shading = dr.select(delta, 0, w_shading)
        # Radiance is thinner in glass, and thickens again where it leaves: no reason to end the path
        through = mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(hit.wo) < 0
        scale = dr.select(delta | through, 1, scale)
    if world.thin:
        edges = dr.select(delta & hit.null, mi.UInt32(0), edges)
    # Where the same path serves S, all of its colours count
    colour = dr.select(delta, carried(w_image), 0) if world.dispersion else mi.Float(0)
    return w_image, w_shading, Start(point=si, direction=si.to_world(hit.wo), density=density, delta=delta, edges=edges,
                                     scale=scale, carried=colour)


def _air(world: World, fog: Fog, sampler: mi.Sampler, rest: mi.Sampler, ray: mi.Ray3f, end: mi.Float,
         surface: mi.Color3f, active: mi.Bool) -> mi.Color3f:
    """What fog adds to `surface`, the radiance that sets out at the ray's end, less what it takes.

    What it takes is known; what it adds is estimated from one point, drawn where the fog would scatter the ray if it
    did.
    """
    way = fog.way(ray.o, ray.d, end)
    lost = fog.scattered(way)
    lit = active & (way.length > 0) & (world.max_depth > 1)
    point = in_air(ray, fog.flight_within(way, sampler.next_1d(lit)))
    ds, em_weight = sample_light(world, point, sampler.next_2d(lit), lit)
    phase = fog.phase(dr.dot(ray.d, ds.d))
    mis = dr.select(ds.delta, 1, balance(ds.pdf, phase))
    direct = dr.select(lit & (ds.pdf != 0), phase * em_weight * mis, 0)
    direction, density = fog.scatter(ray.d, sampler.next_2d(lit))
    start = Start(point=point, direction=direction, density=density, delta=mi.Bool(False), edges=mi.UInt32(1),
                  scale=fog.albedo * lost, carried=mi.Float(0))
    later = follow(world, rest, start, lit)
    return lost * (fog.albedo * (direct + later) - surface)


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


def register() -> None:
    """Make the plugin known to Mitsuba under `PLUGIN`; once per variant."""
    mi.register_integrator(PLUGIN, plugin_class(LightingIntegrator, mi.SamplingIntegrator))
