"""Views on a smooth path through keyed poses, at equal lengths of it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees

import numpy as np

from dataset_builder.errors import PlanError, Problem, count_of
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import towards
from dataset_builder.planning.view.view_path import PathFrame, ViewPath, fitting, free_distances, level_with, placed_at
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.camera_path import STEEPEST_KEY, SplineSpec
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.render import ImageSpec

Curve = Callable[[np.ndarray], np.ndarray]
"""(N, D) values at (N,) places; places of keys are `Flight.knots`."""
FINE = 128
"""Pieces of a path between two keys whose straight lengths stand for its own."""
BETWEEN = 8
"""Directions from each key to the next that a distance is found for."""
HINT = ("move keys away from walls and furniture, turn `look_at` to the object, give the scene `space`, make the room "
        "larger, or widen `camera.coverage` and lower `camera.visibility`")


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """A path in the room. Places along it are in lengths of what it is drawn in, from 0."""

    knots: np.ndarray
    """(K,) places of the keys, and of the first again where it is closed."""
    poses: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    """(N, 3) positions and (N, 3) points looked at, metres, at places (N,)."""
    fov: Curve
    """(N, 1) degrees."""

    def even(self, views: int, *, closed: bool) -> np.ndarray:
        """(V,) places at equal lengths, from the first key on; to the last one, or up to the first again."""
        fine = np.unique(np.concatenate([np.linspace(a, b, FINE) for a, b in
                                         zip(self.knots[:-1], self.knots[1:], strict=True)]))
        steps = np.linalg.norm(np.diff(self.poses(fine)[0], axis=0), axis=1)
        if not steps.sum() > 0:
            # A camera that only turns
            steps = np.diff(fine)
        lengths = np.concatenate([[0.0], np.cumsum(steps)])
        shares = np.arange(views) / views if closed else np.arange(views) / max(views - 1, 1)
        return np.interp(shares * lengths[-1], lengths, fine)


def smooth(knots: np.ndarray, values: np.ndarray, *, closed: bool) -> Curve:
    """The cubic spline through (K, D) values at `knots` (K,), twice continuously differentiable; of a closed one, the
    last value follows on the first, from which it may differ by a constant, whole turns."""
    from scipy.interpolate import CubicSpline

    if not closed:
        return CubicSpline(knots, values)
    slope = (values[-1] - values[0]) / (knots[-1] - knots[0])
    level = values - (knots - knots[0])[:, None] * slope
    level[-1] = level[0]
    round_about = CubicSpline(knots, level, bc_type="periodic")
    return lambda places: round_about(places) + (places - knots[0])[:, None] * slope


def flight(arrangement: Arrangement, path: SplineSpec, spec: CameraSpec, image: ImageSpec, fov: float,
           share: float) -> Flight:
    """The path of a spline. fov, share: drawn, for keys that have no lens or distance of their own."""
    keys = [*path.keys, *path.keys[:1]] if path.closed else [*path.keys]
    lenses = np.array([[fov if key.fov is None else key.fov] for key in keys])
    if all(key.azimuth is not None for key in keys):
        spread = np.array([[key.azimuth or 0.0, key.elevation] for key in keys])
        if path.closed:
            # The nearer way to the first key; of two as near, on the way that the keys went
            turns = (spread[-2, 0] - spread[0, 0]) / 360
            spread[-1, 0] += 360 * np.copysign(np.floor(abs(turns) + 0.5), turns)
        between = np.linspace(0, len(spread) - 1, BETWEEN * (len(spread) - 1) + 1)
        usual = 0.0 if all(key.distance for key in keys) else _distance(arrangement, spec, image, fov, share, np.array([
            np.interp(between, np.arange(len(spread)), column) for column in spread.T]).T)
        away = np.array([[key.distance or usual] for key in keys])
        values = np.hstack([spread, np.log(away)])
        level = np.cos(np.radians(spread[:, 1]))
        across = np.radians(np.diff(spread, axis=0)) * np.column_stack([(level[1:] + level[:-1]) / 2,
                                                                       np.ones(len(spread) - 1)])
        steps = np.linalg.norm(np.hstack([across, np.diff(values[:, 2:], axis=0)]), axis=1)
        return _flight(steps, values, lenses, path, lambda found: _about(arrangement, found))
    centre = arrangement.centre
    about = [(key.azimuth, key.elevation) for key in keys if key.azimuth is not None and key.distance is None]
    usual = _distance(arrangement, spec, image, fov, share, np.array(about)) if about else 0.0
    places = [key.position if key.position is not None else centre + (key.distance or usual) * towards(
        (key.azimuth or 0.0) + arrangement.target.yaw, key.elevation) for key in keys]
    aims = [centre if isinstance(key.look_at, str) else key.look_at for key in keys]
    values = np.hstack([np.array(places), np.array(aims)])
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    return _flight(steps, values, lenses, path, lambda found: (found[:, :3], found[:, 3:]))


def _distance(arrangement: Arrangement, spec: CameraSpec, image: ImageSpec, fov: float, share: float,
              angles: np.ndarray) -> float:
    """Metres from the object's centre of keys that do not say it, along (N, 2) azimuths about the object and
    elevations: drawn and shortened as an orbit's."""
    ways = np.array([towards(azimuth + arrangement.target.yaw, elevation) for azimuth, elevation in angles])
    fits, free = fitting(arrangement, spec, image, fov, ways), free_distances(arrangement, spec, ways)
    return float(min([fits.drawn(share), *free[free >= fits.near]]))


