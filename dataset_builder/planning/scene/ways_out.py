"""Which light from outside finds its way to a target: paths from beside it that bounce about until they leave."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dataset_builder.geometry.raycast import RayScene
from dataset_builder.seeding import rng

PATHS, BOUNCES = 2048, 8
BESIDE, RISE = 0.5, 1.2
"""Metres beside and above where the target stands that paths begin within."""
LIFT = 1e-3
"""Metres from a surface that paths go on from."""


class Lines(NamedTuple):
    """Half-lines: (N, 3) where they begin, (N, 3) unit vectors along them."""

    origins: np.ndarray
    directions: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class WaysOut:
    """Which paths find a light."""

    found: int
    paths: int
    leaving: Lines
    """The last edges of those that leave the scene; none where a sun was looked for."""


def ways_out(scene: RayScene, near: np.ndarray, towards: np.ndarray | None, *, paths: int = PATHS,
             seed: int = 0) -> WaysOut:
    """Of paths from beside `near` (3,), with BOUNCES diffuse bounces, those that leave the scene; with a unit direction
    (3,) `towards` a sun, those that see it from their beginning or from where they bounce.

    scene: all that stands about, the target not.
    """
    draws = rng(seed, "ways out")
    at = _beside(scene, near, draws, paths)
    ahead = _sphere(draws, paths)
    found, going = np.zeros(paths, bool), np.arange(paths)
    leaving = [np.zeros((0, 6))]
    for bounce in range(BOUNCES + 1):
        if towards is not None:
            found[going] = np.isinf(scene.first_hit(at, np.broadcast_to(towards, at.shape))[1])
        # Numbers are drawn for all, so that no path depends on how the others fare
        turns = _sphere(draws, paths)[going]
        distance, normal = scene.first_hit(at, ahead)[1], scene.normals(at, ahead)
        left = np.isinf(distance)
        found[going[left]] |= towards is None
        if towards is None:
            leaving.append(np.hstack([at[left], ahead[left]]))
        on = ~left & ~found[going]
        if bounce == BOUNCES or not on.any():
            break
        at = at[on] + ahead[on] * distance[on, None] + LIFT * normal[on]
        ahead, going = normal[on] + (1 - LIFT) * turns[on], going[on]
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    origins, directions = np.hsplit(np.concatenate(leaving), 2)
    return WaysOut(found=int(found.sum()), paths=paths, leaving=Lines(origins, directions))


def _beside(scene: RayScene, near: np.ndarray, draws: np.random.Generator, paths: int) -> np.ndarray:
    """(paths, 3) points about `near` that nothing hides from it; `near` itself, lifted, in place of hidden ones."""
    start = near + np.array([0.0, 0.0, 0.05])
    points = start + draws.uniform([-BESIDE, -BESIDE, 0.0], [BESIDE, BESIDE, RISE], (paths, 3))
    hidden = scene.occluded(np.broadcast_to(start, points.shape), points)
    return np.where(hidden[:, None], start, points)


def _sphere(draws: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3) unit vectors, evenly over the sphere."""
    vectors = draws.normal(size=(count, 3))
    unit: np.ndarray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
