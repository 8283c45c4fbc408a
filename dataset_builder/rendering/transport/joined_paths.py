"""Camera paths joined with light paths: the estimator that finds bounced light from both of its ends.

Up to the second hit every sample of a pixel does everything: at the first and at the second surface it samples a light,
scatters, and links itself with a vertex of a light path. What comes after the second hit is followed by those few
samples that Russian roulette leaves, by what links leave to them (`joined_rest`). What lamps send to the camera over
glass and mirrors is found from their side alone (`light_image`). All techniques share each path as `weights` says.

    I = sum over techniques of w f .. / p,    S the same with a white Lambertian surface at the first hit

along the same paths, so that I = D S + specular holds for every one of them, see `integrator`.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from dataset_builder.rendering.surface.channels_left import kept, pack, unpack
from dataset_builder.rendering.surface.first_hit import emission, first_hit, mixture_pdf
from dataset_builder.rendering.surface.later_hit import vertex_hit
from dataset_builder.rendering.transport.integrator import Radiometry, choice_of_lobe, scattered
from dataset_builder.rendering.transport.joined_rest import Later, rest
from dataset_builder.rendering.transport.lamps import Lamps
from dataset_builder.rendering.transport.lane_numbers import LaneNumbers
from dataset_builder.rendering.transport.light_sampling import (
    World,
    balance,
    emitter_pdf,
    same_side,
    sample_emitter,
)
from dataset_builder.rendering.transport.links import LinkTable, arrive, choose
from dataset_builder.rendering.transport.path_tracer import PathStart
from dataset_builder.rendering.transport.sight import first_met
from dataset_builder.rendering.transport.weights import edge, light_sample, link, linked

CANDIDATES = (16, 4)
"""Light vertices that a link at the first and at the second hit chooses among."""
PAST = 1.5
"""Survival of a path after its second hit, times what is left to the camera side."""
LEAST = 0.4
"""Share of a path's light that camera paths are expected to find at least."""
TRUST = (0.5, 2.0)
"""How much links at the first and at the second hit count in the weights."""


