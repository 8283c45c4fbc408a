"""What lights send: the colour of a black body, and the irradiance that an emitter sends to a point, unoccluded."""

from collections.abc import Callable
from functools import lru_cache
from math import atan, hypot, pi, radians, sqrt

import numpy as np

from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LightName

PLANCK_FIRST = 3.741771852e-16
"""First radiation constant 2 pi h c^2 in W m^2 (CODATA 2018)."""
PLANCK_SECOND = 1.438776877e-2
"""Second radiation constant h c / k in m K (CODATA 2018)."""
WAVELENGTHS = np.arange(380.0, 780.1, 2.0)
"""Nanometres."""

_LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
REC709_FROM_XYZ = np.array([[3.2409699419, -1.5373831776, -0.4986107603],
                            [-0.9692436363, 1.8759675015, 0.0415550574],
                            [0.0556300797, -0.2039769589, 1.0569715142]])
"""ITU-R BT.709 primaries, white point D65."""
LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])
"""Relative luminance of the Rec.709 primaries: second row of the inverse of REC709_FROM_XYZ."""
BEAM_SHARE = 0.75
"""Half angle of a spot's full beam over its cutoff where the light states none; between them intensity falls linearly
(Mitsuba's default)."""
SHARPEST = 0.999
"""Most that a beam is of the cutoff: over no angle at all nothing can fall."""


def _lobe(wavelength: np.ndarray, weight: float, mean: float, below: float, above: float) -> np.ndarray:
    deviation = np.where(wavelength < mean, below, above)
    return weight * np.exp(-0.5 * ((wavelength - mean) / deviation) ** 2)


def matching_functions(wavelength: np.ndarray) -> np.ndarray:
    """(N, 3) CIE 1931 colour-matching functions x, y, z at wavelengths (N,) in nanometres.

    Multi-lobe fit of Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching
    Functions", JCGT 2(2), 2013, table 1.
    """
    return np.stack([sum(_lobe(wavelength, *lobe) for lobe in lobes) for lobes in _LOBES], axis=-1)


def planck(wavelength: np.ndarray, temperature: float) -> np.ndarray:
    """(N,) spectral exitance in W/m^3 of a black body at `temperature` kelvin, wavelengths (N,) in nanometres."""
    metres = wavelength * 1e-9
    return PLANCK_FIRST / metres**5 / np.expm1(PLANCK_SECOND / (metres * temperature))


def chromaticity(temperature: float) -> tuple[float, float]:
    """CIE 1931 (x, y) of a black body at `temperature` kelvin."""
    x, y, z = planck(WAVELENGTHS, temperature) @ matching_functions(WAVELENGTHS)
    return float(x / (x + y + z)), float(y / (x + y + z))


@lru_cache(maxsize=4096)
def colour(temperature: float) -> tuple[float, float, float]:
    """Linear Rec.709 of luminance 1 of a black body at `temperature` kelvin; what lies outside the gamut is clipped."""
    x, y = chromaticity(temperature)
    inside = np.maximum(REC709_FROM_XYZ @ np.array([x / y, 1.0, (1 - x - y) / y]), 0.0)
    red, green, blue = (float(channel) for channel in inside / (LUMINANCE @ inside))
    return red, green, blue


def _rectangle(side: float, length: float, distance: float) -> float:
    """Irradiance per radiance of a rectangle, or a square where `length` is 0, facing a point on its axis.

    Four times the corner form factor of Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3,
    times pi; area / distance^2 from afar.
    """
    a, b = side / 2 / distance, (length or side) / 2 / distance
    lean_a, lean_b = a / sqrt(1 + a * a), b / sqrt(1 + b * b)
    return 2 * (lean_a * atan(b / sqrt(1 + a * a)) + lean_b * atan(a / sqrt(1 + b * b)))


