"""Which way faces wind: the pieces of a mesh, faces wound against their neighbours, and closed pieces inside out."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.edges import Edges, consistent
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import RayScene

FLAT = 1e-9
"""Least volume of a closed piece in units of its area times the extent of the mesh; below, it has no inside."""
WAYS = np.array([(0.267261, 0.534522, 0.801784), (-0.720577, 0.262028, 0.641949), (0.365148, -0.912871, 0.182574)])
"""Directions along no axis, which rays to the outside take."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Winding:
    """What is wrong with the winding of F faces in P pieces."""

    piece: np.ndarray
    """(F,) number of the piece: faces that connect by way of edges, whichever way they wind."""
    against: np.ndarray
    """(F,) bool: to be turned to wind as its neighbours do."""
    inside_out: np.ndarray
    """(P,) bool: closed once that is done, encloses a negative volume, and is not a cavity; to be turned."""
    closed: np.ndarray
    """(P,) bool: encloses a volume."""
    one_sided: int
    """Pieces that cannot be wound consistently, like a Moebius strip; nothing of them is turned."""

    @property
    def turned(self) -> np.ndarray:
        """(F,) bool: every face to be turned."""
        return self.against ^ self.inside_out[self.piece]


def winding_of(mesh: TriangleMesh, edges: Edges) -> Winding:
    """The pieces of a mesh and what of them is wound the wrong way. edges: those of its faces."""
    piece = pieces(edges)
    against, one_sided = _against(edges, piece)
    forward = edges.forward ^ against[:, None]
    balance = np.bincount(edges.of_face.ravel(), weights=2.0 * forward.ravel() - 1, minlength=len(edges.vertices))
    closed = np.bincount(piece, weights=(balance[edges.of_face] != 0).any(axis=1)) == 0
    low, high = mesh.bounds
    corners = mesh.corners - (low + high) / 2
    sign = np.where(against, -1.0, 1.0)
    volume = np.bincount(piece, weights=sign * np.einsum("ij,ij->i", corners[:, 0],
                                                         np.cross(corners[:, 1], corners[:, 2]))) / 6
    area = np.bincount(piece, weights=np.linalg.norm(mesh.area_normals, axis=1)) / 2
    least = FLAT * area * float(np.linalg.norm(high - low))
    inverted = closed & (volume < -least)
    if inverted.any():
        inverted[inverted] = ~_within(mesh, piece, np.flatnonzero(inverted), (closed & (volume > least))[piece])
    return Winding(piece=piece, against=against, inside_out=inverted, closed=closed, one_sided=one_sided)


def pieces(edges: Edges) -> np.ndarray:
    """(F,) number of the piece that each face belongs to, from 0: those that share edges belong together."""
    order = edges.half_edges
    edge = edges.of_face.ravel()[order]
    joined = edge[:-1] == edge[1:]
    return _components(order[:-1][joined] // 3, order[1:][joined] // 3, len(edges.of_face))


def turn(mesh: TriangleMesh, faces: np.ndarray) -> TriangleMesh:
    """The mesh with the faces in the (F,) mask wound the other way; the mesh itself where there are none."""
    if not faces.any():
        return mesh
    order = np.where(faces[:, None], [0, 2, 1], [0, 1, 2])
    rows = np.arange(len(faces))[:, None]
    return TriangleMesh(positions=mesh.positions, faces=mesh.faces[rows, order], uvs=mesh.uvs[rows, order],
                        material=mesh.material, colors=None if mesh.colors is None else mesh.colors[rows, order])


def _components(one: np.ndarray, other: np.ndarray, count: int) -> np.ndarray:
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _against(edges: Edges, piece: np.ndarray) -> tuple[np.ndarray, int]:
    """(F,) mask of the faces to turn, and the number of one-sided pieces.

    Every face has two states, as it is and turned. Across an edge of two faces the states go together that agree; the
    states of a face that are reached from each other make its surroundings one-sided. Of what connects, the fewer faces
    are turned; of equally many, those unlike the first.
    """
    count, two = len(piece), edges.face_count == 2
    odd = ~consistent(edges)[two]
    if not odd.any():
        return np.zeros(count, bool), 0
    one, other = edges.faces[two].T
    state = _components(np.concatenate([one, one + count]),
                        np.concatenate([other + count * odd, other + count * ~odd]), 2 * count)
    kept, turned = state[:count], state[count:]
    group, side = np.minimum(kept, turned), kept > turned
    _, first, group = np.unique(group, return_index=True, return_inverse=True)
    size, on_side = np.bincount(group), np.bincount(group, weights=side)
    few, even = 2 * on_side < size, 2 * on_side == size
    against = np.where(even[group], side != side[first][group], side == few[group])
    single = kept == turned
    return against & ~single, len(np.unique(piece[single]))


def _within(mesh: TriangleMesh, piece: np.ndarray, asked: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """(N,) bool: the pieces in `asked` lie inside one that the (F,) mask `solid` closes, so that they are cavities.

    From a point of each, rays leave the solid pieces once more than they enter them; most of three rays tell.
    """
    if not solid.any():
        return np.zeros(len(asked), bool)
    first = np.unique(piece, return_index=True)[1][asked]
    low, high = mesh.bounds
    scale = float(np.ptp(mesh.bounds, axis=0).max())
    positions = (mesh.positions - (low + high) / 2) / scale
    points, normals = positions[mesh.faces[first]].mean(axis=1), mesh.area_normals[solid]
    scene = RayScene([(positions, mesh.faces[solid], 1)])
    votes = np.zeros(len(asked), int)
    for way in WAYS:
        ray, face, _ = scene.hits(points, np.broadcast_to(way, points.shape))
        leaving = np.bincount(ray, weights=np.sign(normals[face] @ way), minlength=len(points))
        votes += leaving > 0
    return votes > len(WAYS) // 2
