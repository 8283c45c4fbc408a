"""Irradiance that an emitter sends to a point, unoccluded: what strengths mean, and how lit a place would be."""

from math import atan, pi, radians, sqrt

import numpy as np

from dataset_builder.label.light_plan import LightPlan

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


def facing_irradiance(kind: str, size: float, distance: float) -> float:
    """Irradiance, per unit of radiance or intensity, facing the emitter's centre from `distance` metres.

    area: exact on the axis of the square. sphere: pi (radius / distance)^2, exact. point, spot (on its axis): inverse
    square. dome: pi. sun: 1.
    """
    if kind == "area":
        return _square(size, distance)
    if kind == "sphere":
        return pi * min(size / distance, 1.0) ** 2
    return {"point": 1 / distance**2, "spot": 1 / distance**2, "dome": pi, "sun": 1.0}[kind]


def _spot_falloff(cosine: np.ndarray, cutoff: float) -> np.ndarray:
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return np.clip((cutoff - angle) / (cutoff * (1 - BEAM_SHARE)), 0, 1)


def direct_irradiance(light: LightPlan, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(N, 3) irradiance at points (N, 3) with unit normals (N, 3), nothing in the way.

    Emitters with an extent are taken as their centre: fair once they are further away than they are wide; images that
    they show do not count. For a dome see `sky_directions`.
    """
    if light.kind == "sun":
        facing = np.maximum(-normals @ np.asarray(light.direction), 0)
        return facing[:, None] * np.asarray(light.radiance)
    towards = np.asarray(light.position) - points
    distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-6)
    towards = towards / distance[:, None]
    cosine = np.maximum(np.einsum("ij,ij->i", towards, normals), 0)
    leaving = -towards @ np.asarray(light.direction)
    if light.kind == "area":
        cosine = cosine * np.maximum(leaving, 0)
    elif light.kind == "spot":
        cosine = cosine * _spot_falloff(leaving, light.cutoff)
    return per_unit(light, distance)[:, None] * cosine[:, None] * np.asarray(light.radiance)


def per_unit(light: LightPlan, distance: np.ndarray) -> np.ndarray:
    """(N,) irradiance per unit of radiance or intensity, facing the light from distances (N,)."""
    return np.array([facing_irradiance(light.kind, light.size, float(d)) for d in distance])


def sky_directions(count: int) -> np.ndarray:
    """(count, 3) cosine-distributed directions about +Z: a Fibonacci spiral on the disc, lifted (Malley's method)."""
    k = np.arange(count) + 0.5
    radius, turn = np.sqrt(k / count), k * radians(180 * (3 - sqrt(5)))
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], axis=-1)
