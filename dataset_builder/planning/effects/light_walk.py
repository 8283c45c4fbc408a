"""Paths that planning traces through a scene to see how much light arrives after how many edges.

A plain path tracer over NumPy arrays: what rendering does, on a few hundred paths, with surfaces as `scattering` has
them. Lights are found by one point of one light at each vertex that scatters widely, by chance otherwise; a sky by
paths that leave. Edges count as in rendering: panes and gaps passed straight end none. Light that shines straight
through solid glass counts an edge for each surface, as if it were bent by chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from dataset_builder.label.scene_plan import FogPlan
from dataset_builder.planning.effects.scattering import about, around, scatter
from dataset_builder.planning.effects.walk_lamps import WalkLamps
from dataset_builder.planning.effects.walk_surfaces import LIFT, Met, WalkSurfaces

FAINT = 0.1
"""Weight below which a path ends by chance or goes on with this weight."""
STRAIGHT = 64
"""Panes and gaps in a row after which a path ends."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkScene:
    """What paths go through in one pass."""

    surfaces: WalkSurfaces
    lamps: WalkLamps
    fog: FogPlan
    air: np.ndarray
    """(2, 3) low and high corner of the box that fog fills."""

    def through(self, origins: np.ndarray, directions: np.ndarray,
                ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N,) metres along unit directions (N, 3) to where fog begins, and (N,) to where it ends, at most `ends`."""
        steady = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
        low, high = ((corner - origins) / steady for corner in self.air)
        near = np.maximum(np.minimum(low, high).max(axis=1), 0)
        return near, np.maximum(np.minimum(np.maximum(low, high).min(axis=1), ends), near)


@dataclass(kw_only=True, eq=False)
class Walkers:
    """N paths on their way."""

    number: np.ndarray
    """(N,) which path each is."""
    at: np.ndarray
    """(N, 3) where its ray begins."""
    ahead: np.ndarray
    """(N, 3) unit vector along its ray."""
    weight: np.ndarray
    """(N, 3) what light along the ray counts, by channel."""
    edges: np.ndarray
    """(N,) of its path, this ray included if it ends somewhere."""
    narrow: np.ndarray
    """(N,) whether the ray left a vertex that no point of a lamp was drawn at."""

    def of(self, keep: np.ndarray) -> "Walkers":
        """Some of them."""
        return Walkers(**{name: values[keep] for name, values in vars(self).items()})


def from_camera(origin: np.ndarray, directions: np.ndarray) -> Walkers:
    """Paths of the picture: from a point (3,) along unit directions (N, 3)."""
    count = len(directions)
    return Walkers(number=np.arange(count), at=np.tile(origin, (count, 1)), ahead=directions,
                   weight=np.ones((count, 3)), edges=np.ones(count, np.int64), narrow=np.ones(count, bool))


def from_white(scene: WalkScene, starts: Walkers, draws: np.random.Generator) -> tuple[Walkers, np.ndarray]:
    """Paths of raw lighting, at the surfaces that the rays of `starts` meet, and (N, 3) normals there, as
    `arrivals` takes them. Rays that meet none are left out."""
    met = scene.surfaces.meet(starts.at, starts.ahead)
    there, at = starts.of(met.there), starts.at + np.where(met.there, met.distance, 0)[:, None] * starts.ahead
    normal = _against(met.normal[met.there], there.ahead)
    there.at, there.ahead = at[met.there] + LIFT * normal, about(normal, draws)
    there.edges, there.narrow = there.edges + 1, np.zeros(len(normal), bool)
    return there, normal


def arrivals(scene: WalkScene, starts: Walkers, most: int, draws: np.random.Generator,
             normal: np.ndarray | None = None) -> np.ndarray:
    """(N, most + 1) light that N paths bring, mean of its channels, by the edges that it has gone.

    normal: (W, 3) of the surfaces where the last W paths begin; what lamps send there counts, too.
    """
    found, walkers, straight = np.zeros((len(starts.number), most + 1)), starts, 0
    if normal is not None and len(normal):
        _arriving(scene, walkers.of(np.arange(len(starts.number)) >= len(starts.number) - len(normal)), normal, found,
                  draws)
    while len(walkers.number):
        edges = int(walkers.edges.min())
        walkers = _step(scene, walkers, found, draws)
        straight = straight + 1 if len(walkers.number) and walkers.edges.min() == edges else 0
        walkers = _survivors(walkers.of((walkers.edges <= most) & (straight <= STRAIGHT)), draws)
    return found


def joined(parts: Sequence[Walkers]) -> Walkers:
    """Paths one after the other, numbered anew."""
    whole = Walkers(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})
    whole.number = np.arange(len(whole.number))
    return whole


def _add(found: np.ndarray, walkers: Walkers, edges: np.ndarray, light: np.ndarray) -> None:
    """Count light (N, 3) at its number of edges (N,), as far as these are counted. No path is there twice."""
    sent = walkers.weight * light
    kept = edges < found.shape[1]
    found[walkers.number[kept], edges[kept]] += ((sent[:, 0] + sent[:, 1] + sent[:, 2]) / 3)[kept]


def _survivors(walkers: Walkers, draws: np.random.Generator) -> Walkers:
    strength = walkers.weight.max(axis=1)
    chance = np.minimum(strength / FAINT, 1)
    kept = draws.random(len(chance)) < chance
    walkers.weight = walkers.weight / np.maximum(chance, 1e-30)[:, None]
    return walkers.of(kept)


def _step(scene: WalkScene, walkers: Walkers, found: np.ndarray, draws: np.random.Generator) -> Walkers:
    """Paths after the next thing that they meet, less those that end there."""
    met = scene.surfaces.meet(walkers.at, walkers.ahead)
    lamp, radiance = scene.lamps.meet(walkers.at, walkers.ahead)
    end = np.minimum(met.distance, lamp)
    in_air = np.zeros(len(end), bool)
    if scene.fog.extinction:
        near, far = scene.through(walkers.at, walkers.ahead, end)
        flight = near + draws.exponential(1 / scene.fog.extinction, len(end))
        in_air = flight < far
    seen, left = ~in_air & (lamp < met.distance), ~in_air & np.isinf(end)
    for ended, light in ((seen & walkers.narrow, radiance),
                         (left, np.broadcast_to(scene.lamps.sky, (len(left), 3)))):
        if ended.any():
            _add(found, walkers.of(ended), walkers.edges[ended], light[ended])
    on = ~in_air & ~seen & ~left
    ahead = [_on_surface(scene, walkers.of(on), met.of(on), found, draws)]
    if in_air.any():
        ahead.append(_in_fog(scene, walkers.of(in_air), flight[in_air], found, draws))
    return Walkers(**{name: np.concatenate([getattr(one, name) for one in ahead]) for name in vars(walkers)})


def _on_surface(scene: WalkScene, walkers: Walkers, met: Met, found: np.ndarray,
                draws: np.random.Generator) -> Walkers:
    """Paths that a surface scatters."""
    if scene.surfaces.glow:
        _add(found, walkers, walkers.edges, met.factors["emission"])
    chosen = scatter(met, walkers.ahead, draws)
    normal = _against(met.normal, -chosen.direction)
    after = Walkers(number=walkers.number, at=walkers.at + met.distance[:, None] * walkers.ahead + LIFT * normal,
                    ahead=chosen.direction, weight=walkers.weight * chosen.weight,
                    edges=walkers.edges + ~chosen.straight,
                    narrow=np.where(chosen.straight, walkers.narrow, ~chosen.wide))
    if chosen.wide.any():
        _arriving(scene, after.of(chosen.wide), normal[chosen.wide], found, draws)
    return after


def _against(normal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """(N, 3) normals, turned against directions (N, 3)."""
    return normal * np.where(np.einsum("ij,ij->i", normal, ahead) > 0, -1.0, 1.0)[:, None]


def _arriving(scene: WalkScene, walkers: Walkers, normal: np.ndarray | None, found: np.ndarray,
              draws: np.random.Generator) -> None:
    """Count what lamps send to where paths (N) are, on surfaces of unit normals (N, 3) or in the air."""
    sent, crossed, towards = scene.lamps.arriving(walkers.at, normal, scene.surfaces, draws)
    if scene.fog.extinction:
        far = np.linalg.norm(towards, axis=1)
        near, end = scene.through(walkers.at, towards / np.maximum(far, 1e-9)[:, None], far)
        sent *= np.exp(-scene.fog.extinction * (end - near))[:, None]
    _add(found, walkers, walkers.edges + crossed, sent / (4 * pi if normal is None else pi))


def _in_fog(scene: WalkScene, walkers: Walkers, flight: np.ndarray, found: np.ndarray,
            draws: np.random.Generator) -> Walkers:
    """Paths that the fog scatters after so many metres, (N,)."""
    count, g = len(flight), float(np.clip(scene.fog.anisotropy, -0.99, 0.99))
    points = walkers.at + flight[:, None] * walkers.ahead
    number, turn = draws.random(count), 2 * pi * draws.random(count)
    # Henyey and Greenstein's cosine (Pharr et al. 2023, section 11.3)
    cosine = (1 - 2 * number if abs(g) < 1e-3 else
              (1 + g * g - ((1 - g * g) / (1 + g - 2 * g * number)) ** 2) / (2 * g))
    ahead = cosine[:, None] * walkers.ahead + np.sqrt(np.maximum(1 - cosine**2, 0))[:, None] * around(walkers.ahead,
                                                                                                      turn)
    after = Walkers(number=walkers.number, at=points, ahead=ahead, weight=walkers.weight * scene.fog.albedo,
                    edges=walkers.edges + 1, narrow=np.zeros(count, bool))
    # What comes from all sides, as if the phase function were even
    _arriving(scene, after, None, found, draws)
    return after
