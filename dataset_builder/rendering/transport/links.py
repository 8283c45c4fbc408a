"""Links: a vertex of a camera path joined with one of a light path by a shadow ray.

A link is made in two steps. M candidates, spread evenly over the vertices of the lane's set, are weighed by what they
would send to a white surface if nothing stood between; one is chosen in proportion, and joined (resampled importance
sampling: Talbot, Cline and Egbert, "Importance resampling for global illumination", EGSR 2005). The estimate is
unbiased whatever the weights, as long as they are positive where light comes from. Vertices lie in the table by set,
then by the side that they face, then along a Z curve, so that candidates which are spread over the table are spread
over the scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.surface.first_hit import transparency
from dataset_builder.rendering.transport.light_paths import LightVertices
from dataset_builder.rendering.transport.light_sampling import World, straight_on, to_its_end
from dataset_builder.rendering.transport.weights import edge

MIN_COSINE = 0.05
"""Cosine at the camera's side at least, in the choice alone: 0 where light comes from would be bias."""
BRIEF, FULL = 8, 16
"""Floats of a vertex that the choice reads, and that the link reads."""
CODE_BITS = 10
"""Of the Z curve along each axis."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkTable:
    """Light vertices on the device, in the order of the choice."""

    brief: mi.Float
    """Position, normal, brightness, (H + N)."""
    full: mi.Float
    """Position, direction back, flux, barycentric coordinates, camera, again, edges, g, one unused."""
    prim: mi.UInt32
    first: mi.UInt32
    """First row of each set."""
    count: mi.UInt32
    """Rows of each set."""
    paths: mi.Float
    """Light paths in each set."""
    usual: mi.Float
    """(H + N) of a path in the middle of all, by which paths are expected to be found from the camera."""


@dataclass
class Joint:
    """The light vertex chosen, as a camera vertex sees it."""

    p: mi.Point3f
    back: mi.Vector3f
    flux: mi.Color3f
    uv: mi.Point2f
    camera: mi.Float
    again: mi.Float
    edges: mi.UInt32
    g: mi.Float
    prim: mi.UInt32
    chosen: mi.Float
    """1 / probability of the choice, over light paths: what one link counts for; 0 where there is none."""
    toward: mi.Vector3f
    distance_squared: mi.Float


@dataclass
class Arrived:
    """What a link brings, but for what the camera's vertex does to it."""

    light: mi.Color3f
    """Radiance times solid angle: times f cos it is a contribution, but for its weight."""
    r: mi.Float
    """h of the link is r / p, p the camera path's density towards it; with cos_out and p of the light vertex in it."""
    camera: mi.Float
    """(H + N) of the path."""
    nearer: mi.Float
    """h, per s, of the link that would end one vertex nearer to the lamp."""


def table_of(found: LightVertices) -> LinkTable:
    """Upload the vertices of all sets."""
    values, sets = found.values, found.path // found.paths
    position, facing, bright = values[:, 0:3], values[:, 16:19], values[:, 19:20]
    order = np.argsort(_place(position, facing) | (sets.astype(np.uint64) << np.uint64(33)), kind="stable")
    count, last = np.bincount(sets, minlength=found.sets), max(len(values) - 1, 0)
    cos_back = np.einsum("ij,ij->i", facing, values[:, 3:6])[:, None]
    camera = values[:, 11:12] + values[:, 12:13] * np.pi / np.maximum(cos_back, 1e-6)
    brief = np.concatenate([position, facing, bright, camera], axis=1)[order]
    full = np.concatenate([values[:, :15], np.zeros((len(values), 1), np.float32)], axis=1)[order]
    return LinkTable(brief=_floats(brief), full=_floats(full), prim=owned(mi.UInt32, _or_one(found.prim[order])),
                     first=owned(mi.UInt32, np.minimum(np.cumsum(count) - count, last).astype(np.uint32)),
                     count=owned(mi.UInt32, count.astype(np.uint32)),
                     paths=dr.opaque(mi.Float, found.paths),
                     usual=dr.opaque(mi.Float, float(np.median(camera)) if len(camera) else 1.0))


