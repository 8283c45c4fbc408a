"""Portals: the openings that light from outside gets in through, as light samples and light paths use them.

From a point inside, a dome is seen through a few rectangles. A direction is drawn evenly over the solid angles that
these subtend (Urena, Fajardo, King, "An area-preserving parametrization for spherical rectangles", EGSR 2013), so that
its density at x is

    p(x, d) = c(x, d) / sum of O_i(x),

with O_i the solid angle of portal i from x and c the number of portals that the direction d crosses. A portal counts on
its inner side alone. No portal needs to be right: `Portals.mixed` keeps a share of the samples as they would have been
drawn without any (a defensive mixture: Hesterberg, "Weighted average importance sampling and defensive mixture
distributions", Technometrics 37, 1995), so a portal that misses something costs variance, not truth.
"""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.label.scene_plan import IlluminationPlan, PortalPlan
from dataset_builder.rendering.buffers import owned

LEAST = 1e-3
"""Steradians below which a portal does not count at a point: single precision leaves 0.1% of them."""
NEAREST = 1e-5
"""Distance from a portal's plane, in its sides, below which it does not count either."""
ROW = 3
"""Vectors of a portal in the table: corner and first length, unit along the first side and second length, unit along
the second side and area."""


ALL_ROUND = 0.05
"""Share of samples that go all round: from 0.01 to 0.15, variance in rooms whose portals are right grows by a tenth."""


class _Rectangle:
    """A portal as a point sees it: its corners in a frame about the point, whose axes are the portal's sides."""

    def __init__(self, table: mi.Float, index: mi.UInt32, point: mi.Point3f, active: mi.Bool):
        first, second, third = (dr.gather(mi.Vector4f, table, ROW * index + k, active) for k in range(ROW))
        self.right, self.up = mi.Vector3f(*second.xyz), mi.Vector3f(*third.xyz)
        self.inward = dr.cross(self.right, self.up)
        from_point = mi.Vector3f(*first.xyz) - point
        self.x0, self.y0 = dr.dot(from_point, self.right), dr.dot(from_point, self.up)
        self.x1, self.y1 = self.x0 + first.w, self.y0 + second.w
        self.height = -dr.dot(from_point, self.inward)
        """Of the point above the plane, on the inner side."""
        self.area = third.w
        x, y, h = dr.maximum(-self.x0, self.x1), dr.maximum(-self.y0, self.y1), self.height
        squared = x * x + y * y + h * h
        self.counts = active & (self.area * h > LEAST * squared * dr.sqrt(squared)) \
            & (h > NEAREST * dr.maximum(first.w, second.w))
        """Whether the point has use for the portal: it subtends at least LEAST, for its furthest corner is that far
        away."""

    def _angle(self, x: mi.Float, y: mi.Float, turn: mi.Float) -> mi.Complex2f:
        """Inner angle of the spherical rectangle at a corner, as a number whose argument it is; `turn` is -x y or x y,
        as it turns left or right there. Urena et al., section 4, without their arcus cosines, which lose digits near
        0."""
        scale = dr.rcp(self.x1 - self.x0 + self.y1 - self.y0 + self.height)
        return mi.Complex2f(turn, self.height * dr.sqrt(x * x + y * y + self.height * self.height)) * (scale * scale)

    def _halves(self) -> tuple[mi.Complex2f, mi.Complex2f]:
        """The angles at the right end, and those at the left end, as products of such numbers."""
        x0, x1, y0, y1 = self.x0, self.x1, self.y0, self.y1
        return (self._angle(x1, y0, y0 * x1) * self._angle(x1, y1, -x1 * y1),
                self._angle(x0, y1, y1 * x0) * self._angle(x0, y0, -x0 * y0))

    def solid_angle(self) -> mi.Float:
        """What the four angles exceed those of a plane rectangle by; 0 where the portal does not count."""
        right, left = self._halves()
        return dr.select(self.counts, _argument(right * left), 0)

    def direction(self, sample: mi.Point2f) -> mi.Vector3f:
        """The direction to where `sample` lies on the spherical rectangle, evenly: Urena et al., section 5."""
        x0, x1, y0, y1, h = self.x0, self.x1, self.y0, self.y1, self.height
        right, left = self._halves()
        b0, b1 = (-y * dr.rsqrt(y * y + h * h) for y in (y0, y1))
        turn = sample.x * _argument(right * left) - _argument(left)
        sine, cosine = dr.sincos(turn)
        f = (cosine * b0 + b1) / sine
        cosine = dr.copysign(dr.rsqrt(f * f + b0 * b0), f)
        x = dr.clip(cosine * h * dr.rsqrt(dr.maximum(1 - cosine * cosine, dr.smallest(mi.Float))), x0, x1)
        squared = x * x + h * h
        low, high = (y * dr.rsqrt(squared + y * y) for y in (y0, y1))
        rise = low + sample.y * (high - low)
        y = dr.clip(rise * dr.sqrt(squared / dr.maximum(1 - rise * rise, dr.epsilon(mi.Float))), y0, y1)
        return dr.normalize(x * self.right + y * self.up - h * self.inward)

    def crossed(self, direction: mi.Vector3f) -> mi.Bool:
        """Whether the portal counts, and a ray from the point leaves through it."""
        outward = -dr.dot(direction, self.inward)
        x, y = (self.height * dr.dot(direction, side) for side in (self.right, self.up))
        return self.counts & (outward > 0) & (x >= self.x0 * outward) & (x <= self.x1 * outward) \
            & (y >= self.y0 * outward) & (y <= self.y1 * outward)


