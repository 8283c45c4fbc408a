"""Paths from the lamps: they leave a vertex on every surface that they meet, for camera paths to be joined with.

Vertices are written wherever there is room, and then put in the order of paths, so that no result depends on which lane
came first.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface.channels_left import pack
from dataset_builder.rendering.surface.later_hit import light_bounce
from dataset_builder.rendering.transport.lamps import Beginning, Lamps, emit
from dataset_builder.rendering.transport.light_sampling import World
from dataset_builder.seeding import derive_seed

MAX_SURVIVAL = 0.95
GRAZING = 1e-6
"""Cosine below which a surface is not lit."""
WIDTH, EDGES, BRIGHT, FLUX = 20, 13, 19, slice(6, 9)
"""Floats of a vertex, and which of them are its edges, `bright` and `flux`."""
DARK = 0.05
"""Albedo at least that a vertex counts as when links choose: lobes may send on more to where a link comes from."""
ROOM = 6
"""Vertices of a path that there is room for at first, on average."""


@dataclass
class LightPath:
    """State of a light path on its way."""

    o: mi.Point3f
    d: mi.Vector3f
    """The current ray."""
    flux: mi.Color3f
    """In watts."""
    edges: mi.UInt32
    """So far, the current ray not counted."""
    path: mi.UInt32
    """Number of the path over all sets."""
    prev: mi.Point3f
    """Previous vertex, or the place on the lamp."""
    cos_prev: mi.Float
    """Cosine there towards where the ray goes."""
    turn: mi.Float
    """cos_out / p of the previous vertex as a camera path passes it; 0 on the lamp and after a delta lobe."""
    pdf_prev: mi.Float
    """That p."""
    g_prev: mi.Float
    """g of the previous vertex."""
    camera: mi.Float
    """(H + N) of the path, see `weights`, once its first vertex has scattered."""
    begin: Beginning
    """Where it left its lamp."""


@dataclass
class LightVertex:
    """A vertex y_m of a light path, m edges from its lamp, as a camera path sees it that comes there and goes on to
    y_m-1 with density p."""

    p: mi.Point3f
    back: mi.Vector3f
    """Unit, to y_m-1."""
    flux: mi.Color3f
    """Of the path there, in watts."""
    uv: mi.Point2f
    """On its triangle."""
    camera: mi.Float
    """(H + N) of the path is camera + again / p, see `weights`."""
    again: mi.Float
    edges: mi.Float
    """m."""
    g: mi.Float
    """h of the link that would join y_m with y_m-1 is s g / p."""
    g2: mi.Float
    """h of the link that would join y_m-1 with y_m-2 is s g2."""
    facing: mi.Normal3f
    """Geometric normal on the side that the light comes from."""
    bright: mi.Float
    """Flux times about what the surface sends on."""
    prim: mi.UInt32
    """Its triangle."""
    path: mi.UInt32


@dataclass(frozen=True, kw_only=True, eq=False)
class LightVertices:
    """The vertices of several independent sets of light paths, by set, and on the host.

    paths: of each set. values: (V, 20) of the fields of `LightVertex` in order; prim, path: (V,).
    """

    paths: int
    sets: int
    values: np.ndarray
    prim: np.ndarray
    path: np.ndarray


def trace_light(world: World, lamps: Lamps, *, sets: int, seed: int) -> LightVertices:
    """Vertices of the light paths of each of `sets`. seed: 64 bits."""
    paths = int(lamps.paths.sum())
    room = ROOM * paths * sets
    while True:
        state, sampler = _set_out(lamps, sets, seed), mi.load_dict({"type": "independent"})
        sampler.seed(derive_seed(seed, "bounces") & 0xFFFFFFFF, paths * sets)
        values, numbers = dr.empty(mi.Float, room * WIDTH), dr.empty(mi.UInt32, 2 * room)
        taken = dr.zeros(mi.UInt32, 1)
        dr.make_opaque(values, numbers, taken)
        dr.eval(_walk(world, state, sampler, values, numbers, taken, dr.opaque(mi.UInt32, room)))
        count = int(taken[0])
        if count <= room:
            break
        room = count
    rows, pairs = np.array(values).reshape(-1, WIDTH)[:count], np.array(numbers).reshape(-1, 2)[:count]
    order = np.lexsort((rows[:, EDGES], pairs[:, 1]))
    return LightVertices(paths=paths, sets=sets, values=rows[order], prim=pairs[order, 0], path=pairs[order, 1])


@dr.syntax
def _walk(world: World, state: LightPath, sampler: mi.Sampler, values: mi.Float, numbers: mi.UInt32, taken: mi.UInt32,
          room: mi.UInt32) -> mi.UInt32:
    """All paths from their lamps to their ends; vertices go wherever there is room, in any order."""
    active = mi.Bool(dr.max(state.flux) > 0)
    while active:
        vertex, lit, state, active = _bounce(world, state, sampler, active)
        row = dr.scatter_inc(taken, mi.UInt32(0), lit)
        lit &= row < room
        flat = [*vertex.p, *vertex.back, *vertex.flux, *vertex.uv, vertex.camera, vertex.again, vertex.edges, vertex.g,
                vertex.g2, *vertex.facing, vertex.bright]
        for k, value in enumerate(flat):
            dr.scatter(values, value, row * WIDTH + k, lit)
        dr.scatter(numbers, vertex.prim, row * 2, lit)
        dr.scatter(numbers, vertex.path, row * 2 + 1, lit)
    return state.path


def _set_out(lamps: Lamps, sets: int, seed: int) -> LightPath:
    """Every path at its lamp, in strata: of each set as many as `lamps` says."""
    lamp, paths = np.repeat(np.arange(len(lamps.paths)), lamps.paths), int(lamps.paths.sum())
    lanes = paths * sets
    share = paths / lamps.paths[lamp]
    strata = mi.load_dict({"type": "multijitter", "sample_count": paths})
    strata.set_samples_per_wavefront(paths)
    strata.seed(derive_seed(seed, "lamps") & 0xFFFFFFFF, lanes)
    e = emit(lamps, owned(mi.UInt32, np.tile(lamp, sets).astype(np.uint32)),
             owned(mi.Float, np.tile(share, sets).astype(np.float32)), strata.next_2d(), strata.next_2d())
    zeros = [dr.zeros(mi.Float, lanes) for _ in range(5)]
    state = LightPath(o=e.ray.o, d=e.ray.d, flux=e.flux, edges=dr.zeros(mi.UInt32, lanes),
                      path=dr.arange(mi.UInt32, lanes), prev=mi.Point3f(e.begin.p), cos_prev=zeros[0], turn=zeros[1],
                      pdf_prev=zeros[2], g_prev=zeros[3], camera=zeros[4], begin=e.begin)
    dr.make_opaque(state)
    return state


def _bounce(world: World, state: LightPath, sampler: mi.Sampler,
            active: mi.Bool) -> tuple[LightVertex, mi.Bool, LightPath, mi.Bool]:
    """(vertex, whether there is one, the path from there on, whether it goes on)."""
    ray, begin = mi.Ray3f(state.o, state.d), state.begin
    if world.dispersion:
        ray.time = pack(state.flux)
    found = world.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    si = found.compute_surface_interaction(ray, mi.RayFlags.All, active)
    back, cos_back = -ray.d, dr.abs(dr.dot(si.n, ray.d))
    lit = active & si.is_valid() & (cos_back > GRAZING) & (si.emitter(world.scene) == None)  # noqa: E711
    distance_squared = dr.squared_norm(si.p - state.prev)

    # What a light sample would have been at the first vertex: a = share / (pi A), or share / (solid angle d^2)
    first = state.edges == 0
    light = begin.seen_from(si.p)
    a = begin.a * dr.select(light.delta, dr.rcp(distance_squared), 1)
    sampled = dr.select(light.delta, begin.lone, world.scene.pdf_emitter_direction(si, light, lit & first))
    camera = dr.select(first, dr.select(light.delta, 0, dr.rcp(a)), state.camera)
    again = dr.select(first, sampled / a, 0)

    # Links that end nearer to the lamp
    g = dr.select(state.turn > 0, distance_squared * state.turn / state.cos_prev, 0)
    g2 = dr.select(state.pdf_prev > 0, state.g_prev / state.pdf_prev, 0)

    # On from there
    out = light_bounce(si.bsdf(ray), si, sampler.next_1d(lit), sampler.next_2d(lit), lit)
    direction = si.to_world(out.wo)
    facing = mi.Normal3f(dr.mulsign(mi.Vector3f(si.n), dr.dot(si.n, back)))
    albedo = dr.select(out.delta | out.passed, 0, _brightness(out.weight))
    vertex = LightVertex(p=si.p, back=back, flux=state.flux, uv=found.prim_uv, camera=camera, again=again,
                         edges=mi.Float(state.edges + 1), g=g, g2=g2, facing=facing, prim=found.prim_index,
                         path=state.path, bright=_brightness(state.flux) * dr.maximum(albedo, DARK))
    survival = dr.minimum(dr.max(out.weight), MAX_SURVIVAL)
    passed = out.passed
    alive = lit & (sampler.next_1d(lit) < survival) & (state.edges + dr.select(passed, 1, 2) < world.max_depth)
    linkable = (out.pdf > 0) & (world.transmits | (dr.dot(facing, direction) > 0))
    next_ray = si.spawn_ray(direction)
    onward = LightPath(
        o=next_ray.o, d=next_ray.d, flux=state.flux * out.weight * dr.rcp(survival),
        edges=state.edges + dr.select(passed, mi.UInt32(0), 1), path=state.path,
        prev=dr.select(passed, state.prev, si.p),
        cos_prev=dr.select(passed, state.cos_prev, dr.abs(dr.dot(si.n, direction))),
        turn=dr.select(passed, state.turn, dr.select(linkable, cos_back / out.pdf, 0)),
        pdf_prev=dr.select(passed, state.pdf_prev, out.pdf), g_prev=dr.select(passed, state.g_prev, g),
        camera=dr.select(passed, state.camera, camera + dr.select(out.pdf > 0, again / out.pdf, 0)),
        begin=begin)
    return vertex, lit, onward, alive


def _brightness(colour: mi.Color3f) -> mi.Float:
    """Mean of the channels; `dr.mean` makes the number of lanes a literal of the kernel."""
    return (colour.x + colour.y + colour.z) * (1 / 3)
