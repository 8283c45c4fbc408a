"""A homogeneous medium in an upright box: how far light flies in it, how much gets through, where it is scattered to.

Transmittance is exp(-extinction * length) (Beer and Lambert), directions follow the phase function of Henyey and
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
class RaySegment:
    """The part of a ray that lies in the box, in units of the ray's direction."""

    near: mi.Float
    """Where it begins."""
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

    def segment(self, origin: mi.Point3f, direction: mi.Vector3f, end: mi.Float) -> RaySegment:
        """What of a ray from 0 to `end` lies in the box, by its slabs; `end` may be infinite."""
        direction = dr.select(dr.abs(direction) < MIN_SLOPE, mi.Vector3f(MIN_SLOPE), direction)
        t_low, t_high = (self.low - origin) / direction, (self.high - origin) / direction
        near = dr.maximum(dr.max(dr.minimum(t_low, t_high)), 0)
        far = dr.minimum(dr.min(dr.maximum(t_low, t_high)), end)
        return RaySegment(near=near, length=dr.maximum(far - near, 0))

    def transmittance(self, segment: RaySegment) -> mi.Float:
        """Share of light that gets through: T = exp(-extinction length)."""
        return dr.exp(-self.extinction * segment.length)

    def opacity(self, segment: RaySegment) -> mi.Float:
        """1 - T, also where that is next to nothing: x - x^2 / 2 + x^3 / 6 for a small optical depth x."""
        depth = self.extinction * segment.length
        return dr.select(depth < THIN, depth * (1 - depth * (0.5 - depth / 6)), 1 - dr.exp(-depth))

    def sample_distance(self, segment: RaySegment, sample: mi.Float) -> tuple[mi.Float, mi.Bool]:
        """Distance of the first collision along the ray, and whether it comes before the segment's end."""
        flown = self._free_flight(sample)
        return segment.near + flown, flown < segment.length

    def sample_distance_within(self, segment: RaySegment, sample: mi.Float) -> mi.Float:
        """Distance of a collision that comes before the segment's end, as `sample_distance` draws those that do."""
        return segment.near + dr.minimum(self._free_flight(sample * self.opacity(segment)), segment.length)

    def _free_flight(self, sample: mi.Float) -> mi.Float:
        """-log(1 - u) / extinction, which inverts u = 1 - T; u + u^2 / 2 + u^3 / 3 for a small u."""
        series = sample * (1 + sample * (0.5 + sample / 3))
        depth = dr.select(sample < THIN, series, -dr.log(1 - sample))
        return depth / dr.maximum(self.extinction, dr.smallest(mi.Float))

    def phase(self, cosine: mi.Float) -> mi.Float:
        """Henyey and Greenstein's density over directions, per steradian; `cosine` between those before and after.

        (1 - g^2) / (4 pi (1 + g^2 - 2 g cosine)^(3/2)).
        """
        g = self.anisotropy
        return dr.inv_four_pi * (1 - g * g) * dr.rcp(self._base(cosine) * dr.sqrt(self._base(cosine)))

    def _base(self, cosine: mi.Float) -> mi.Float:
        """1 + g^2 - 2 g cosine, never 0."""
        g = self.anisotropy
        return dr.maximum(1 + g * g - 2 * g * cosine, 1e-6)

    def sample_phase(self, direction: mi.Vector3f, sample: mi.Point2f) -> tuple[mi.Vector3f, mi.Float]:
        """A direction after scattering, and its density, which is the phase function: the weight is 1.

        cosine = (1 + g^2 - ((1 - g^2) / (1 + g v))^2) / (2 g) with v = 1 - 2 u; v + 3/2 g (1 - v^2) for a small g.
        """
        g, v = self.anisotropy, 1 - 2 * sample.x
        ratio = (1 - g * g) / (1 + g * v)
        nearly_even = dr.abs(g) < NEARLY_EVEN
        inverse = (1 + g * g - ratio * ratio) / dr.select(nearly_even, mi.Float(1), 2 * g)
        cosine = dr.clip(dr.select(nearly_even, v + 1.5 * g * (1 - v * v), inverse), -1, 1)
        sine, phi = dr.safe_sqrt(1 - cosine * cosine), dr.two_pi * sample.y
        frame = mi.Frame3f(direction)
        local = mi.Vector3f(sine * dr.cos(phi), sine * dr.sin(phi), cosine)
        return frame.to_world(local), self.phase(cosine)
