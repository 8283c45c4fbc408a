"""A homogeneous medium in an upright box: how far light flies in it, how much gets through, where it is scattered to.

Transmittance is exp(-extinction * way) (Beer and Lambert), directions follow the phase function of Henyey and
Greenstein, "Diffuse radiation in the galaxy" (1941), sampled as in Pharr, Jakob and Humphreys, "Physically based
rendering" (2023), section 11.3. Everything is a value on the device, so that all fogs share a kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

THIN = 1e-2
"""Optical depth below which series take the place of differences that single precision cannot hold."""

NEARLY_EVEN = 1e-3
"""Anisotropy below which Henyey and Greenstein's inverse is its first-order series."""

MIN_SLOPE = 1e-12


@dataclass
class Way:
    """The part of a ray that lies in the box: where it begins, and how long it is; in units of the direction."""

    near: mi.Float
    length: mi.Float


class Fog:
    """Fog between two corners, metres. extinction: per metre, 0 or more. albedo: in [0, 1]. anisotropy: mean cosine of
    the scattering angle, in (-1, 1); 1 would be straight on."""

    def __init__(self, extinction: float, albedo: float, anisotropy: float, low: Sequence[float],
                 high: Sequence[float]):
        self.extinction, self.albedo, self.anisotropy = (dr.opaque(mi.Float, value)
                                                         for value in (extinction, albedo, anisotropy))
        self.low, self.high = (mi.Point3f(*(dr.opaque(mi.Float, float(value)) for value in corner))
                               for corner in (low, high))

    def way(self, origin: mi.Point3f, direction: mi.Vector3f, end: mi.Float) -> Way:
        """What of a ray from 0 to `end` lies in the box, by its slabs; `end` may be infinite."""
        direction = dr.select(dr.abs(direction) < MIN_SLOPE, mi.Vector3f(MIN_SLOPE), direction)
        one, other = (self.low - origin) / direction, (self.high - origin) / direction
        near = dr.maximum(dr.max(dr.minimum(one, other)), 0)
        far = dr.minimum(dr.min(dr.maximum(one, other)), end)
        return Way(near=near, length=dr.maximum(far - near, 0))

    def transmittance(self, way: Way) -> mi.Float:
        """Share of light that gets through."""
        return dr.exp(-self.extinction * way.length)

    def scattered(self, way: Way) -> mi.Float:
        """1 - transmittance, also where that is next to nothing."""
        depth = self.extinction * way.length
        return dr.select(depth < THIN, depth * (1 - depth * (0.5 - depth / 6)), 1 - dr.exp(-depth))

    def flight(self, way: Way, sample: mi.Float) -> tuple[mi.Float, mi.Bool]:
        """Distance of the first collision along the ray, and whether it comes before the way's end."""
        flown = self._flown(sample)
        return way.near + flown, flown < way.length

    def flight_within(self, way: Way, sample: mi.Float) -> mi.Float:
        """Distance of a collision that comes before the way's end, as `flight` draws those that do."""
        return way.near + dr.minimum(self._flown(sample * self.scattered(way)), way.length)

    def _flown(self, sample: mi.Float) -> mi.Float:
        """-log(1 - sample) / extinction."""
        series = sample * (1 + sample * (0.5 + sample / 3))
        depth = dr.select(sample < THIN, series, -dr.log(1 - sample))
        return depth / dr.maximum(self.extinction, dr.smallest(mi.Float))

    def phase(self, cosine: mi.Float) -> mi.Float:
        """Henyey and Greenstein's density over directions; `cosine` between the directions before and after."""
        g = self.anisotropy
        return dr.inv_four_pi * (1 - g * g) * dr.rcp(self._spread(cosine) * dr.sqrt(self._spread(cosine)))

    def _spread(self, cosine: mi.Float) -> mi.Float:
        g = self.anisotropy
        return dr.maximum(1 + g * g - 2 * g * cosine, 1e-6)

    def scatter(self, direction: mi.Vector3f, sample: mi.Point2f) -> tuple[mi.Vector3f, mi.Float]:
        """A direction after scattering, and its density, which is the phase function: the weight is 1."""
        g, turn = self.anisotropy, 1 - 2 * sample.x
        share = (1 - g * g) / (1 + g * turn)
        even = dr.abs(g) < NEARLY_EVEN
        bent = (1 + g * g - share * share) / dr.select(even, mi.Float(1), 2 * g)
        cosine = dr.clip(dr.select(even, turn + 1.5 * g * (1 - turn * turn), bent), -1, 1)
        sine, angle = dr.safe_sqrt(1 - cosine * cosine), dr.two_pi * sample.y
        along = mi.Frame3f(direction)
        local = mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine)
        return along.to_world(local), self.phase(cosine)
