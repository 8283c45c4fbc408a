"""Glass in glass: which bodies a path is in, and what is on both sides of a surface that it meets.

Of the bodies that take the same space the one of the highest priority owns it (Schmidt and Budge, "Simple nested
dielectrics in ray traced images", Journal of Graphics Tools 7(2), 2002). A path counts how many times it is in each
body, in 3 bits; bodies are numbered from 1 in the order of priority, so that the owner is the highest count above 0.
A surface that does not change the owner is not there. Rays hold the counts in their time, above the nine bits of what
is left of the colour channels: single precision holds all whole numbers up to 2^24.

Paths start in the air. One that leaves a body that it never entered, as from a camera in the glass, is taken to have
been in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.assets.glass_bodies import MOST_BODIES, GlassBody
from dataset_builder.rendering.surface.channels_left import pack, unpack

BITS, MOST = 3, 7
"""Of a count."""
CHANNEL_BITS = 3
"""Of what is left of a channel."""
COUNTS = 2 ** (3 * CHANNEL_BITS)
"""What a ray's time holds the counts times; below are the channels."""
ROW = 8
"""Floats of a body: index of refraction, Abbe number, root of the tint (3), unused."""


@dataclass
class Sides:
    """What is on the other side of a body's surface from the body itself: air, or another body."""

    ior: mi.Float
    abbe: mi.Float
    tint: mi.Color3f
    """What a crossing leaves on its account."""
    into: mi.Bool
    """Whether light that goes on from the viewer's side goes into the body, not out of it."""
    same: mi.Bool
    """Whether one body owns both sides."""


def body_rows(bodies: Sequence[GlassBody]) -> np.ndarray:
    """(MOST_BODIES + 1, ROW) float32: the air, and the bodies in order."""
    rows = np.zeros((MOST_BODIES + 1, ROW), dtype=np.float32)
    rows[:, 0], rows[:, 2:5] = 1, 1
    for row, body in zip(rows[1:], bodies, strict=False):
        row[:5] = (body.ior, body.abbe, *np.sqrt(body.tint))
    return rows


def left_of(time: mi.Float) -> mi.Color3f:
    """What is left of the channels, as `channels_left.unpack` has it, of a path whose ray's time this is."""
    return unpack(mi.Float(mi.UInt32(time) & (COUNTS - 1)), CHANNEL_BITS)


def inside_of(time: mi.Float) -> mi.UInt32:
    """The counts that a ray's time holds."""
    return mi.UInt32(time) // COUNTS


def time_of(left: mi.Color3f | None, inside: mi.UInt32) -> mi.Float:
    """The time of a ray that holds both. left: of the channels, None where no glass disperses."""
    return (mi.Float(0) if left is None else pack(left, CHANNEL_BITS)) + mi.Float(COUNTS * inside)


def owner(inside: mi.UInt32) -> mi.UInt32:
    """Number of the body that owns where a path is; 0 in the air."""
    return dr.select(inside == 0, 0, (31 - dr.lzcnt(inside)) // BITS + 1)


def crossed(inside: mi.UInt32, body: mi.UInt32, entering: mi.Bool) -> mi.UInt32:
    """Counts beyond a surface of a body; body 0 has none."""
    shift = BITS * (dr.maximum(body, 1) - 1)
    one, count = dr.select(body > 0, mi.UInt32(1) << shift, 0), (inside >> shift) & MOST
    return dr.select(entering, inside + dr.select(count < MOST, one, 0), inside - dr.select(count > 0, one, 0))


def sides_of(rows: mi.Float, body: mi.UInt32, inside: mi.UInt32, outside: mi.Bool) -> Sides:
    """What a path in `inside` finds at a surface of a body. outside: whether it comes from the body's outer side.
    Body 0 knows no other: it has air around it."""
    left = (inside >> (BITS * (dr.maximum(body, 1) - 1))) & MOST
    inside = dr.select(~outside & (left == 0), crossed(inside, body, mi.Bool(True)), inside)
    before, after = owner(inside), owner(crossed(inside, body, outside))
    known = body > 0
    into = dr.select(known, after == body, outside)
    other = dr.select(known, dr.select(into, before, after), 0)
    row = [dr.gather(mi.Vector4f, rows, 2 * other + half) for half in range(2)]
    return Sides(ior=row[0].x, abbe=row[0].y, tint=mi.Color3f(row[0].z, row[0].w, row[1].x), into=into,
                 same=known & (before == after))


def beyond(bsdf: mi.BSDFPtr, si: mi.SurfaceInteraction3f, inside: mi.UInt32, direction: mi.Vector3f,
           active: mi.Bool) -> mi.UInt32:
    """Counts of a path that was in `inside` and leaves a surface in a direction, of any BSDF pointer; active: whether
    there is a surface."""
    body = dr.select(active, dr.dispatch(bsdf, _body, si, active), 0)
    came = dr.dot(si.to_world(si.wi), si.n)
    through = came * dr.dot(direction, si.n) < 0
    return dr.select(through, crossed(inside, body, came > 0), inside)


def _body(bsdf: mi.BSDF, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.UInt32:
    return bsdf.body(si, active) if hasattr(bsdf, "body") else mi.UInt32(0)
