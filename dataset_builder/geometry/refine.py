"""Split long edges at their midpoints, without T-junctions and without moving the surface."""

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import Edges, edges_of
from dataset_builder.geometry.mesh import TriangleMesh

MAX_FACES = 4_000_000
"""Default face budget, about 1 GB of arrays on the way."""
EQUILATERAL = 3**0.5 / 4
ALL_SPLIT = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""Children of a triangle: 0 to 2 are its corners, 3 to 5 the midpoints of the edges that leave them."""


def split_long_edges(mesh: TriangleMesh, max_length: float, *, max_faces: int = MAX_FACES) -> TriangleMesh:
    """Conforming midpoint refinement until no edge is longer than `max_length` metres.

    Every edge that is too long is halved for all of its faces at once; a face with one, two or three halved edges
    becomes two, three or four. New corners lie on the old triangles and take linear uvs: volume, extent and texture
    stay. Raises UserError if more than `max_faces` faces would be needed, or if `max_length` is not positive.
    """
    if not max_length > 0:
        raise UserError(f"edge length: expected > 0 m, got {max_length:g}")
    _check_area(mesh, max_length, max_faces)
    while True:
        edges = edges_of(mesh.faces)
        ends = mesh.positions[edges.vertices]
        long = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) > max_length
        if not long.any():
            return mesh
        _check_budget(len(mesh.faces) + int(edges.face_count[long].sum()), max_length, max_faces)
        mesh = _split(mesh, edges, long)


def _check_area(mesh: TriangleMesh, max_length: float, max_faces: int) -> None:
    """Refuse early: no triangle with such edges is larger than the equilateral one."""
    area = float(np.linalg.norm(mesh.area_normals, axis=1).sum()) / 2
    _check_budget(max(len(mesh.faces), int(area / (EQUILATERAL * max_length**2))), max_length, max_faces)


def _check_budget(needed: int, max_length: float, max_faces: int) -> None:
    if needed > max_faces:
        raise UserError(f"mesh: edges of at most {max_length:g} m need at least {needed} faces, more than the "
                        f"{max_faces} allowed; raise edge_length, or check the scale of the model")


def _split(mesh: TriangleMesh, edges: Edges, long: np.ndarray) -> TriangleMesh:
    """One round: halve the edges in the (E,) mask `long`."""
    number = len(mesh.positions) + np.cumsum(long) - 1
    midpoints = mesh.positions[edges.vertices[long]].mean(axis=1)
    six = np.concatenate([mesh.faces, number[edges.of_face]], axis=1)
    six_uvs = with_midpoints(mesh.uvs)
    positions = np.concatenate([mesh.positions, midpoints])
    parents, slots = _children(six, long[edges.of_face], positions)
    return TriangleMesh(positions=positions, faces=six[parents[:, None], slots],
                        uvs=six_uvs[parents[:, None], slots], material=mesh.material[parents])


def with_midpoints(corners: np.ndarray) -> np.ndarray:
    """(F, 6, n) corners, then midpoints of the edges that leave them, of (F, 3, n) corner values."""
    return np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)


def _children(six: np.ndarray, halved: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parent face (N,) and slots (N, 3) among its six points of every face of the next round, in order of parents."""
    count = halved.sum(axis=1)
    whole = np.flatnonzero(count == 0)
    parts = [(whole, np.broadcast_to(np.arange(3), (len(whole), 3)))]
    parts += [_pattern(np.flatnonzero(count == 3), np.zeros(1, np.int64), ALL_SPLIT)]
    one = np.flatnonzero(count == 1)
    parts += [_pattern(one, halved[one].argmax(axis=1), ((0, 3, 2), (3, 1, 2)))]
    two = np.flatnonzero(count == 2)
    # Turn the face so that its whole edge is the last one; cut the quadrilateral left over along its shorter diagonal.
    turn = (~halved[two]).argmax(axis=1) + 1
    across = [_distance(positions, six, two, turn, pair) for pair in ((0, 4), (3, 2))]
    short = across[0] <= across[1]
    parts += [_pattern(two[short], turn[short], ((3, 1, 4), (0, 3, 4), (0, 4, 2)))]
    parts += [_pattern(two[~short], turn[~short], ((3, 1, 4), (0, 3, 2), (3, 4, 2)))]
    parents = np.concatenate([part[0] for part in parts])
    order = np.argsort(parents, kind="stable")
    return parents[order], np.concatenate([part[1] for part in parts])[order]


def _pattern(faces: np.ndarray, turn: np.ndarray, triangles: tuple[tuple[int, int, int], ...]) \
        -> tuple[np.ndarray, np.ndarray]:
    """Children of `faces` after `triangles`, whose slots are turned by `turn` corners."""
    slots = _turned(np.array(triangles)[None], np.broadcast_to(turn, faces.shape)[:, None, None])
    return np.repeat(faces, len(triangles)), slots.reshape(-1, 3)


def _turned(slots: np.ndarray, turn: np.ndarray) -> np.ndarray:
    return np.where(slots < 3, (slots + turn) % 3, 3 + (slots + turn) % 3)


def _distance(positions: np.ndarray, six: np.ndarray, faces: np.ndarray, turn: np.ndarray, pair: tuple[int, int]) \
        -> np.ndarray:
    one, other = (positions[six[faces, _turned(np.array(slot), turn)]] for slot in pair)
    return np.linalg.norm(one - other, axis=1)
