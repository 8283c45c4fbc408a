"""Irradiance that an emitter sends to a point, unoccluded: what strengths mean, and how lit a place would be."""

from collections.abc import Callable
from math import atan, pi, radians, sqrt

import numpy as np

from dataset_builder.label.light_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS, LightName

BEAM_SHARE = 0.75
"""Half angle of a spot's full beam over its cutoff; between them intensity falls linearly (Mitsuba's default)."""


def _square(side: float, distance: float) -> float:
    """Irradiance per radiance of a square facing a point on its axis.

    Four times the corner form factor of Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-3, for
    equal sides, times pi; side^2 / distance^2 from afar.
    """
    ratio = side / 2 / distance
    lean = ratio / sqrt(1 + ratio * ratio)
    return 4 * lean * atan(lean)


_FACING: dict[LightName, Callable[[float, float], float]] = {
    "dome": lambda size, distance: pi,
    "sun": lambda size, distance: 1.0,
    "area": _square,
    "sphere": lambda size, distance: pi * min(size / distance, 1.0) ** 2,
    "point": lambda size, distance: 1 / distance**2,
    "spot": lambda size, distance: 1 / distance**2,
}
"""Irradiance facing each kind, from its size and distance: exact but for spots, which it is on the axis of."""


def facing_irradiance(kind: LightName, size: float, distance: float) -> float:
    """Irradiance per unit of the kind's quantity, from `distance` metres, on the axis and facing the centre."""
    return _FACING[kind](size, distance)


def _spot_falloff(cosine: np.ndarray, cutoff: float) -> np.ndarray:
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return np.clip((cutoff - angle) / (cutoff * (1 - BEAM_SHARE)), 0, 1)


_LEAVING: dict[LightName, Callable[[np.ndarray, LightPlan], np.ndarray]] = {
    "area": lambda cosine, light: np.maximum(cosine, 0),
    "sphere": lambda cosine, light: np.ones_like(cosine),
    "point": lambda cosine, light: np.ones_like(cosine),
    "spot": lambda cosine, light: _spot_falloff(cosine, light.cutoff),
}
"""Share of what goes along its axis that a light in the room sends at an angle of this cosine to it."""


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
    cosine = cosine * _LEAVING[light.kind](leaving, light)
    return per_unit(light, distance)[:, None] * cosine[:, None] * np.asarray(light.radiance)


def per_unit(light: LightPlan, distance: np.ndarray) -> np.ndarray:
    """(N,) irradiance per unit of radiance or intensity, facing the light from distances (N,)."""
    return np.array([facing_irradiance(light.kind, light.size, float(d)) for d in distance])


def sky_directions(count: int) -> np.ndarray:
    """(count, 3) cosine-distributed directions about +Z: a Fibonacci spiral on the disc, lifted (Malley's method)."""
    k = np.arange(count) + 0.5
    radius, turn = np.sqrt(k / count), k * radians(180 * (3 - sqrt(5)))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=-1)
