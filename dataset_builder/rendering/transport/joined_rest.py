"""The rest of a camera path after its second hit, for the samples that Russian roulette leaves.

An ordinary path tracer, as `path_tracer` is, but for its weights: each path could have been found by links as well, see
`weights`. Nothing is linked here: links at the first two hits have found most of it already.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.channels_left import kept, pack
from dataset_builder.rendering.surface.first_hit import emission
from dataset_builder.rendering.surface.later_hit import vertex_hit
from dataset_builder.rendering.transport.lamps import Lamps
from dataset_builder.rendering.transport.lane_numbers import LaneNumbers
from dataset_builder.rendering.transport.light_sampling import (
    World,
    emitter_pdf,
    same_side,
    sample_emitter,
)
from dataset_builder.rendering.transport.weights import edge, light_sample, link, met_by_chance

MAX_SURVIVAL = 0.95
LATER = 2.0
"""Survival of a path from its third hit on, times what is left to the camera side."""


@dataclass
class Later:
    """Where a path goes on from its second hit, and what it was before."""

    origin: mi.Point3f
    direction: mi.Vector3f
    point: mi.Point3f
    """The second hit."""
    pdf: mi.Float
    """Density that the direction was drawn with there, per steradian."""
    delta: mi.Bool
    depth: mi.UInt32
    """Edges of the path so far, without this ray."""
    weight: mi.Color3f
    """f cos / p at the second hit, over the survival."""
    links: mi.Float
    """Sum of h of links at the camera and at the first hit."""
    trust: mi.Float
    """s of a link at the second hit."""
    worth: mi.Float
    """About what the path weighs in the picture: Russian roulette goes by it."""


@dr.syntax
def rest(world: World, lamps: Lamps, left: Callable[[mi.Float], mi.Float], sampler: mi.Sampler | LaneNumbers,
         start: Later) -> mi.Color3f:
    """Radiance that arrives at the second hit from the start's direction; every lane has one."""
    scene, max_depth, trust, worth, before = world.scene, world.max_depth, start.trust, start.worth, start.weight

    # Loop state
    ray = mi.Ray3f(start.origin, start.direction)   # Current ray
    L = mi.Color3f(0)                               # Radiance found so far
    throughput = mi.Color3f(1)                      # Product of f cos / p since the start
    if world.dispersion:
        ray.time = pack(before)
        throughput = kept(ray.time)
    eta = mi.Float(1)                               # Product of relative indices of refraction since the start
    depth = mi.UInt32(start.depth)                  # Edges of the path, without the current ray
    active = mi.Bool(True)                          # Active lanes
    prev_point = dr.zeros(mi.Interaction3f)         # Previous vertex
    prev_point.p = start.point
    prev_pdf = mi.Float(start.pdf)                  # Density that drew the ray's direction there, per steradian
    prev_delta = mi.Bool(start.delta)               # Whether a delta lobe drew it
    links = mi.Float(start.links)                   # Sum of h of all links that end before the previous vertex
    third = mi.Bool(True)                           # Whether the next vertex is the third hit

    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        cos_in = dr.abs(dr.dot(si.n, ray.d))

        # Emission of what the ray meets: L += throughput L_e w
        ds = mi.DirectionSample3f(scene, si, prev_point)
        em_pdf = emitter_pdf(world, prev_point, ds, active & ~prev_delta)
        a = lamps.emitted(prev_point, ds, active & si.is_valid())
        L += throughput * si.emitter(scene).eval(si, active) * met_by_chance(prev_pdf, em_pdf, a, links, prev_delta)
        if world.emission:
            L += throughput * emission(si.bsdf(ray), si, active & si.is_valid(), whole=False)

        # Does the path go on? A pane is passed even where it may have no further vertex
        at_vertex, may_extend = active & si.is_valid(), depth + 1 < max_depth
        active_next = at_vertex if world.straight else at_vertex & may_extend

        # Sample an emitter: L += throughput f cos w L_e / p
        active_em = active_next & may_extend
        ds, em_weight = sample_emitter(world, si, sampler.next_2d(active_em), active_em)
        hit = vertex_hit(si.bsdf(ray), si, [si.to_local(ds.d)], sampler.next_1d(active_next),
                         sampler.next_2d(active_next), active_next)
        r2 = dr.select(third & ~prev_delta, edge(trust, dr.squared_norm(si.p - prev_point.p), prev_pdf, cos_in), 0)
        here = dr.select(same_side(world, si, ray.d, ds.d), r2 * dr.abs(dr.dot(si.n, ds.d)), 0)
        mis = light_sample(ds.pdf, hit.pdfs[0], lamps.emitted(si, ds, active_em), links, here, ds.delta)
        L += dr.select(active_em & (ds.pdf != 0), throughput * hit.values[0] * em_weight * mis, 0)

        # Sample a direction: throughput *= f cos / p
        active_next &= may_extend | hit.passed
        direction = si.to_world(hit.wo)
        h2 = dr.select(hit.delta | ~same_side(world, si, ray.d, direction), 0,
                       link(r2, dr.abs(dr.dot(si.n, direction)), hit.pdf))
        throughput *= dr.select(active_next, hit.weight, 0)
        eta *= hit.eta
        ray = si.spawn_ray(direction)
        if world.dispersion:
            ray.time = pack(throughput * before)

        # What the next vertex needs to know of this one, which a passed pane or gap is not
        passed = hit.passed
        links += dr.select(passed, 0, h2)
        prev_point.p = dr.select(passed, prev_point.p, si.p)
        prev_pdf = dr.select(passed, prev_pdf, hit.pdf)
        prev_delta = dr.select(passed, prev_delta, hit.delta)
        depth += dr.select(passed, mi.UInt32(0), mi.UInt32(1))
        third &= passed

        # Russian roulette by what links leave
        survival = dr.minimum(LATER * worth * dr.max(throughput) * dr.square(eta) * left(links), MAX_SURVIVAL)
        active = active_next & (dr.max(throughput) != 0) & (sampler.next_1d(active_next) < survival)
        throughput *= dr.rcp(survival)
    return L
