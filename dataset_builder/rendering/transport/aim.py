"""Light paths aimed at what throws caustics: spheres about smooth glass, metal and coats, and directions towards them.

A caustic is a small share of what a lamp sends, gathered in a small place: by the cosine, few paths find it. So where
a lamp's point y0 has spheres in front of it, a direction d is drawn from the mixture

    p(d) = (1 - g) p_0(d) + g sum_k q_k p_k(d),    p_k(d) = 1 / (2 pi (1 - sqrt(1 - s_k^2))) if d meets sphere k, else 0

p_0 the lamp's own density, see `lamps`, g = `SHARE`, s_k = radius / distance of sphere k, p_k even over the cone about
it, q_k in proportion to the light it gets: pi s_k^2 by a form factor, which is cos for a sphere all above the surface
and (cos + s)^2 / (4 s) for one that is cut by its horizon, the least parabola that is 0 below it. A lamp without a size
weighs spheres by their solid angle, a spot those that its beam meets. A sphere that y0 lies in is not aimed at, for the
lamp's own directions are as good; where none is left, g is 0.

Nothing but noise depends on the spheres: they may miss what throws caustics, or hold much else.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.buffers import owned

SHARE = 0.5
"""g: of a lamp's paths, those that are aimed."""
NONE = 0xFFFFFFFF
"""Number of no sphere."""


@dataclass
class Outlook:
    """A place on a lamp, and where light goes from there."""

    p: mi.Point3f
    axis: mi.Vector3f
    """Unit: the normal, or the axis of a spot."""
    limit: mi.Float
    """Cosine of the widest angle to the axis: 0 of a surface, -1 of a point."""
    lone: mi.Bool
    """Whether the lamp has no size."""


@dataclass
class Cone:
    """Directions from a place to a sphere."""

    way: mi.Vector3f
    """To its centre."""
    radius: mi.Float
    height: mi.Float
    """1 - cosine of half the angle of the cone."""
    weight: mi.Float
    """q_k, times something that is the same for all spheres."""

    def pdf(self, direction: mi.Vector3f, drawn: mi.Bool) -> mi.Float:
        """p_k. drawn: whether the direction was drawn from the cone, which rounding shall not deny: beside a narrow one
        the density is many times less."""
        meets = dr.squared_norm(dr.cross(direction, self.way)) <= dr.square(self.radius)
        return dr.select(drawn | (meets & (dr.dot(direction, self.way) > 0)), dr.inv_two_pi / self.height, 0)


class Aim:
    """The spheres, on the device; a plain class, which loops do not take for their state."""

    def __init__(self, spheres: np.ndarray):
        """spheres: (K, 4) centre and radius."""
        self.spheres = owned(mi.Float, np.concatenate([spheres, np.zeros((1, 4))]).astype(np.float32))
        self.count = dr.opaque(mi.UInt32, len(spheres))

    def cone(self, k: mi.UInt32, outlook: Outlook, active: mi.Bool) -> Cone:
        """What is seen of sphere k."""
        row = dr.gather(mi.Vector4f, self.spheres, k, active)
        way, radius = mi.Point3f(row.x, row.y, row.z) - outlook.p, row.w
        distance_squared = dr.squared_norm(way)
        sine_squared = dr.square(radius) / distance_squared
        sine, edge = dr.sqrt(sine_squared), dr.safe_sqrt(1 - sine_squared)
        height, cos = sine_squared / (1 + edge), dr.dot(outlook.axis, way) * dr.rsqrt(distance_squared)
        cut = dr.select(cos > -sine, dr.square(cos + sine) / (4 * sine), 0)
        lit = sine_squared * dr.select(cos >= sine, cos, cut)

        # A beam meets the cone if the angle to its centre is less than the sum of both angles
        meets = (edge <= -outlook.limit) | (cos > outlook.limit * edge - dr.safe_sqrt(1 - outlook.limit**2) * sine)
        seen = dr.select(outlook.lone, dr.select(meets, 2 * height, 0), lit)
        outside = active & (sine_squared > 0) & (sine_squared < 1)
        return Cone(way=way, radius=radius, height=dr.select(outside, height, 1), weight=dr.select(outside, seen, 0))


@dr.syntax
def aimed(aim: Aim, outlook: Outlook, direction: mi.Vector3f, sphere: mi.UInt32,
          active: mi.Bool) -> tuple[mi.Float, mi.Float]:
    """(g, g sum q_k p_k) of a unit direction. sphere: the one that it was aimed at, `NONE` if unknown."""
    k, total, towards = mi.UInt32(0), mi.Float(0), mi.Float(0)
    active = mi.Bool(active)
    while active & (k < aim.count):
        cone = aim.cone(k, outlook, active)
        total += cone.weight
        towards += cone.weight * cone.pdf(direction, k == sphere)
        k += 1
    share = dr.select(total > 0, mi.Float(SHARE), 0)
    return share, dr.select(total > 0, SHARE * towards / total, 0)


@dr.syntax
def take_aim(aim: Aim, outlook: Outlook, sample: mi.Point2f) -> tuple[mi.UInt32, mi.Vector3f, mi.Point2f]:
    """(sphere aimed at or `NONE`, a direction to it, random numbers for the lamp's own direction where there is none).
    sample: uniform; strata in it stay strata."""
    k, total = mi.UInt32(0), mi.Float(0)
    while k < aim.count:
        total += aim.cone(k, outlook, mi.Bool(True)).weight
        k += 1
    possible = total > 0
    taken = possible & (sample.x < SHARE)
    own = mi.Point2f(dr.select(possible & ~taken, (sample.x - SHARE) / (1 - SHARE), sample.x), sample.y)

    # The sphere, and how far into its share the number falls
    place, before, k = sample.x / SHARE * total, mi.Float(0), mi.UInt32(0)
    sphere, axis, height, within = mi.UInt32(NONE), mi.Vector3f(0, 0, 1), mi.Float(0), mi.Float(0)
    while taken & (k < aim.count):
        cone = aim.cone(k, outlook, mi.Bool(True))
        here = (cone.weight > 0) & (place >= before)
        sphere = dr.select(here, k, sphere)
        axis = dr.select(here, cone.way, axis)
        height = dr.select(here, cone.height, height)
        within = dr.select(here, (place - before) / cone.weight, within)
        before += cone.weight
        k += 1
    depth = height * dr.clip(within, 0, 1)
    sine, cosine = dr.sincos(dr.two_pi * sample.y)
    radius = dr.safe_sqrt(depth * (2 - depth))
    local = mi.Vector3f(radius * cosine, radius * sine, 1 - depth)
    return sphere, mi.Frame3f(dr.normalize(axis)).to_world(local), own
