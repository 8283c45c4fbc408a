"""Views of a pair that follow each other, whatever the path: planned together, judged one by one, never moved."""

from dataclasses import dataclass
from math import radians, sin, sqrt, tan

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.edges import unit
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.camera_misses import Miss, told
from dataset_builder.planning.view.cameras import (
    MIN_COVERAGE,
    PlannedCamera,
    clearance_of,
    distance_for,
    seen_from,
)
from dataset_builder.planning.view.visibility import silhouette_area
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.render import ImageSpec
from dataset_builder.spread import spaced

OUTLINES = 16
"""Views whose silhouettes a distance follows from."""

SLANT = 2.0
"""Clearances along the view that a camera stops before a surface: as much as one that is slanted by 60 degrees asks."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PathFrame:
    """One view of a path."""

    pinhole: Pinhole
    said: str
    """Where it is, in words."""
    turn: float = 0.0
    """Degrees about +Z that the target is turned from how it was placed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewPath:
    """What the views of a pair share."""

    kind: str
    """As messages call it."""
    frames: tuple[PathFrame, ...]
    """In order."""
    note: str
    """How the path was found."""
    hint: str
    """What to do where a view cannot be had."""


@dataclass(frozen=True, kw_only=True)
class FittingRange:
    """Distances from the object's centre, metres."""

    near: float
    """Where the object's bounding sphere fits the frame, and no silhouette has more of it than asked."""
    far: float
    """Where none has less than asked; `near` where no distance does both."""

    def drawn(self, share: float) -> float:
        """The distance at a `share` in [0, 1] of the range, as likely at every coverage."""
        return 1 / sqrt(share / self.near**2 + (1 - share) / self.far**2)


def fitting(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, fov: float,
            directions: np.ndarray) -> FittingRange:
    """Distances along unit directions (V, 3) at which every silhouette has a share of the frame within
    `spec.coverage`."""
    areas = [silhouette_area(arrangement, directions[k]) for k in spaced(len(directions), OUTLINES)]
    return fitting_areas(arrangement, spec, image, fov, areas)


def fitting_areas(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, fov: float,
                  areas: list[float]) -> FittingRange:
    """The same of silhouettes that have these areas, square metres."""
    low, high = (max(bound, MIN_COVERAGE) for bound in spec.coverage)
    half = np.arctan(tan(radians(fov) / 2) * min(image.height / image.width, 1.0))
    near = max(distance_for(max(areas), high, fov, image), arrangement.radius / sin(half))
    return FittingRange(near=near, far=max(distance_for(min(areas), low, fov, image), near))


def free_distances(arrangement: Arrangement, spec: CameraSpec, directions: np.ndarray) -> np.ndarray:
    """(V,) how far from the object's centre a camera can be along unit directions (V, 3), metres: as far as the room
    goes and nothing is between it and the object's bounding sphere, less the clearance."""
    clear = clearance_of(arrangement, spec)
    room = np.array([arrangement.shell.depth(arrangement.centre, way, clear) for way in directions])
    _, met = arrangement.surfaces.first_hit(arrangement.centre + arrangement.radius * directions, directions)
    return np.minimum(room, arrangement.radius + met - SLANT * clear)


def path_camera(arrangement: Arrangement, path: ViewPath, spec: CameraSpec, frame: int, where: str) -> PlannedCamera:
    """View `frame` of a path. arrangement: with the target turned as that frame asks.

    Raises PlanError, naming `where` and the view, where it cannot be had.
    """
    view = path.frames[frame]
    found = seen_from(arrangement, spec, view.pinhole)
    if isinstance(found, Miss):
        low, high = spec.coverage
        rule = (f"expected view {frame} of the {path.kind} ({view.said}) to see the object on {low:g} to {high:g} of "
                f"the frame with visibility >= {spec.visibility:g} and clearance >= "
                f"{clearance_of(arrangement, spec):.3g} m, got: {told(found, arrangement.shell.noun)}")
        raise PlanError([Problem(where=where, path="camera.path", rule=rule, hint=path.hint)])
    camera, sight = found
    return PlannedCamera(camera=camera, sight=sight, note=f"camera: view {frame}; {path.note}")


def placed_about(arrangement: Arrangement, azimuth: float, elevation: float, distance: float) -> str:
    """A place about the object in words. azimuth: in the world, degrees."""
    about = (azimuth - arrangement.target.yaw + 180) % 360 - 180
    return f"{about:.0f} degrees about the object, {elevation:.0f} above the horizon, {distance:.2f} m away"


def placed_at(position: np.ndarray) -> str:
    """A place in the room in words."""
    return "at [{:.2f}, {:.2f}, {:.2f}]".format(*position)


def level_with(arrangement: Arrangement, position: np.ndarray, aim: np.ndarray) -> np.ndarray:
    """(3,) the point in the middle of the frame that is nearest to the object's centre, of a camera at `position` that
    looks at `aim`: one as near as the centre, where the object is not before the camera."""
    away, forward = arrangement.centre - position, unit(aim - position)
    along = float(away @ forward)
    if float(np.linalg.norm(arrangement.centre - aim)) == 0:
        return aim
    return position + (along if along > 0 else max(float(np.linalg.norm(away)), 1e-3)) * forward
