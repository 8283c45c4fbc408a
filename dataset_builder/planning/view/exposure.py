"""How light meets the visible part of the object, and whether lamps stand in a camera's way."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.daylight import LIFT, MIN_WEIGHT, sunlit, weighed
from dataset_builder.planning.view.emission import LUMINANCE, direct_irradiance, facing_irradiance
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.planning.view.visibility import Sight
from dataset_builder.spread import spaced

MIN_CLEARANCE = 0.02
"""Metres between surfaces and a light without extent."""
MAX_POINTS = 192


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """How target light meets the visible part of the object."""

    mean: float
    """Direct irradiance (luminance, mean over visible points) in units of the source's."""
    lit: float
    """Share of these points that any light reaches."""


def expose(arrangement: Arrangement, sight: Sight, lights: Sequence[LightPlan], unit: float, sky: float, *,
           shadows: bool = True) -> Exposure:
    """How the visible part of the object is lit directly; `sky` is its `sky_share`, `unit` the source's irradiance.
    shadows: whether what is in the way of the other lights counts."""
    pick = spaced(len(sight.points), MAX_POINTS)
    normals = sight.normals[pick]
    points = sight.points[pick] + LIFT * normals
    total, reached = np.zeros(len(points)), np.zeros(len(points), dtype=bool)
    for light in lights:
        if LIGHT_KINDS[light.kind].all_round:
            total += facing_irradiance(light.kind, 0.0, 1.0) * (light.radiance @ LUMINANCE) * sky
            continue
        sent = direct_irradiance(light, points, normals) @ LUMINANCE
        open_way = (sent > 0) & _unhindered(arrangement, light, points) if shadows else sent > 0
        total += sent * open_way
        reached |= open_way
    return Exposure(mean=float(total.mean()) / unit, lit=float(reached.mean()))


def _unhindered(arrangement: Arrangement, light: LightPlan, points: np.ndarray) -> np.ndarray:
    """(N,) bool: whether nothing stands between points (N, 3) and a light's centre."""
    if LIGHT_KINDS[light.kind].parallel:
        return sunlit(arrangement, light, points)
    return ~arrangement.everything.occluded(points, np.broadcast_to(light.position, points.shape))


def weighed_outside(view: LitView, light: LightPlan) -> LightPlan:
    """A light outside, weighed by what of it reaches the visible part of the object."""
    if LIGHT_KINDS[light.kind].all_round:
        return weighed(light, view.sky)
    found = expose(view.arrangement, view.sight, [light], max(light.radiance), view.sky)
    return weighed(light, found.mean)


def weighed_lamp(view: LitView, light: LightPlan) -> LightPlan:
    """A lamp, weighed by what it sends to the object's centre with nothing in the way, wherever it shines."""
    mean = float(np.mean(light.radiance))
    away = np.asarray(light.position) - view.arrangement.centre
    apart = float(np.linalg.norm(away))
    normal = away / apart if apart > 0 else np.array([0.0, 0.0, 1.0])
    # A lamp in the object is no reason to sample nothing else
    distance = max(apart, view.arrangement.radius)
    most = facing_irradiance(light.kind, light.size, distance, light.length) * mean
    at = np.asarray(light.position) - distance * normal
    sent = float(direct_irradiance(light, at[None], normal[None])[0].mean())
    return light.model_copy(update={"weight": max(sent, MIN_WEIGHT * most)})


def in_the_way(light: LightPlan, radius: float, camera: np.ndarray, points: np.ndarray) -> bool:
    """Whether an emitter that reaches `radius` metres about its middle comes between the camera and points (N, 3) that
    it should see. One without extent never does."""
    along, to_light = points - camera, np.asarray(light.position) - camera
    share = np.clip(along @ to_light / np.einsum("ij,ij->i", along, along), 0, 1)
    return bool((np.linalg.norm(to_light - share[:, None] * along, axis=1) < radius).any())
