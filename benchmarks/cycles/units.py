"""Light in physical units -> what Blender calls power. No package is needed: both interpreters import this file.

Blender's lamps take a radiant power in watts that leaves a full sphere or a Lambertian surface; a spot takes the power
that a point of the same intensity would have.
"""

import math
from collections.abc import Sequence

Colour = tuple[float, float, float]


def area_power(radiance: float, size: float) -> float:
    """Watts of a one-sided Lambertian square of side `size` metres."""
    return math.pi * size**2 * radiance


def sphere_power(radiance: float, radius: float) -> float:
    """Watts of a Lambertian sphere: pi * radiance from each of 4 pi radius^2 square metres."""
    return 4 * math.pi**2 * radius**2 * radiance


def point_power(intensity: float) -> float:
    """Watts of a point that sends `intensity` (W/sr) everywhere; also of a spot with that on its axis."""
    return 4 * math.pi * intensity


def power(kind: str, value: float, size: float) -> float:
    """Blender's `energy` of a light; `value` is its radiance, intensity or irradiance as `LightPlan` has it."""
    if kind == "area":
        return area_power(value, size)
    if kind == "sphere":
        return sphere_power(value, size)
    return value if kind == "sun" else point_power(value)


def tint_and_peak(radiance: Sequence[float]) -> tuple[Colour, float]:
    """Colour whose largest channel is 1, and that channel: Blender keeps colour and power apart."""
    peak = max(radiance)
    red, green, blue = (channel / peak if peak > 0 else 0.0 for channel in radiance)
    return (red, green, blue), peak


def spot_blend(cutoff: float, beam: float) -> float:
    """Blender's `spot_blend`: the share of the cone's range of cosines over which it fades, from `beam` degrees to
    `cutoff` degrees off the axis."""
    edge = math.cos(math.radians(cutoff))
    return (math.cos(math.radians(beam)) - edge) / (1 - edge)


def specular_level(reflectance: float) -> float:
    """Principled's "Specular IOR Level" at its index of 1.5 (F0 0.04 at level 0.5) for a reflectance at normal
    incidence."""
    return reflectance / 0.08


def indirect_bounces(max_depth: int) -> int:
    """Blender's bounces for paths of at most `max_depth` edges, of which one leaves the camera and one ends in a
    light."""
    return max(max_depth - 2, 0)
