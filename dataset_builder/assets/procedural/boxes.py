"""Solids with flat sides: the chamfered box, the lattice box that others bend, and the plate with openings."""

import itertools
from functools import cache

import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh

MIN_PART = 1e-4
ENDS = np.array([-1.0, 1.0])


def solid(positions: np.ndarray, faces: np.ndarray, *, grain: int = 2) -> TriangleMesh:
    """Mesh of `positions` (V, 3) and `faces` (F, 3) with box-projected coordinates in metres and material 0."""
    corners = positions[faces]
    axis, sign = facing(corners)
    return with_uvs(positions, faces, box_uvs(corners, axis, sign, grain=grain))


def with_uvs(positions: np.ndarray, faces: np.ndarray, uvs: np.ndarray) -> TriangleMesh:
    """Mesh of `positions` (V, 3), `faces` (F, 3) and `uvs` (F, 3, 2), all of material 0."""
    return TriangleMesh(positions=positions, faces=faces, uvs=uvs, material=np.zeros(len(faces), dtype=np.int32))


def split_quads(quads: np.ndarray) -> np.ndarray:
    """(2Q, 3) triangles of (Q, 4) quadrilaterals, each cut from its first to its third corner."""
    return quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)


@cache
def _chamfer_topology() -> np.ndarray:
    """(44, 3) faces over 24 vertices: vertex 3 * corner + axis lies on the side of `axis` near `corner`."""
    signs = list(itertools.product((-1, 1), repeat=3))
    points = np.array([[s * (1.0 if a == axis else 0.8) for a, s in enumerate(sign)]
                       for sign in signs for axis in range(3)])
    polygons: list[list[int]] = [[3 * corner + axis for axis in range(3)] for corner in range(8)]
    for axis, side in itertools.product(range(3), (-1, 1)):
        polygons.append([3 * c + axis for c, sign in enumerate(signs) if sign[axis] == side])
    for along in range(3):
        first, second = (axis for axis in range(3) if axis != along)
        for one, two in itertools.product((-1, 1), repeat=2):
            pair = [c for c, sign in enumerate(signs) if sign[first] == one and sign[second] == two]
            polygons.append([3 * c + axis for c in pair for axis in (first, second)])
    return np.array([face for polygon in polygons for face in _fan(points, polygon)])


def _fan(points: np.ndarray, polygon: list[int]) -> list[list[int]]:
    """Triangles of a flat convex polygon of a solid around the origin, in outward order."""
    centre = points[polygon].mean(axis=0)
    start = points[polygon[0]] - centre
    side = np.cross(centre, start)
    offsets = points[polygon] - centre
    order = np.argsort(np.arctan2(offsets @ side / np.linalg.norm(side), offsets @ start / np.linalg.norm(start)))
    loop = [polygon[index] for index in order]
    return [[loop[0], loop[k], loop[k + 1]] for k in range(1, len(loop) - 1)]


def bevelled_box(size: tuple[float, float, float], *, bevel: float, grain: int | None = None) -> TriangleMesh:
    """Box of `size` metres about the origin with every edge chamfered by `bevel`, at most a third of the thinnest side.

    44 triangles, or 12 where `bevel` is 0. Coordinates in metres with v along axis `grain`, by default the longest.
    """
    half = np.maximum(np.asarray(size), MIN_PART) / 2
    along = int(half.argmax()) if grain is None else grain
    if bevel == 0:
        points, quads = lattice_box((half[0] * ENDS, half[1] * ENDS, half[2] * ENDS))
        return solid(points, split_quads(quads), grain=along)
    cut = min(bevel, 2 * float(half.min()) / 3)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    positions = signs[:, None, :] * (half - cut * (1 - np.eye(3)))[None]
    return solid(positions.reshape(-1, 3), _chamfer_topology(), grain=along)


def lattice_box(cuts: tuple[np.ndarray, np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Surface of a box cut at the given x, y and z (ascending): (V, 3) positions and (Q, 4) outward quadrilaterals."""
    counts = [len(cut) for cut in cuts]
    index = np.arange(np.prod(counts)).reshape(counts)
    quads = []
    for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        layers = index.transpose(order)
        quads += [_grid_quads(layers[-1]), _grid_quads(layers[0])[:, ::-1]]
    used, compact = np.unique(np.concatenate(quads), return_inverse=True)
    points = np.stack(np.meshgrid(*cuts, indexing="ij"), axis=-1).reshape(-1, 3)
    return points[used], compact.reshape(-1, 4)


def _grid_quads(grid: np.ndarray) -> np.ndarray:
    """(Q, 4) quadrilaterals of a (M, N) grid of indices, turning from its first direction to its second."""
    return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)


def plate(cells: np.ndarray, xs: np.ndarray, zs: np.ndarray, *, thickness: float) -> TriangleMesh:
    """Upright plate in y in [0, thickness] of the `cells` (len(xs)-1, len(zs)-1) that are True: a wall with openings.

    One closed solid without T-junctions; coordinates in metres, v up. Cells must not touch at a corner alone.
    """
    count = len(xs) * len(zs)
    front = _grid_quads(np.arange(count).reshape(len(xs), len(zs)))[cells.ravel()]
    edge = _boundary(front)
    rims = np.stack([edge[:, 1], edge[:, 0], edge[:, 0] + count, edge[:, 1] + count], axis=-1)
    faces = split_quads(np.concatenate([front, front[:, ::-1] + count, rims]))
    flat = np.stack(np.meshgrid(xs, zs, indexing="ij"), axis=-1).reshape(-1, 2)
    sheets = [np.insert(flat, 1, y, axis=1) for y in (0.0, thickness)]
    used, compact = np.unique(faces, return_inverse=True)
    return solid(np.concatenate(sheets)[used], compact.reshape(faces.shape))


def _boundary(quads: np.ndarray) -> np.ndarray:
    """(E, 2) directed edges of the quadrilaterals that no other one walks the other way."""
    edges = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    walked = {(int(i), int(j)) for i, j in edges}
    return np.array([(i, j) for i, j in edges if (int(j), int(i)) not in walked])


def box_uvs(corners: np.ndarray, axis: np.ndarray, sign: np.ndarray, *, grain: int) -> np.ndarray:
    """(F, 3, 2) coordinates in metres of `corners` (F, 3, 3), seen along `axis` (F,) from its side `sign` (F,).

    v runs along axis `grain` (0 x, 1 y, 2 z) wherever the face holds it, and (u, v, outward) is right-handed.
    """
    uvs = np.empty((*corners.shape[:2], 2))
    for normal in range(3):
        chosen = axis == normal
        v_axis = grain if grain != normal else (1 if normal == 2 else 2)
        u_axis = 3 - normal - v_axis
        handed = 1 if (u_axis, v_axis) in ((0, 1), (1, 2), (2, 0)) else -1
        uvs[chosen, :, 0] = corners[chosen, :, u_axis] * (handed * sign[chosen])[:, None]
        uvs[chosen, :, 1] = corners[chosen, :, v_axis]
    return uvs


def facing(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(F,) nearest axis and (F,) sign of every face's normal; ties go to the first axis, whatever the rounding."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    units = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0).round(6)
    axis = np.abs(units).argmax(axis=1)
    sign = np.where(np.take_along_axis(units, axis[:, None], axis=1)[:, 0] < 0, -1.0, 1.0)
    return axis, sign
