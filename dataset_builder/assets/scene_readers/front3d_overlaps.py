"""Pieces of furniture that stand in each other or in walls: edges of one that pass through faces of another."""

from collections.abc import Sequence

import numpy as np

from dataset_builder.assets.scene_model import SceneThing
from dataset_builder.geometry.mesh import TriangleMesh, transform
from dataset_builder.geometry.raycast import RayScene

TOLERANCE = 0.02
"""Metres that a piece may reach into another or into a wall without a word."""
MOST_EDGES = 300
"""Of a piece that are looked at, evenly chosen among those near another."""


def overlaps(things: Sequence[SceneThing]) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Names of pairs of objects that reach more than 2 cm into each other, and of objects and walls.

    Each piece is made smaller by 2 cm on all sides; an edge of it that then passes through a face of another is what
    counts, so that a chair under a table is none. A small overlap can go unseen, since not all edges are looked at.
    """
    boxed = [(thing, mesh, mesh.bounds) for thing in things if thing.role in ("object", "walls")
             for mesh in [transform(thing.asset.mesh, thing.world)]]
    boxes = np.array([box for _, _, box in boxed]).reshape(-1, 2, 3)
    pieces = [number for number, (thing, _, _) in enumerate(boxed) if thing.role == "object"]
    near = {number: others for number in pieces if len(others := _near(boxes, number))}
    if not near:
        return [], []
    used = sorted({*near, *(int(other) for others in near.values() for other in others)})
    scene = _Merged([boxed[number][1] for number in used], used)
    found = {(number, other) for number, others in near.items()
             for other in scene.met(*_edges(boxed[number][1], boxes[number], boxes[others])) if other in others}
    names = [thing.name for thing, _, _ in boxed]
    movable = set(pieces)
    pairs = {(min(pair), max(pair)) for pair in found if movable.issuperset(pair)}
    walls = {pair for pair in found if pair[1] not in movable}
    return [(names[a], names[b]) for a, b in sorted(pairs)], [(names[a], names[b]) for a, b in sorted(walls)]


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
    pairs = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    ends = places[pairs]
    low, high = ends.min(axis=1), ends.max(axis=1)
    meets = np.zeros(len(pairs), bool)
    for other in others:
        meets |= ((low < other[1]) & (high > other[0])).all(axis=1)
    chosen = ends[meets][::max(1, -(-int(meets.sum()) // MOST_EDGES))]
    return chosen[:, 0], chosen[:, 1]


class _Merged:
    """Several meshes that rays meet all of, not the first only."""

    def __init__(self, meshes: list[TriangleMesh], numbers: list[int]):
        firsts = np.cumsum([0, *(len(mesh.positions) for mesh in meshes)])
        faces = np.concatenate([mesh.faces + first for mesh, first in zip(meshes, firsts, strict=False)])
        self._owner = np.repeat(numbers, [len(mesh.faces) for mesh in meshes])
        self._rays = RayScene([(np.concatenate([mesh.positions for mesh in meshes]), faces, 1)])

    def met(self, starts: np.ndarray, ends: np.ndarray) -> set[int]:
        """Numbers of the meshes whose faces (N, 3) segments pass through."""
        long = np.linalg.norm(ends - starts, axis=1) > 1e-6
        _, face, distance = self._rays.hits(starts[long], (ends - starts)[long])
        return set(self._owner[face[(distance >= 0) & (distance <= 1)]].tolist())
