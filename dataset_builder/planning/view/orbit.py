"""Views of a pair in order: a spiral about the object that is as dense everywhere, at one distance."""

from math import asin, pi, radians, sin, sqrt

import numpy as np

from dataset_builder.errors import count_of
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import towards
from dataset_builder.planning.view.view_path import PathFrame, ViewPath, fitting, free_distances, placed_about
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.camera_path import OrbitSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.render import ImageSpec

HINT = ("give the scene `space`, make the room larger, take a smaller object or less furniture about it, widen `fov`, "
        "narrow `camera.path.elevation`, or widen `camera.coverage` and lower `camera.visibility`")


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


def plan_orbit(arrangement: Arrangement, path: OrbitSpec, spec: CameraSpec, image: ImageSpec, views: int,
               rng: np.random.Generator) -> ViewPath:
    """Directions, lens and distance of an orbit.

    The distance is drawn among those at which every silhouette has a share of the frame within `spec.coverage` and the
    object's bounding sphere fits the frame; where no distance does both, it is where the sphere fits. Where something
    stands in the way of a camera, it is shortened as far as it takes, but never so far that the sphere does not fit.
    """
    fov, share, start = draw(spec.fov, rng), float(rng.uniform()), draw(path.azimuth, rng)
    about, elevations = spiral(views, path.elevation)
    azimuths = about + arrangement.target.yaw + start
    directions = np.array([towards(a, e) for a, e in zip(azimuths, elevations, strict=True)])
    fits = fitting(arrangement, spec, image, fov, directions)
    wanted = fits.drawn(share)
    free = free_distances(arrangement, spec, directions)
    distance = min([wanted, *free[free >= fits.near]])
    blocked = int((free < distance).sum())
    note = f"orbit: {count_of(views, 'view')} at {distance:.2f} m" + (
        f", drawn {wanted:.2f} m and shortened to what stands in the way" if distance < wanted else "") + (
        f"; something is in the way of {blocked} even so" if blocked else "")
    centre, frames = arrangement.centre, list[PathFrame]()
    for azimuth, elevation in zip(azimuths.tolist(), elevations.tolist(), strict=True):
        pinhole = Pinhole(position=centre + distance * towards(azimuth, elevation), target=centre, fov=fov,
                          width=image.width, height=image.height)
        frames.append(PathFrame(pinhole=pinhole, said=placed_about(arrangement, azimuth, elevation, distance)))
    return ViewPath(kind="orbit", frames=tuple(frames), note=note, hint=HINT)