def _cylinder(radius: float, length: float, distance: float) -> float:
    """Irradiance per radiance of the side of a cylinder at a point that faces its middle, `distance` from the axis.

    Twice the form factor of a cylinder that stands on the plane of the point, times pi (Mudan, "Thermal Radiation
    Hazards from Hydrocarbon Pool Fires", Progress in Energy and Combustion Science 10, 1984, for one that does not
    lean); 2 radius length / distance^2 from afar.
    """
    s, h = distance / radius, length / 2 / radius
    if s <= 1:
        return pi
    a = (h * h + s * s + 1) / (2 * s)
    steep = a / sqrt(a * a - 1) * atan(sqrt((a + 1) * (s - 1) / ((a - 1) * (s + 1))))
    return 2 / s * (atan(h / sqrt(s * s - 1)) + h * (steep - atan(sqrt((s - 1) / (s + 1)))))


_FACING: dict[LightName, Callable[[float, float, float], float]] = {
    "dome": lambda size, length, distance: pi,
    "sun": lambda size, length, distance: 1.0,
    "area": _rectangle,
    "sphere": lambda size, length, distance: pi * min(size / distance, 1.0) ** 2,
    "point": lambda size, length, distance: 1 / distance**2,
    "spot": lambda size, length, distance: 1 / distance**2,
    "disk": lambda size, length, distance: pi * (size / hypot(size, distance)) ** 2,
    "cylinder": _cylinder,
}
"""Irradiance facing each kind, from its size, length and distance: exact but for spots, which it is on the axis of."""


def facing_irradiance(kind: LightName, size: float, distance: float, length: float = 0.0) -> float:
    """Irradiance per unit of the kind's quantity, from `distance` metres and facing the centre: on the axis, but square
    to that of a cylinder."""
    return _FACING[kind](size, length, distance)


def beam_of(light: LightPlan) -> float:
    """Degrees from a spot's axis to where it begins to fall off."""
    return min(light.beam or BEAM_SHARE * light.cutoff, SHARPEST * light.cutoff)


def _spot_falloff(cosine: np.ndarray, light: LightPlan) -> np.ndarray:
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    width = light.cutoff - beam_of(light) if light.beam else light.cutoff * (1 - BEAM_SHARE)
    return np.clip((light.cutoff - angle) / width, 0, 1)


LEAVING: dict[LightName, Callable[[np.ndarray, LightPlan], np.ndarray]] = {
    "area": lambda cosine, light: np.maximum(cosine, 0),
    "sphere": lambda cosine, light: np.ones_like(cosine),
    "point": lambda cosine, light: np.ones_like(cosine),
    "spot": _spot_falloff,
    "disk": lambda cosine, light: np.maximum(cosine, 0),
    "cylinder": lambda cosine, light: np.sqrt(np.maximum(1 - cosine * cosine, 0)),
}
"""Share of the most that it sends anywhere, that a light in the room sends at an angle of this cosine to its axis."""


def direct_irradiance(light: LightPlan, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) irradiance at points (N, 3) with unit normals (N, 3), nothing in the way.

    Emitters with an extent are taken as their centre: fair once they are further away than they are wide; images that
    they show do not count. Raises KeyError for a dome, which has no centre: see `sky_directions`.
    """
    if LIGHT_KINDS[light.kind].parallel:
        facing = np.maximum(-normals @ np.asarray(light.direction), 0)
        return facing[:, None] * np.asarray(light.radiance)
    towards = np.asarray(light.position) - points
    distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-6)
    towards = towards / distance[:, None]
    cosine = np.maximum(np.einsum("ij,ij->i", towards, normals), 0)
    leaving = -towards @ np.asarray(light.direction)
    cosine = cosine * LEAVING[light.kind](leaving, light)
    return per_unit(light, distance)[:, None] * cosine[:, None] * np.asarray(light.radiance)


def per_unit(light: LightPlan, distance: np.ndarray) -> np.ndarray:
    """(N,) irradiance per unit of radiance or intensity, facing the light from distances (N,)."""
    return np.array([facing_irradiance(light.kind, light.size, float(d), light.length) for d in distance])


def sky_directions(count: int) -> np.ndarray:
    """(count, 3) cosine-distributed directions about +Z: a Fibonacci spiral on the disc, lifted (Malley's method)."""
    k = np.arange(count) + 0.5
    radius, turn = np.sqrt(k / count), k * radians(180 * (3 - sqrt(5)))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=-1)
