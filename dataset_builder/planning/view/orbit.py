"""Views of a pair in order: a spiral about the object that is as dense everywhere, at one distance."""

from dataclasses import dataclass
from math import asin, pi, radians, sin, sqrt, tan

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.camera_misses import Miss, explained
from dataset_builder.planning.view.cameras import (
    MIN_COVERAGE,
    PlannedCamera,
    clearance_of,
    distance_for,
    seen_from,
    towards,
)
from dataset_builder.planning.view.visibility import silhouette_area
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.render import ImageSpec
from dataset_builder.spread import spaced

OUTLINES = 16
"""Views whose silhouettes the distance follows from."""
SLANT = 2.0
"""Clearances along the view that a camera stops before a surface: as much as one that is slanted by 60 degrees asks."""
HINT = ("make the room larger, take a smaller object or less furniture about it, widen `fov`, narrow "
        "`camera.orbit.elevation`, or widen `camera.coverage` and lower `camera.visibility`")


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbit:
    """What the views of a pair share."""

    azimuths: np.ndarray
    """(V,) degrees in the world, in order."""
    elevations: np.ndarray
    """(V,) degrees above the horizon."""
    fov: float
    """Degrees."""
    distance: float
    """Of every view from the object's centre, metres."""
    note: str
    """How the distance was found."""


def spiral(views: int, elevation: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """(V,) azimuths from 0 on and (V,) elevations, degrees: equal areas of the sphere between two elevations, upwards.

    Heights are the middles of equal intervals. Azimuth grows with the angle climbed, so that turns are
    sqrt(2 pi (z1 - z0) / V) radians apart, which is the way from a view to the next on the unit sphere: the spiral of
    Bauer (2000), Journal of Guidance, Control, and Dynamics 23(1), for the part of a sphere between two heights. A
    narrow band has one whole turn, and no height a ring.
    """
    low, high = (sin(radians(bound)) for bound in elevation)
    share = (np.arange(views) + 0.5) / views
    climbed = np.arcsin(low + share * (high - low))
    whole = asin(high) - asin(low)
    if whole > 0:
        share = (climbed - asin(low)) / whole
    turns = max(1.0, sqrt(views / (2 * pi * (high - low))) * whole) if whole > 0 else 1.0
    return 360 * turns * (share - share[0]), np.degrees(climbed)


def plan_orbit(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, views: int,
               rng: np.random.Generator) -> Orbit:
    """Directions, lens and distance of an orbit; `spec.orbit` is set.

    The distance is drawn among those at which every silhouette has a share of the frame within `spec.coverage` and the
    object's bounding sphere fits the frame; where no distance does both, it is where the sphere fits. Where something
    stands in the way of a camera, it is shortened as far as it takes, but never so far that the sphere does not fit.
    """
    assert spec.orbit is not None
    fov, share, start = draw(spec.fov, rng), float(rng.uniform()), draw(spec.orbit.azimuth, rng)
    azimuths, elevations = spiral(views, spec.orbit.elevation)
    azimuths = azimuths + arrangement.target.yaw + start
    directions = np.array([towards(a, e) for a, e in zip(azimuths, elevations, strict=True)])
    areas = [silhouette_area(arrangement, directions[k]) for k in spaced(views, OUTLINES)]
    low, high = (max(bound, MIN_COVERAGE) for bound in spec.coverage)
    half = np.arctan(tan(radians(fov) / 2) * min(image.height / image.width, 1.0))
    near = max(distance_for(max(areas), high, fov, image), arrangement.radius / sin(half))
    far = max(distance_for(min(areas), low, fov, image), near)
    # As random cameras have it, as likely at every coverage
    wanted = 1 / sqrt(share / near**2 + (1 - share) / far**2)
    free = _free(arrangement, spec, directions)
    distance = min([wanted, *free[free >= near]])
    blocked = int((free < distance).sum())
    note = f"orbit: {views} views at {distance:.2f} m" + (
        f", drawn {wanted:.2f} m and shortened to what stands in the way" if distance < wanted else "") + (
        f"; something is in the way of {blocked} even so" if blocked else "")
    return Orbit(azimuths=azimuths, elevations=elevations, fov=fov, distance=distance, note=note)


def _free(arrangement: Arrangement, spec: CameraSpec, directions: np.ndarray) -> np.ndarray:
    """(V,) how far from the object's centre a camera can be along unit directions (V, 3), metres: as far as the room
    goes and nothing is between it and the object's bounding sphere, less the clearance."""
    clear = clearance_of(arrangement, spec)
    room = np.array([arrangement.shell.depth(arrangement.centre, way, clear) for way in directions])
    _, met = arrangement.surfaces.first_hit(arrangement.centre + arrangement.radius * directions, directions)
    return np.minimum(room, arrangement.radius + met - SLANT * clear)


def orbit_camera(arrangement: Arrangement, orbit: Orbit, spec: CameraSpec, image: ImageSpec, frame: int,
                 where: str) -> PlannedCamera:
    """View `frame` of an orbit. Raises PlanError, naming `where` and the view, where it cannot be had: it is never
    moved."""
    azimuth, elevation = float(orbit.azimuths[frame]), float(orbit.elevations[frame])
    centre = arrangement.centre
    pinhole = Pinhole(position=centre + orbit.distance * towards(azimuth, elevation), target=centre, fov=orbit.fov,
                      width=image.width, height=image.height)
    found = seen_from(arrangement, spec, pinhole)
    if isinstance(found, Miss):
        (low, high), said = spec.coverage, explained([found], arrangement.shell.noun)[0]
        about = (azimuth - arrangement.target.yaw + 180) % 360 - 180
        rule = (f"expected view {frame} of the orbit ({about:.0f} degrees about the object, {elevation:.0f} above the "
                f"horizon, {orbit.distance:.2f} m away) to see the object on {low:g} to {high:g} of the frame with "
                f"visibility >= {spec.visibility:g} and clearance >= {clearance_of(arrangement, spec):.3g} m, got: "
                f"{said.removeprefix('1 ')}")
        raise PlanError([Problem(where=where, path="camera.orbit", rule=rule, hint=HINT)])
    camera, sight = found
    return PlannedCamera(camera=camera, sight=sight, note=f"camera: view {frame}; {orbit.note}")
