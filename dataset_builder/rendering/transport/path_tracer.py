"""The path tracer that follows light from where the first hit, or the air before it, sends a ray.

Lights are sampled at every vertex and met by chance, combined by multiple importance sampling (Veach, "Robust Monte
Carlo methods for light transport simulation", 1997, sections 9.2 and 10.4). Vertices are surfaces or, in fog, points of
the air; panes that a ray passes straight are no vertices, so that both ways to the light behind them stay comparable.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.transport.light_sampling import Air, World, balance, carried, cross_air, sample_light

MAX_SURVIVAL = 0.95


@dataclass
class Start:
    """A ray that leaves `point` along `direction`, drawn with `density`; delta: there was no other choice.

    edges: of the path so far, this one included if it ends somewhere. scale: weight that the result gets, which Russian
    roulette goes by. carried: see `transport.carried`.
    """

    point: mi.Interaction3f
    direction: mi.Vector3f
    density: mi.Float
    delta: mi.Bool
    edges: mi.UInt32
    scale: mi.Float
    carried: mi.Float


@dataclass
class Bounce:
    """A vertex: f cos and its density for the sampled light; the direction after it with weight and density, its change
    of the index of refraction; delta: no light sample could have made it; passed: it goes on straight through a pane.
    """

    em_value: mi.Color3f
    em_density: mi.Float
    direction: mi.Vector3f
    weight: mi.Color3f
    density: mi.Float
    eta: mi.Float
    delta: mi.Bool
    passed: mi.Bool


@dr.syntax
def follow(world: World, sampler: mi.Sampler, start: Start, active: mi.Bool) -> mi.Color3f:
    """Radiance that arrives at the start's point from its direction; throughput starts at one."""
    scene, max_depth, rr_depth, scale = world.scene, world.max_depth, world.rr_depth, start.scale
    ray = start.point.spawn_ray(start.direction)
    if world.dispersion:
        ray.time = start.carried
    result, throughput, eta = mi.Color3f(0), mi.Color3f(1), mi.Float(1)
    depth, active = mi.UInt32(start.edges), mi.Bool(active)
    prev_si, prev_pdf, prev_delta = mi.Interaction3f(start.point), mi.Float(start.density), mi.Bool(start.delta)
    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
        air = cross_air(world, ray, si, sampler, active)

        # Emitter met by the ray
        ds = mi.DirectionSample3f(scene, si, prev_si)
        em_pdf = scene.pdf_emitter_direction(prev_si, ds, ~prev_delta)
        mis = dr.select(prev_delta, 1, balance(prev_pdf, em_pdf))
        result += throughput * si.emitter(scene).eval(si, active) * mis * air.transmittance

        # Light sampled from here; a pane is passed even where the path may have no further vertex
        here, more = active & (si.is_valid() | air.collided), depth + 1 < max_depth
        active_next = here if world.thin else here & more
        bsdf = si.bsdf(ray)
        active_em = active_next & more & (air.collided | mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth))
        ds, em_weight = sample_light(world, air.point, sampler.next_2d(active_em), active_em)
        active_em &= ds.pdf != 0
        bounce = _bounce(world, sampler, ray, si, bsdf, air, ds, active_next)
        mis = dr.select(ds.delta, 1, balance(ds.pdf, bounce.em_density))
        result += dr.select(active_em, throughput * bounce.em_value * em_weight * mis, 0)

        # Scattered direction and Russian roulette
        active_next &= more | bounce.passed
        throughput *= dr.select(active_next, bounce.weight, 0)
        eta = eta * bounce.eta if world.glass else eta
        ray = air.point.spawn_ray(bounce.direction)
        if world.dispersion:
            ray.time = carried(throughput)
        prev_si = dr.select(bounce.passed, prev_si, mi.Interaction3f(air.point))
        prev_pdf = dr.select(bounce.passed, prev_pdf, bounce.density)
        prev_delta = dr.select(bounce.passed, prev_delta, bounce.delta)
        depth += dr.select(bounce.passed, mi.UInt32(0), mi.UInt32(1))
        survive = dr.minimum(scale * dr.max(throughput) * (eta * eta), MAX_SURVIVAL)
        roulette = depth >= rr_depth
        active = active_next & (dr.max(throughput) != 0) & (~roulette | (sampler.next_1d(active_next) < survive))
        throughput = dr.select(roulette, throughput * dr.rcp(survive), throughput)
    return result


def _bounce(world: World, sampler: mi.Sampler, ray: mi.Ray3f, si: mi.SurfaceInteraction3f, bsdf: mi.BSDFPtr, air: Air,
            light: mi.DirectionSample3f, active: mi.Bool) -> Bounce:
    """The vertex at the end of a ray: the surface that it meets, or the fog before it."""
    sample1, sample2 = sampler.next_1d(active), sampler.next_2d(active)
    value, pdf, bs, weight = bsdf.eval_pdf_sample(mi.BSDFContext(), si, si.to_local(light.d), sample1, sample2,
                                                  active & ~air.collided)
    passed = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null) if world.thin else mi.Bool(False)
    bounce = Bounce(em_value=value, em_density=pdf, direction=si.to_world(bs.wo), weight=weight, density=bs.pdf,
                    eta=bs.eta, delta=mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta), passed=passed)
    if world.fog is None:
        return bounce
    phase = world.fog.phase(dr.dot(ray.d, light.d))
    direction, density = world.fog.scatter(ray.d, sample2)
    albedo = mi.Color3f(world.fog.albedo)
    floating = Bounce(em_value=albedo * phase, em_density=phase, direction=direction, density=density, weight=albedo,
                      eta=mi.Float(1), delta=mi.Bool(False), passed=mi.Bool(False))
    return dr.select(air.collided, floating, bounce)