def _place(position: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """(V,) place in a set: by the side that a vertex faces, then along a Z curve."""
    if not len(position):
        return np.zeros(0, dtype=np.uint64)
    low, high = position.min(axis=0), position.max(axis=0)
    cell = ((position - low) / np.maximum(high - low, 1e-9) * (2**CODE_BITS - 1)).astype(np.uint64)
    code = np.zeros(len(position), dtype=np.uint64)
    for bit in range(CODE_BITS):
        for axis in range(3):
            code |= ((cell[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    axis = np.abs(facing).argmax(axis=1)
    side = axis * 2 + (facing[np.arange(len(facing)), axis] > 0)
    return code | (side.astype(np.uint64) << np.uint64(3 * CODE_BITS))


def choose(world: World, table: LinkTable, group: mi.UInt32, si: mi.SurfaceInteraction3f, offset: mi.Float,
           pick: mi.Float, trust: mi.Float, candidates: int, active: mi.Bool) -> Joint:
    """One of `candidates` light vertices for each lane. offset: uniform, where in the table they begin. pick: uniform,
    which of them is taken. trust: s of the link."""
    first, count = (dr.gather(mi.UInt32, each, group) for each in (table.first, table.count))
    normal = dr.select(mi.Frame3f.cos_theta(si.wi) < 0, -mi.Vector3f(si.sh_frame.n), mi.Vector3f(si.sh_frame.n))
    rows, weights, trusted, last = [], [], trust * (dr.pi * dr.pi), dr.maximum(count, 1) - 1
    for j in range(candidates):
        row = first + dr.minimum(mi.UInt32((offset + j) / candidates * mi.Float(count)), last)
        a, b = (dr.gather(mi.Vector4f, table.brief, row * 2 + k, active) for k in (0, 1))
        way = mi.Vector3f(a.x, a.y, a.z) - si.p
        distance_squared = dr.squared_norm(way)
        inverse = dr.rsqrt(distance_squared)
        cos, cos_there = dr.dot(normal, way) * inverse, -dr.dot(mi.Vector3f(a.w, b.x, b.y), way) * inverse
        if world.transmits:
            cos, cos_there = dr.abs(cos), dr.abs(cos_there)
        geometry = dr.maximum(cos, MIN_COSINE) * cos_there / distance_squared
        weight = b.z * geometry * trusted / (trusted + b.w * geometry)
        rows.append(row)
        weights.append(dr.select((cos > 0) & (cos_there > 0) & (distance_squared > 0), weight, 0))
    total, best, taken, passed = sum(weights, mi.Float(0)), mi.Float(0), mi.UInt32(first), mi.Float(0)
    for row, weight in zip(rows, weights, strict=True):
        take = (weight > 0) & (pick * total >= passed)
        best, taken = dr.select(take, weight, best), dr.select(take, row, taken)
        passed += weight
    share = mi.Float(count) / (table.paths * candidates)
    return _joint(table, taken, dr.select(best > 0, share * total / best, 0), si, active)


def _joint(table: LinkTable, row: mi.UInt32, chosen: mi.Float, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Joint:
    q = [dr.gather(mi.Vector4f, table.full, row * 4 + k, active) for k in range(4)]
    p = mi.Point3f(q[0].x, q[0].y, q[0].z)
    way = p - si.p
    distance_squared = dr.squared_norm(way)
    return Joint(p=p, back=mi.Vector3f(q[0].w, q[1].x, q[1].y), flux=mi.Color3f(q[1].z, q[1].w, q[2].x),
                 uv=mi.Point2f(q[2].y, q[2].z), camera=q[2].w, again=q[3].x, edges=mi.UInt32(q[3].y), g=q[3].z,
                 prim=dr.gather(mi.UInt32, table.prim, row, active), chosen=chosen,
                 toward=way * dr.rsqrt(distance_squared), distance_squared=distance_squared)


def arrive(world: World, shape: mi.ShapePtr, joint: Joint, si: mi.SurfaceInteraction3f, trust: mi.Float,
           active: mi.Bool) -> Arrived:
    """What the chosen vertex sends to a camera vertex; nothing where something opaque stands between."""
    active = active & (joint.chosen > 0) & (joint.distance_squared > 0)

    # The surface there, as seen from here
    look = mi.Ray3f(si.p, joint.toward)
    found = dr.zeros(mi.PreliminaryIntersection3f)
    found.t, found.prim_uv, found.prim_index, found.shape = dr.sqrt(joint.distance_squared), joint.uv, joint.prim, shape
    found.valid = active
    there = found.compute_surface_interaction(look, mi.RayFlags.All, active)

    # What stands between, up to just before it
    end = there.spawn_ray(-joint.toward).o
    if world.straight:
        light = straight_on(world.scene, si, end, transparency, active, to_its_end)
    else:
        hidden = world.scene.ray_test(to_its_end(si, end), coherent=False, active=active)
        light = mi.Color3f(dr.select(hidden, 0, 1))
    cos_in, cos_out = dr.dot(there.n, joint.toward), dr.dot(there.n, joint.back)
    active &= (dr.abs(cos_out) > 0) & (world.transmits | (cos_in * cos_out < 0))
    cos_in, cos_out = dr.abs(cos_in), dr.abs(cos_out)
    value, pdf = there.bsdf(look).eval_pdf(mi.BSDFContext(), there, there.to_local(joint.back), active)

    # flux f cos_s / cos_n, as radiance from the surface's solid angle
    light *= joint.flux * value * (joint.chosen * cos_in / (joint.distance_squared * cos_out))
    inverse = dr.select(pdf > 0, dr.rcp(pdf), 0)
    return Arrived(light=dr.select(active & (pdf > 0), light, 0),
                   r=edge(trust, joint.distance_squared, mi.Float(1), cos_in) * cos_out * inverse,
                   camera=joint.camera + joint.again * inverse, nearer=joint.g * inverse)


def _floats(rows: np.ndarray) -> mi.Float:
    return owned(mi.Float, _or_one(rows).astype(np.float32).ravel())


def _or_one(rows: np.ndarray) -> np.ndarray:
    """At least one row, which an empty set is read from in vain."""
    return rows if len(rows) else np.zeros((1, *rows.shape[1:]), dtype=rows.dtype)
