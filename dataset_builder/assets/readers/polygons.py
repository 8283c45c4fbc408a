"""Polygons of mesh files -> triangles: convex or not, holes joined by a bridge edge included."""

from dataclasses import dataclass

import numpy as np

SLIVER = 1e-9
"""Of the size of a polygon: triangles of less area are not chosen where others will do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangulation:
    """What polygons became."""

    corners: np.ndarray
    """(T, 3) numbers of corners, counted over all polygons in their order."""
    owner: np.ndarray
    """(T,) which polygon each is from, ascending."""
    crossed: np.ndarray
    """Polygons whose outline crosses itself, so that no triangles cover just what it encloses; ascending."""


def triangulated(positions: np.ndarray, indices: np.ndarray, counts: np.ndarray) -> Triangulation:
    """Triangles of planar polygons, wound as these are; no corner is lost, so that neighbours still meet.

    positions: (V, 3), finite. indices: (C,) into them, all corners of the first polygon, then of the next. counts: (F,)
    corners of each; those of fewer than 3 become nothing. A triangle is kept as it is, whatever its area; fans are used
    where all of their triangles face the polygon's way, and ears are clipped elsewhere (mapbox earcut). Polygons
    without an area become fans, too.
    """
    indices, counts = np.asarray(indices, dtype=np.int64), np.asarray(counts, dtype=np.int64)
    firsts = np.cumsum(counts) - counts
    corners: list[np.ndarray] = [np.zeros((0, 3), dtype=np.int64)]
    owner: list[np.ndarray] = [np.zeros(0, dtype=np.int64)]
    crossed: list[int] = []
    for count in np.unique(counts[counts >= 3]):
        faces = np.flatnonzero(counts == count)
        rings = firsts[faces][:, None] + np.arange(count)
        start, hard = _fan_starts(positions, indices, rings)
        fans = np.take_along_axis(rings, (start[:, None] + np.arange(count)) % count, axis=1)[~hard]
        corners.append(np.stack([np.broadcast_to(fans[:, :1], (len(fans), count - 2)), fans[:, 1:-1], fans[:, 2:]],
                                axis=2).reshape(-1, 3))
        owner.append(np.repeat(faces[~hard], count - 2))
        for face in np.flatnonzero(hard):
            clipped, crosses = _clipped(positions[indices[rings[face]]])
            corners.append(rings[face][clipped])
            owner.append(np.full(len(clipped), faces[face]))
            crossed += [int(faces[face])] if crosses else []
    made, owners = np.concatenate(corners), np.concatenate(owner)
    if (np.diff(owners) < 0).any():
        order = np.argsort(owners, kind="stable")
        made, owners = made[order], owners[order]
    return Triangulation(corners=made, owner=owners, crossed=np.array(sorted(crossed), dtype=np.int64))


def _fan_starts(positions: np.ndarray, indices: np.ndarray, rings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corner (0 or 1) that the fan of each polygon starts from, and which polygons need more than a fan."""
    starts, hard = np.zeros(len(rings), dtype=np.int64), np.zeros(len(rings), dtype=bool)
    if rings.shape[1] == 3:
        return starts, hard
    step = max(1, 2**20 // rings.shape[1])
    for first in range(0, len(rings), step):
        part = slice(first, first + step)
        points = positions[indices[rings[part]]]
        least = [_least_area(np.roll(points, -start, axis=1)) for start in (0, 1)]
        starts[part] = (least[0] <= SLIVER) & (least[1] > least[0])
        hard[part] = (np.maximum(*least) <= SLIVER) & (least[0] > -np.inf)
    return starts, hard


def _least_area(points: np.ndarray) -> np.ndarray:
    """(N,) least area of the triangles of a fan from the first of (N, K, 3) points, negative where one faces the other
    way, as a share of the sum of their sizes; -inf of polygons without an area."""
    spokes = points[:, 1:] - points[:, :1]
    areas = np.cross(spokes[:, :-1], spokes[:, 1:])
    normal = areas.sum(axis=1)
    size, length = np.linalg.norm(areas, axis=2).sum(axis=1), np.linalg.norm(normal, axis=1)
    flat = length <= SLIVER * (spokes**2).sum(axis=(1, 2))
    facing = np.einsum("nkc,nc->nk", areas, normal) / np.where(flat, 1, length * size)[:, None]
    return np.where(flat, -np.inf, facing.min(axis=1))


def _clipped(points: np.ndarray) -> tuple[np.ndarray, bool]:
    """(T, 3) indices into a polygon's (K, 3) points, and whether its outline crosses itself."""
    from mapbox_earcut import triangulate_float64

    normal = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    kept = [(axis + 1) % 3, (axis + 2) % 3][::1 if normal[axis] > 0 else -1]
    flat = np.ascontiguousarray(points[:, kept])
    found = triangulate_float64(flat, np.array([len(points)], dtype=np.uint32)).reshape(-1, 3).astype(np.int64)
    found = _with_lost(found[:, ::-1] if _areas(flat, found).sum() < 0 else found, len(points))
    areas = _areas(flat, found)
    enclosed = abs(normal[axis])
    return found, bool(abs(np.abs(areas).sum() - enclosed) > 1e-6 * max(enclosed, np.abs(areas).sum()))


def _areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


def _with_lost(triangles: np.ndarray, count: int) -> np.ndarray:
    """The triangles with the corners that earcut passes over, which lie on their edges: a neighbour may need them."""
    lost = sorted(set(range(count)) - set(triangles.ravel().tolist()))
    if not lost or len(lost) > count - 3:
        return triangles
    used = [corner for corner in range(count) if corner not in set(lost)]
    edges = {(int(face[k]), int(face[(k + 1) % 3])): index for index, face in enumerate(triangles) for k in range(3)}
    made = {index: [face] for index, face in enumerate(triangles.tolist())}
    for before, after in zip(used, [*used[1:], used[0]], strict=True):
        between = [corner % count for corner in range(before + 1, after + (count if after <= before else 0))]
        if between and (before, after) in edges:
            index = edges[before, after]
            made[index] = _split(made[index], before, after, between)
    return np.array([face for faces in made.values() for face in faces], dtype=np.int64).reshape(-1, 3)


def _split(faces: list[list[int]], before: int, after: int, between: list[int]) -> list[list[int]]:
    """The faces, that one with the edge from `before` to `after` replaced by a fan over the corners between them."""
    for number, face in enumerate(faces):
        for k in range(3):
            if (face[k], face[(k + 1) % 3]) == (before, after):
                rim, tip = [before, *between, after], face[(k + 2) % 3]
                fan = [[rim[i], rim[i + 1], tip] for i in range(len(rim) - 1)]
                return [*faces[:number], *fan, *faces[number + 1:]]
    return faces
