"""Pieces of furniture that stand in each other or in walls: edges of one that pass through faces of another."""

from collections.abc import Mapping, Sequence

import numpy as np

from dataset_builder.assets.scene_model import SceneThing
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.geometry.raycast import RayScene

TOLERANCE = 0.02
"""Metres that a piece may reach into another or into a wall without a word."""
MOST_EDGES = 300
"""Of a piece that are looked at, evenly chosen among those near another."""


def overlaps(things: Sequence[SceneThing]) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Names of pairs of objects that reach about 2 cm or more into each other, and of objects and walls.

    Each piece is made smaller about its middle, by 2 cm at the sides of its box; an edge of it that then passes through
    a face of another is what counts, so that a chair under a table is none. Small overlaps go unseen, since not all
    edges are looked at, and so does what is wholly inside another.
    """
    looked_at = [thing for thing in things if thing.role in ("object", "walls")]
    boxes = np.array([_placed(thing).bounds for thing in looked_at]).reshape(-1, 2, 3)
    pieces = [number for number, thing in enumerate(looked_at) if thing.role == "object"]
    near = {number: others for number in pieces if len(others := _near(boxes, number))}
    if not near:
        return [], []
    meshes = {number: _placed(looked_at[number])
              for number in sorted({*near, *(int(other) for others in near.values() for other in others)})}
    scene = _Merged(meshes)
    found = {(number, other) for number, others in near.items()
             for other in scene.met(*_edges(meshes[number], boxes[number], boxes[others])) if other in others}
    names = [thing.name for thing in looked_at]
    movable = set(pieces)
    pairs = {(min(pair), max(pair)) for pair in found if movable.issuperset(pair)}
    walls = {pair for pair in found if pair[1] not in movable}
    return [(names[a], names[b]) for a, b in sorted(pairs)], [(names[a], names[b]) for a, b in sorted(walls)]


def _placed(thing: SceneThing) -> TriangleMesh:
    return transform(thing.asset.mesh, thing.world)


def _near(boxes: np.ndarray, number: int) -> np.ndarray:
    """Which other boxes reach more than the tolerance into a box."""
    low, high = boxes[number]
    shrink = np.minimum(TOLERANCE, (high - low) / 4)
    meets = ((boxes[:, 0] < high - shrink) & (boxes[:, 1] > low + shrink)).all(axis=1)
    meets[number] = False
    return np.flatnonzero(meets)


def _edges(mesh: TriangleMesh, box: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) ends of edges of a piece made smaller, those whose boxes meet one of the (M, 2, 3) others."""
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2
    shrink = np.where(half > 0, 1 - np.minimum(TOLERANCE, half / 2) / np.maximum(half, 1e-9), 1)
    places = middle + (mesh.positions - middle) * shrink
    ends = places[mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)]
    low, high = np.minimum(ends[:, 0], ends[:, 1]), np.maximum(ends[:, 0], ends[:, 1])
    meets = np.zeros(len(ends), bool)
    for other in others:
        meets |= ((low < other[1]) & (high > other[0])).all(axis=1)
    chosen = ends[meets][::max(1, -(-int(meets.sum()) // MOST_EDGES))]
    return chosen[:, 0], chosen[:, 1]


class _Merged:
    """Several meshes that rays meet all of, not the first only."""

    def __init__(self, meshes: Mapping[int, TriangleMesh]):
        whole = concatenate(list(meshes.values()))
        self._owner = np.repeat(list(meshes), [len(mesh.faces) for mesh in meshes.values()])
        self._rays = RayScene([(whole.positions, whole.faces, 1)])

    def met(self, starts: np.ndarray, ends: np.ndarray) -> set[int]:
        """Numbers of the meshes whose faces (N, 3) segments pass through."""
        long = np.linalg.norm(ends - starts, axis=1) > 1e-6
        _, face, distance = self._rays.hits(starts[long], (ends - starts)[long])
        return set(self._owner[face[(distance >= 0) & (distance <= 1)]].tolist())
