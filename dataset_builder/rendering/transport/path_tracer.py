"""The path tracer that follows light from where the first hit, or the air before it, sends a ray.

It solves the equation of transfer (Pharr, Jakob and Humphreys, "Physically based rendering", 4th edition, 2023, section
14.1) by paths from the camera. Emitters are sampled at every vertex and met by chance, combined by multiple importance
sampling (Veach, "Robust Monte Carlo methods for light transport simulation", 1997, sections 9.2 and 10.4). Vertices are
surfaces or, in fog, points of the air; panes and gaps that a ray passes straight are no vertices, so that both ways to
the light behind them stay comparable. Surfaces that send out light are no emitters, and met by chance alone. Variables
and steps are named as in Mitsuba's `prb` integrator.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.channels_left import kept, pack, unpack
from dataset_builder.rendering.surface.first_hit import emission
from dataset_builder.rendering.surface.nesting import beyond, inside_of, time_of
from dataset_builder.rendering.transport.light_sampling import (
    FreeFlight,
    World,
    balance,
    emitter_pdf,
    sample_emitter,
    sample_free_flight,
)

MAX_SURVIVAL = 0.95
FOG_SURVIVAL = 0.998
"""The same times the albedo of fog where that is more: light goes through hundreds of its events, and what outlives
95% of each a hundred times would weigh as much as 170 paths."""


@dataclass
class PathStart:
    """A ray to follow, and what its path was before."""

    point: mi.Interaction3f
    direction: mi.Vector3f
    pdf: mi.Float
    """Solid-angle density that the direction was drawn with, per steradian."""
    delta: mi.Bool
    """Whether a delta lobe left no other choice."""
    depth: mi.UInt32
    """Edges of the path so far, this ray included if it ends somewhere."""
    prior_throughput: mi.Float
    """Weight that the result gets; Russian roulette goes by it."""
    channels: mi.Float
    """What is left of them, see `channels_left.pack`."""
    inside: mi.UInt32
    """Bodies of glass that the ray sets out in, see `nesting`."""


@dataclass
class PathVertex:
    """What happens at a vertex, to the sampled emitter's light and to the path."""

    em_value: mi.Color3f
    """f cos, or albedo times phase function, towards the sampled emitter."""
    em_pdf: mi.Float
    """Solid-angle density with which the path would go there itself."""
    direction: mi.Vector3f
    weight: mi.Color3f
    """f cos / p of the sampled direction."""
    pdf: mi.Float
    eta: mi.Float
    """Relative index of refraction along the sampled direction."""
    delta: mi.Bool
    """Whether no emitter sample could have made the direction."""
    passed: mi.Bool
    """Whether the path goes on straight, through a pane or past what is not there."""


