"""Shapes of things -> what they are in a building, where no name says so: slabs by where they lie, and which things
enclose the others."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.assets.scene_model import Role, SceneThing
from dataset_builder.geometry.mesh import TriangleMesh, transform
from dataset_builder.geometry.raycast import RayScene

THIN = 0.4
"""Metres of a slab, at the most."""
COVER = 0.6
"""Share of the scene's extent that a slab has to span."""
NEAR = 0.3
"""Metres that a floor may end above the lowest of the rest, and a ceiling begin below the highest."""
BORDER = 0.15
"""Share of the scene's extent from its border within which a wall stands that spans most of it."""
FULL, STOREY = 0.85, 2.0
"""Share of the scene's height, and metres, from which a slab parts rooms or goes round a corner, wherever it stands."""
TALL, WIDE = 1.8, 1.5
"""Metres of height and of either side of what people can be in."""
MOST = 0.5
"""Share of the others that an enclosure contains, and of the rays to all sides from within that meet it."""
MOST_POINTS = 64
SIDES = np.array([[np.cos(turn), np.sin(turn), 0] for turn in np.arange(8) * np.pi / 4])
DOWN = np.array([[0.0, 0.0, -1.0]])


def world_mesh(thing: SceneThing) -> TriangleMesh:
    """The mesh of a thing where it stands."""
    return transform(thing.asset.mesh, thing.world)


def boxes_of(things: Sequence[SceneThing]) -> np.ndarray:
    """(N, 2, 3) corners of things in the world."""
    return np.array([world_mesh(thing).bounds for thing in things]).reshape(-1, 2, 3)


def slab_role(number: int, boxes: np.ndarray) -> Role | None:
    """The part of a building that a thing is by its box and those of the others, (N, 2, 3); None for no slab.

    A floor lies flat below the rest, a ceiling above it, and a wall stands upright at its border; each spans most of
    it. What stands elsewhere is a wall where it goes from floor to ceiling.
    """
    low, high = boxes[number]
    size = high - low
    flat = size[2] <= THIN and size[:2].min() >= WIDE
    if not flat and not (size[:2].min() <= THIN and size[2] >= TALL and size[:2].max() >= WIDE):
        return None
    rest = np.delete(boxes, number, axis=0)
    if not len(rest):
        return "floor" if flat else None
    ends = np.stack([rest[:, 0].min(axis=0), rest[:, 1].max(axis=0)])
    whole = np.maximum(ends[1] - ends[0], 1e-6)
    covered = np.clip((np.minimum(high, ends[1]) - np.maximum(low, ends[0])) / whole, 0, 1)
    if flat and covered[:2].prod() >= COVER:
        if high[2] <= ends[0, 2] + NEAR:
            return "floor"
        if low[2] >= max(ends[1, 2] - NEAR, ends[0, 2] + TALL):
            return "ceiling"
    for across in (0, 1):
        along = 1 - across
        middle = (low[across] + high[across]) / 2
        border = min(middle - ends[0, across], ends[1, across] - middle) <= BORDER * whole[across]
        spans = border and size[2] >= COVER * whole[2] and size[along] >= COVER * whole[along]
        if (size[across] <= THIN and size[2] >= TALL and size[along] >= WIDE
                and (spans or size[2] >= max(STOREY, FULL * whole[2]))):
            return "walls"
    return None


def encloses(thing: SceneThing, others: np.ndarray) -> bool:
    """Whether a thing is a building around most of the others, whose boxes are (N, 2, 3): hollow, as rays from within
    tell. Where there are no others, whether it is hollow and has a floor below its middle."""
    mesh = world_mesh(thing)
    low, high = mesh.bounds
    if high[2] - low[2] < TALL or (high - low)[:2].min() < WIDE:
        return False
    middles = others.mean(axis=1) if len(others) else (low + high)[None] / 2
    within = middles[((middles > low) & (middles < high)).all(axis=1)]
    if len(within) < MOST * len(middles):
        return False
    points = within[::-(-len(within) // MOST_POINTS)]
    rays = RayScene([(mesh.positions, mesh.faces, 1)])
    sides = rays.first_hit(np.repeat(points, len(SIDES), axis=0), np.tile(SIDES, (len(points), 1)))[0]
    below = rays.first_hit(points, np.repeat(DOWN, len(points), axis=0))[0]
    return bool(sides.mean() >= MOST and (len(others) or below.all()))