def _flight(steps: np.ndarray, values: np.ndarray, lenses: np.ndarray, path: SplineSpec,
            poses: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> Flight:
    knots = np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-6))])
    curve = smooth(knots, values, closed=path.closed)
    # No wider and no narrower than keys say
    return Flight(knots=knots, poses=lambda places: poses(curve(places)),
                  fov=lambda places: np.interp(places, knots, lenses[:, 0])[:, None])


def _about(arrangement: Arrangement, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and points looked at of (N, 3): degrees about the object and above the horizon, logarithm of metres."""
    ways = np.array([towards(azimuth + arrangement.target.yaw, elevation) for azimuth, elevation, _ in values])
    return arrangement.centre + np.exp(values[:, 2:]) * ways, np.broadcast_to(arrangement.centre, ways.shape)


def plan_spline(arrangement: Arrangement, path: SplineSpec, spec: CameraSpec, image: ImageSpec, views: int,
                rng: np.random.Generator, where: str) -> ViewPath:
    """Views at equal lengths of a path, the horizon level. Raises PlanError, naming `where`, where it looks so steeply
    up or down that the picture would spin."""
    fov, share = draw(spec.fov, rng), float(rng.uniform())
    found = flight(arrangement, path, spec, image, fov, share)
    dense = np.linspace(found.knots[0], found.knots[-1], FINE * (len(found.knots) - 1) + 1)
    ways = np.subtract(*reversed(found.poses(dense)))
    # As steep as can be where the camera is what it looks at
    lengths = np.linalg.norm(ways, axis=1)
    steep = np.where(lengths > 1e-6, np.abs(ways[:, 2]) / np.maximum(lengths, 1e-6), 1.0)
    if (worst := degrees(np.arcsin(min(steep.max(), 1.0)))) > STEEPEST_KEY:
        key = int(np.searchsorted(found.knots, dense[steep.argmax()], side="right")) - 1
        rule = (f"expected a path that looks at most {STEEPEST_KEY:g} degrees up or down, got {worst:.1f} between keys "
                f"{key} and {(key + 1) % len(path.keys)}: the picture would spin there")
        raise PlanError([Problem(where=where, path="camera.path.keys", rule=rule,
                                 hint="lead the path past the vertical above what it looks at, or lower its keys")])
    at = found.even(views, closed=path.closed)
    positions, aims = found.poses(at)
    frames = []
    for position, aim, lens in zip(positions, aims, found.fov(at)[:, 0].tolist(), strict=True):
        pinhole = Pinhole(position=position, target=level_with(arrangement, position, aim), fov=lens,
                          width=image.width, height=image.height)
        frames.append(PathFrame(pinhole=pinhole, said=placed_at(position)))
    note = f"spline: {count_of(views, 'view')} at equal lengths through {len(path.keys)} keys" + (
        ", closed" * path.closed)
    return ViewPath(kind="spline", frames=tuple(frames), note=note, hint=HINT)
