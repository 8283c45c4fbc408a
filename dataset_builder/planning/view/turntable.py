"""Views of a target that turns on the spot before one camera."""

from dataclasses import replace
from math import remainder
from pathlib import Path

import numpy as np

from dataset_builder.errors import count_of
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.camera_misses import Miss
from dataset_builder.planning.view.cameras import clearance_of, seen_from, towards
from dataset_builder.planning.view.view_path import OUTLINES, PathFrame, ViewPath, fitting_areas, placed_about
from dataset_builder.planning.view.visibility import silhouette_area
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.camera_path import TurntableSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.render import ImageSpec
from dataset_builder.spread import spaced

JUDGED = 6
"""Turns of the target that a drawn camera is judged by."""
SAME = 1e-6
"""Degrees between turns that look alike."""
HINT = ("give the scene `space`, choose `camera.path.azimuth` and `elevation`, use less furniture, make the room "
        "larger, widen `fov`, or widen `camera.coverage` and lower `camera.visibility`")


def plan_turntable(arrangement: Arrangement, path: TurntableSpec, spec: CameraSpec, image: ImageSpec, views: int,
                   rng: np.random.Generator, mesh_root: Path) -> ViewPath:
    """The turns of the target, and one camera.

    The camera is the first of at most `spec.attempts` drawn ones that sees the target as the spec asks at some turns of
    it, or else the one that does at most of these. Its distance is drawn as that of an orbit, from silhouettes of all
    turns.
    """
    fov, share = draw(spec.fov, rng), float(rng.uniform())
    step = draw(path.turns, rng) * 360 / views * (1 if path.direction == "counter-clockwise" else -1)
    turns = draw(path.start, rng) + step * np.arange(views)
    judged = [arrangement.turned(float(turns[k]), mesh_root) for k in spaced(views, JUDGED)]
    best, most, attempt = _drawn(arrangement, path, spec, image, fov, share, turns, rng), -1, 0
    for number in range(spec.attempts):
        drawn = best if number == 0 else _drawn(arrangement, path, spec, image, fov, float(rng.uniform()), turns, rng)
        had = _had(judged, spec, drawn.pinhole)
        if had > most:
            best, most, attempt = drawn, had, number
        if most == len(judged):
            break
    frames = tuple(replace(best, turn=float(turn), said=f"target turned by {turn:.0f} degrees, camera {best.said}")
                   for turn in turns)
    again = next((k for k in range(1, views) if abs(remainder(k * step, 360)) < SAME), 0)
    note = (f"turntable: {count_of(views, 'view')}, {abs(step):.4g} degrees {path.direction} from each to the next"
            + f", so view {again} shows what view 0 does" * bool(again)
            + f"; the camera is draw {attempt + 1} of at most {spec.attempts}")
    return ViewPath(kind="turntable", frames=frames, note=note, hint=HINT)


def _had(judged: list[Arrangement], spec: CameraSpec, pinhole: Pinhole) -> int:
    """How many turns of the target a camera sees as the spec asks, up to the first that it does not."""
    for number, turned in enumerate(judged):
        if isinstance(seen_from(turned, spec, pinhole), Miss):
            return number
    return len(judged)


def _drawn(arrangement: Arrangement, path: TurntableSpec, spec: CameraSpec, image: ImageSpec, fov: float, share: float,
           turns: np.ndarray, rng: np.random.Generator) -> PathFrame:
    """One camera, its angles drawn."""
    azimuth, elevation = arrangement.target.yaw + draw(path.azimuth, rng), draw(path.elevation, rng)
    # Turned by t, the target looks as it does unturned from -t
    areas = [silhouette_area(arrangement, towards(azimuth - turns[k], elevation)) for k in spaced(len(turns), OUTLINES)]
    fits = fitting_areas(arrangement, spec, image, fov, areas)
    reach = arrangement.shell.depth(arrangement.centre, towards(azimuth, elevation), clearance_of(arrangement, spec))
    distance = replace(fits, far=max(min(fits.far, reach), fits.near)).drawn(share)
    centre = arrangement.centre
    pinhole = Pinhole(position=centre + distance * towards(azimuth, elevation), target=centre, fov=fov,
                      width=image.width, height=image.height)
    return PathFrame(pinhole=pinhole, said=placed_about(arrangement, azimuth, elevation, distance))