@dr.syntax
def incident_radiance(world: World, sampler: mi.Sampler, start: PathStart, active: mi.Bool) -> mi.Color3f:
    """L_i: radiance that arrives at the start's point from its direction."""
    scene, max_depth, rr_depth, prior_throughput = world.scene, world.max_depth, world.rr_depth, start.prior_throughput
    before = start.channels

    most = mi.Float(MAX_SURVIVAL) if world.fog is None else dr.maximum(MAX_SURVIVAL, FOG_SURVIVAL * world.fog.albedo)

    # Loop state
    ray = start.point.spawn_ray(start.direction)   # Current ray, in units of the local frame
    L = mi.Color3f(0)                              # Radiance found so far, in units of the lights
    throughput = mi.Color3f(1)                     # Path throughput: product of f cos / p since the start
    if world.dispersion:
        ray.time, throughput = before, kept(before)
    if world.nested:
        ray.time = time_of(unpack(before) if world.dispersion else None, start.inside)
    eta = mi.Float(1)                              # Product of relative indices of refraction since the start
    depth = mi.UInt32(start.depth)                 # Edges of the path, the current ray included
    active = mi.Bool(active)                       # Active lanes
    prev_point = mi.Interaction3f(start.point)     # Previous vertex
    prev_pdf = mi.Float(start.pdf)                 # Density that drew the ray's direction there, per steradian
    prev_delta = mi.Bool(start.delta)              # Whether a delta lobe drew it

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        flight = sample_free_flight(world, ray, si, sampler, active)

        # Emission of what the ray meets: L += throughput L_e w T
        ds = mi.DirectionSample3f(scene, si, prev_point)
        em_pdf = emitter_pdf(world, prev_point, ds, ~prev_delta)
        mis = dr.select(prev_delta, 1, balance(prev_pdf, em_pdf))
        L += throughput * si.emitter(scene).eval(si, active) * mis * flight.transmittance
        if world.emission:
            sent = emission(si.bsdf(ray), si, active & si.is_valid(), whole=False)
            L += throughput * sent * flight.transmittance

        # Does the path go on? A pane is passed even where it may have no further vertex
        at_vertex, may_extend = active & (si.is_valid() | flight.collided), depth + 1 < max_depth
        active_next = at_vertex if world.straight else at_vertex & may_extend
        bsdf = si.bsdf(ray)

        # Sample an emitter: L += throughput f cos w L_e T / p
        active_em = active_next & may_extend & (flight.collided | mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth))
        ds, em_weight = sample_emitter(world, flight.point, sampler.next_2d(active_em), active_em)
        active_em &= ds.pdf != 0
        vertex = _vertex(world, sampler, ray, si, bsdf, flight, ds, active_next)
        mis = dr.select(ds.delta, 1, balance(ds.pdf, vertex.em_pdf))
        L += dr.select(active_em, throughput * vertex.em_value * em_weight * mis, 0)

        # Sample a direction: throughput *= f cos / p
        active_next &= may_extend | vertex.passed
        throughput *= dr.select(active_next, vertex.weight, 0)
        eta = eta * vertex.eta if world.glass else eta
        left = throughput * unpack(before) if world.dispersion else None
        ray = _onward(world, si, bsdf, flight, vertex.direction, left, at_vertex)

        # What the next vertex needs to know of this one, which a passed pane or gap is not
        prev_point = dr.select(vertex.passed, prev_point, mi.Interaction3f(flight.point))
        prev_pdf = dr.select(vertex.passed, prev_pdf, vertex.pdf)
        prev_delta = dr.select(vertex.passed, prev_delta, vertex.delta)
        depth += dr.select(vertex.passed, mi.UInt32(0), mi.UInt32(1))

        # Russian roulette, without the scaling by 1 / eta^2 that leaving glass undoes (Veach 1997, sections 5.2, 10.4)
        survival = dr.minimum(prior_throughput * dr.max(throughput) * (eta * eta), most)
        roulette = depth >= rr_depth
        active = active_next & (dr.max(throughput) != 0) & (~roulette | (sampler.next_1d(active_next) < survival))
        throughput = dr.select(roulette, throughput * dr.rcp(survival), throughput)
    return L


def _onward(world: World, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, flight: FreeFlight, direction: mi.Vector3f,
            left: mi.Color3f | None, at_vertex: mi.Bool) -> mi.Ray3f:
    """The ray that leaves a vertex; its time holds what glass has to know of the path. left: of the channels, where
    glass disperses."""
    ray = flight.point.spawn_ray(direction)
    if world.nested:
        inside = beyond(bsdf, si, inside_of(flight.point.time), direction, at_vertex & ~flight.collided)
        ray.time = time_of(left, inside)
    elif left is not None:
        ray.time = pack(left)
    return ray


def _vertex(world: World, sampler: mi.Sampler, ray: mi.Ray3f, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr,
            flight: FreeFlight, emitter: mi.DirectionSample3f, active: mi.Bool) -> PathVertex:
    """The vertex at the end of a ray: the surface that it meets, or the fog before it."""
    sample1, sample2 = sampler.next_1d(active), sampler.next_2d(active)

    # Surface
    value, pdf, bs, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, si.to_local(emitter.d), sample1, sample2,
                                                  active & ~flight.collided)
    passed = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null) if world.straight else mi.Bool(False)
    surface = PathVertex(em_value=value, em_pdf=pdf, direction=si.to_world(bs.wo), weight=weight, pdf=bs.pdf,
                         eta=bs.eta, delta=mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), passed=passed)
    if world.fog is None:
        return surface

    # Fog, whose phase function is its own density
    phase = world.fog.phase(dr.dot(ray.d, emitter.d))
    direction, pdf = world.fog.sample_phase(ray.d, sample2)
    albedo = mi.Color3f(world.fog.albedo)
    air = PathVertex(em_value=albedo * phase, em_pdf=phase, direction=direction, weight=albedo, pdf=pdf,
                     eta=mi.Float(1), delta=mi.Bool(False), passed=mi.Bool(False))
    return dr.select(flight.collided, air, surface)