class LightSide:
    """What camera paths need to know of the light paths; a plain class, which loops do not take for their state."""

    def __init__(self, lamps: Lamps, table: LinkTable, shape: mi.ShapePtr, share: mi.Float, splats: mi.Float):
        """shape: the one that light vertices lie on. share: of the light that comes from lamps, so that links can find
        it once it has bounced. splats: s_0, light paths of a set that are joined with the camera, per sample of a
        pixel; 0 where none are."""
        self.lamps, self.table, self.shape, self.share, self.splats = lamps, table, shape, share, splats

    def trust(self, group: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """s_1 and s_2 of the lanes of a set: candidates per vertex are links per light path."""
        count = dr.maximum(dr.gather(mi.UInt32, self.table.count, group), 1)
        per_path = self.table.paths / mi.Float(count)
        first, second = (trust * candidates * per_path for trust, candidates in zip(TRUST, CANDIDATES, strict=True))
        return first, second

    def left(self, links: mi.Float) -> mi.Float:
        """About what is left to camera paths where links have h = `links`, but no less than `LEAST`: what links find on
        average says little of the few bright paths that they miss."""
        return dr.maximum(1 - self.share + self.share / (1 + links / self.table.usual), LEAST)


def trace_joined(world: World, light: LightSide, sampler: mi.Sampler, free: mi.Sampler, ray: mi.Ray3f,
                 pixel_pdf: mi.Float, group: mi.UInt32, seed: int, in_step: bool = False) -> Radiometry:
    """One camera path per lane, all links and the rest of the path included, light joined with the camera not.

    sampler: random numbers of the first hit; free: those after it. pixel_pdf: density of the ray's direction among
    those of its pixel, per steradian. group: set of light paths of each lane. seed: 32 bits, of the rest of the paths.
    in_step: whether a lane's numbers for that are the same whatever becomes of others.
    """
    trust1, trust2 = light.trust(group)
    si, distance = first_met(world, ray, sampler, mi.Bool(True))

    # Emission of the first surface
    L_e = si.emitter(world.scene).eval(si)
    if world.emission:
        L_e += emission(si.bsdf(ray), si, si.is_valid(), whole=True)
    active = si.is_valid() & (world.max_depth > 1)

    # What is asked of the first surface: an emitter sample, a light vertex, and a scattered direction
    ds, em_weight = sample_emitter(world, si, sampler.next_2d(active), active)
    take_cosine, sample1, sample2 = choice_of_lobe(world, sampler, active)
    joint = choose(world, light.table, group, si, free.next_1d(active), sampler.next_1d(active), trust1, CANDIDATES[0],
                   active)
    hit = first_hit(si.bsdf(ray), si, [si.to_local(ds.d), si.to_local(joint.toward)], take_cosine, sample1, sample2,
                    active)
    emitter, joined = hit.towards

    # Emitter sample: the light has not bounced, so that only the scattered direction could find it, too
    mis = dr.select(ds.delta, 1, balance(ds.pdf, mixture_pdf(emitter.pdf, emitter.cosine, world.cosine_share)))
    direct = dr.select(active & (ds.pdf != 0), em_weight * mis, 0)

    # Link
    pdf = mixture_pdf(joined.pdf, joined.cosine, world.cosine_share)
    arrived = arrive(world, light.shape, joint, si, trust1, active & (pdf > 0) & (joint.edges + 2 <= world.max_depth))
    # Light paths leave no vertices on lamps
    splats = dr.select(si.emitter(world.scene) == None, light.splats, 0)  # noqa: E711
    r0 = edge(splats, dr.square(distance), pixel_pdf, dr.abs(dr.dot(si.n, ray.d)))
    others = _link(world, r0, si, ray.d, joint.toward, pdf) + trust2 * arrived.nearer
    bounced = arrived.light * linked(arrived.r / pdf, arrived.camera, others)

    # Scattered direction
    weight_image, weight_shading, start = scattered(world, si, hit, active & ~take_cosine)
    h0 = dr.select(start.delta, 0, _link(world, r0, si, ray.d, start.direction, start.pdf))
    going = active & ((start.pdf > 0) | start.delta)
    L_i, later, on = _second(world, light, free, group, start, h0, trust1, trust2, going)

    # Each layer by what of it each technique brings, and what the rest of the path will weigh in it
    none, diffuse = mi.Color3f(0), hit.diffuse
    terms = {"image": (L_e, emitter.value, joined.value, weight_image),
             "shading": (none, mi.Color3f(emitter.cosine), mi.Color3f(joined.cosine), weight_shading),
             "specular": (L_e, emitter.value - diffuse * emitter.cosine, joined.value - diffuse * joined.cosine,
                          weight_image - diffuse * weight_shading)}
    terms = {name: each for name, each in terms.items() if name in world.wanted}
    found = {name: sent + of_emitter * direct + of_link * bounced + of_direction * L_i
             for name, (sent, of_emitter, of_link, of_direction) in terms.items()}
    weights = {name: each[-1] * later.weight for name, each in terms.items()}

    # The rest of the path
    valid = si.is_valid()
    dr.eval(found, weights, later, on, valid)
    more = _followed(world, light, later, on, seed, in_step)
    whole = {name: each + dr.select(on, weights[name] * more, 0) for name, each in found.items()}
    return Radiometry(image=whole.get("image"), shading=whole.get("shading"), specular=whole.get("specular"), air=none,
                      valid=valid)


def _link(world: World, r: mi.Float, si: mi.SurfaceInteraction3f, came: mi.Vector3f, goes: mi.Vector3f,
          pdf: mi.Float) -> mi.Float:
    """h of the link that would end at a surface instead of the camera path that came along `came`."""
    return dr.select(same_side(world, si, came, goes), link(r, dr.abs(dr.dot(si.n, goes)), pdf), 0)


@dr.syntax
def _second(world: World, light: LightSide, free: mi.Sampler, group: mi.UInt32, start: PathStart, h0: mi.Float,
            trust1: mi.Float, trust2: mi.Float, active: mi.Bool) -> tuple[mi.Color3f, Later, mi.Bool]:
    """(radiance that arrives from up to the second hit, where the path goes on, whether it does)."""
    ray = start.point.spawn_ray(start.direction)
    if world.dispersion:
        ray.time = start.channels
    found, later, on, passed = _at_second(world, light, free, group, start, ray, h0, trust1, trust2, active)
    if world.straight:
        while passed:
            ray = mi.Ray3f(later.origin, later.direction)
            if world.dispersion:
                ray.time = pack(later.weight * unpack(start.channels))
            more, then, on_then, passed_then = _at_second(world, light, free, group, start, ray, h0, trust1, trust2,
                                                          passed)
            found += dr.select(passed, later.weight * more, 0)
            then.weight *= later.weight
            later = dr.select(passed, then, later)
            on |= passed & on_then
            passed &= passed_then
    return found, later, on


def _at_second(world: World, light: LightSide, free: mi.Sampler, group: mi.UInt32, start: PathStart, ray: mi.Ray3f,
               h0: mi.Float, trust1: mi.Float, trust2: mi.Float,
               active: mi.Bool) -> tuple[mi.Color3f, Later, mi.Bool, mi.Bool]:
    """One surface that the ray from the first hit meets: (radiance that arrives from it, where the path goes on,
    whether it does, whether the ray goes straight on)."""
    si = world.scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)

    # Emission of what the ray meets
    ds = mi.DirectionSample3f(world.scene, si, start.point)
    em_pdf = emitter_pdf(world, start.point, ds, active & ~start.delta)
    mis = dr.select(start.delta, 1, balance(start.pdf, em_pdf))
    found = si.emitter(world.scene).eval(si, active) * mis
    at_vertex = active & si.is_valid()
    if world.emission:
        found += emission(si.bsdf(ray), si, at_vertex, whole=False)
    extends = start.depth + 1 < world.max_depth
    active_next = at_vertex if world.straight else at_vertex & extends
    linking = at_vertex & extends

    # What is asked of the surface
    ds, em_weight = sample_emitter(world, si, free.next_2d(linking), linking)
    joint = choose(world, light.table, group, si, free.next_1d(linking), free.next_1d(linking), trust2, CANDIDATES[1],
                   linking)
    hit = vertex_hit(si.bsdf(ray), si, [si.to_local(ds.d), si.to_local(joint.toward)], free.next_1d(active_next),
                     free.next_2d(active_next), active_next)

    # Emitter sample
    distance_squared, cos_in = dr.squared_norm(si.p - start.point.p), dr.abs(dr.dot(si.n, ray.d))
    r1 = dr.select(start.delta, 0, edge(trust1, distance_squared, start.pdf, cos_in))
    here = dr.select(same_side(world, si, ray.d, ds.d), r1 * dr.abs(dr.dot(si.n, ds.d)), 0)
    mis = light_sample(ds.pdf, hit.pdfs[0], light.lamps.emitted(si, ds, linking), h0, here, ds.delta)
    found += dr.select(linking & (ds.pdf != 0), hit.values[0] * em_weight * mis, 0)

    # Link
    pdf = hit.pdfs[1]
    arrived = arrive(world, light.shape, joint, si, trust2,
                     linking & (pdf > 0) & (joint.edges + start.depth + 2 <= world.max_depth))
    others = h0 + _link(world, r1, si, ray.d, joint.toward, pdf)
    found += dr.select(linking, hit.values[1] * arrived.light * linked(arrived.r / pdf, arrived.camera, others), 0)

    # On from there, or straight on
    direction = si.to_world(hit.wo)
    h1 = dr.select(hit.delta, 0, _link(world, r1, si, ray.d, direction, hit.pdf))
    onward = si.spawn_ray(direction)
    worth = start.prior_throughput * dr.max(hit.weight) * dr.square(hit.eta)
    survival = dr.minimum(PAST * worth * light.left(h0 + h1), 1)
    passed = active_next & hit.passed
    on = active_next & extends & ~hit.passed & (dr.max(hit.weight) != 0) & (free.next_1d(active_next) < survival)
    weight = dr.select(hit.passed, hit.weight, hit.weight * dr.rcp(survival))
    if world.dispersion:
        weight *= kept(start.channels)
    later = Later(origin=onward.o, direction=onward.d, point=si.p, pdf=hit.pdf, delta=hit.delta, depth=start.depth + 1,
                  weight=weight, links=h0 + h1, trust=trust2, worth=worth)
    return found, later, on, passed


def _followed(world: World, light: LightSide, later: Later, on: mi.Bool, seed: int, in_step: bool) -> mi.Color3f:
    """Radiance that arrives at the second hit from where paths go on; the few lanes that do are packed together
    first."""
    lanes, width = dr.compress(on), dr.width(on)
    arrived = dr.zeros(mi.Color3f, width)
    if not dr.width(lanes):
        return arrived
    dr.make_opaque(arrived)
    if in_step:
        own: Any = LaneNumbers.of(lanes, seed)
        dr.make_opaque(own)
    else:
        own = mi.load_dict({"type": "independent"})
        own.seed(seed, dr.width(lanes))
    found = rest(world, light.lamps, light.left, own, dr.gather(Later, later, lanes))
    dr.scatter(arrived, found, lanes)
    return arrived