def _argument(number: mi.Complex2f) -> mi.Float:
    """In [0, 2 pi)."""
    angle = dr.atan2(number.imag, number.real)
    return dr.select(angle < 0, angle + dr.two_pi, angle)


class Portals:
    """Portals on the device: a table with a count, so that all numbers of them share a kernel.

    portals: in units of the frame that points are given in. share: of samples of the dome that are drawn without them,
    above 0 and at most 1.
    """

    def __init__(self, portals: Sequence[PortalPlan], share: float):
        rows = np.array([_row(portal) for portal in portals], dtype=np.float64)
        self._table = owned(mi.Float, rows.astype(np.float32).ravel())
        self._count = dr.opaque(mi.UInt32, len(rows))
        self._area = dr.opaque(mi.Float, float(rows[:, -1].sum()))
        self.share = dr.opaque(mi.Float, share)

    def sample(self, point: mi.Point3f, sample: mi.Point2f, active: mi.Bool = True) -> tuple[mi.Vector3f, mi.Float]:
        """A direction out through the portals, evenly over their solid angles, and its density per steradian; the
        density is 0 where the point sees no portal."""
        direction, solid_angle = self.draw(point, sample, active)
        crossed = dr.maximum(self.crossed(point, direction, active), 1)
        return direction, dr.select(solid_angle > 0, mi.Float(crossed) / solid_angle, 0)

    def pdf(self, point: mi.Point3f, direction: mi.Vector3f, active: mi.Bool = True) -> mi.Float:
        """The density with which `sample` draws a direction, per steradian."""
        solid_angle = self.solid_angle(point, active)
        return dr.select(solid_angle > 0, mi.Float(self.crossed(point, direction, active)) / solid_angle, 0)

    def draw(self, point: mi.Point3f, sample: mi.Point2f, active: mi.Bool) -> tuple[mi.Vector3f, mi.Float]:
        """A direction as `sample` draws it, and the solid angle of all portals, 0 where the point sees none."""
        index, rest, solid_angle = self._chosen(point, sample.x, active)
        return _Rectangle(self._table, index, point, active).direction(mi.Point2f(rest, sample.y)), solid_angle

    def mixed(self, point: mi.Point3f, direction: mi.Vector3f, solid_angle: mi.Float, own: mi.Float,
              scale: mi.Float | float, active: mi.Bool) -> mi.Float:
        """Density of a mixture: `own` on a share of the samples, and `scale` times that of the portals, which subtend
        `solid_angle`, on the rest; `own` alone where that is 0."""
        crossed = mi.Float(self.crossed(point, direction, active & (solid_angle > 0)))
        return dr.select(solid_angle > 0, dr.lerp(scale * crossed / solid_angle, own, self.share), own)

    @dr.syntax
    def crossed(self, point: mi.Point3f, direction: mi.Vector3f, active: mi.Bool = True) -> mi.UInt32:
        """How many of the portals that count at a point a ray from it leaves through."""
        index, crossed, going = mi.UInt32(0), mi.UInt32(0), mi.Bool(active)
        while going:
            crossed += dr.select(_Rectangle(self._table, index, point, going).crossed(direction), mi.UInt32(1), 0)
            index += 1
            going = going & (index < self._count)
        return crossed

    @dr.syntax
    def solid_angle(self, point: mi.Point3f, active: mi.Bool = True) -> mi.Float:
        """That of all portals from a point, steradians; what two of them cover counts twice."""
        index, total, going = mi.UInt32(0), mi.Float(0), mi.Bool(active)
        while going:
            total += _Rectangle(self._table, index, point, going).solid_angle()
            index += 1
            going = going & (index < self._count)
        return total

    @dr.syntax
    def sample_area(self, sample: mi.Point2f) -> tuple[mi.Point3f, mi.Normal3f, mi.Float]:
        """A point on the portals, evenly over their area, the inward normal there, and the density per area.

        Light paths of a dome start here: what comes in from the direction w at y is L(w) cos, whatever stands outside.
        """
        left = sample.x * self._area
        index, found, going = mi.UInt32(0), mi.UInt32(0), mi.Bool(True)
        while going:
            area = dr.gather(mi.Float, self._table, 4 * ROW * index + 4 * ROW - 1)
            found = mi.UInt32(index)
            index += 1
            going = (left >= area) & (index < self._count)
            left = dr.select(going, left - area, left)
        none = dr.zeros(mi.Point3f)
        portal = _Rectangle(self._table, found, none, mi.Bool(True))
        u = dr.clip(left / portal.area, 0, dr.one_minus_epsilon(mi.Float))
        x, y = dr.lerp(portal.x0, portal.x1, u), dr.lerp(portal.y0, portal.y1, sample.y)
        point = x * portal.right + y * portal.up - portal.height * portal.inward
        return mi.Point3f(point), mi.Normal3f(portal.inward), dr.rcp(self._area)

    @dr.syntax
    def _chosen(self, point: mi.Point3f, sample: mi.Float, active: mi.Bool) -> tuple[mi.UInt32, mi.Float, mi.Float]:
        """A portal, chosen in proportion to its solid angle, what is left of the random number, and the sum of all.

        One pass with one number: the i-th takes the place of the one before with probability O_i / (O_1 + ... + O_i)
        (Chao, "A general purpose unequal probability sampling plan", 1982), and the number is rescaled each time.
        """
        index, chosen, rest, total = mi.UInt32(0), mi.UInt32(0), mi.Float(sample), mi.Float(0)
        going = mi.Bool(active)
        while going:
            solid_angle = _Rectangle(self._table, index, point, going).solid_angle()
            total += solid_angle
            probability = dr.select(total > 0, solid_angle / total, 0)
            taken = rest < probability
            chosen = dr.select(taken, index, chosen)
            rest = dr.select(taken, rest / probability, (rest - probability) / dr.maximum(1 - probability, 1e-7))
            rest = dr.clip(rest, 0, dr.one_minus_epsilon(mi.Float))
            index += 1
            going = going & (index < self._count)
        return chosen, rest, total


def _row(portal: PortalPlan) -> list[float]:
    """A portal's row of the table."""
    sides = np.array([portal.right, portal.up], dtype=np.float64)
    lengths = np.linalg.norm(sides, axis=1)
    right, up = sides / lengths[:, None]
    return [*portal.corner, lengths[0], *right, lengths[1], *up, lengths[0] * lengths[1]]


def portals_of(portals: Sequence[PortalPlan], illumination: IlluminationPlan | None) -> Portals | None:
    """Portals of a scene under an illumination, None where nothing comes through any."""
    lights = illumination.lights if illumination else ()
    if not portals or not any(light.kind == "dome" and light.weight > 0 for light in lights):
        return None
    return Portals(portals, ALL_ROUND)
