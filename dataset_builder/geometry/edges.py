"""Edges of a triangle mesh: which faces meet there, at what angle, whether they are sharp; and normals split there."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.mesh import TriangleMesh

NEXT = (1, 2, 0)
CREASE_ANGLE = 30.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Edges:
    """Unique undirected edges, sorted by their vertices."""

    vertices: np.ndarray
    """(E, 2) int64, smaller index first."""
    of_face: np.ndarray
    """(F, 3) int64; column k is the edge from corner k to corner k+1."""
    forward: np.ndarray
    """(F, 3) bool, True where the face runs from the smaller vertex index to the larger."""

    @cached_property
    def half_edges(self) -> np.ndarray:
        """(3 F,) flat places in `of_face` in the order of their edges, each edge's in face order."""
        return np.argsort(self.of_face.ravel(), kind="stable")

    @cached_property
    def face_count(self) -> np.ndarray:
        """(E,) number of faces at each edge: 1 on a boundary, 2 inside a surface, more where it is not a manifold."""
        return np.bincount(self.of_face.ravel(), minlength=len(self.vertices))

    @cached_property
    def faces(self) -> np.ndarray:
        """(E, 2) int64 first two faces of each edge, in face order; -1 where there is none."""
        starts = np.concatenate([[0], np.cumsum(self.face_count)[:-1]]).astype(np.int64)
        owners = self.half_edges // 3
        second = owners[np.minimum(starts + 1, max(len(owners) - 1, 0))]
        return np.stack([owners[starts], np.where(self.face_count > 1, second, -1)], axis=1)


def edges_of(faces: np.ndarray) -> Edges:
    """Unique edges of (F, 3) faces."""
    start, end = faces.astype(np.int64), faces[:, NEXT].astype(np.int64)
    span = int(faces.max()) + 1 if len(faces) else 1
    keys, of_face = np.unique(np.minimum(start, end) * span + np.maximum(start, end), return_inverse=True)
    return Edges(vertices=np.stack(np.divmod(keys, span), axis=1), of_face=of_face.reshape(faces.shape),
                 forward=start < end)


def find_edges(edges: Edges, pairs: np.ndarray) -> np.ndarray:
    """(E,) bool mask of the edges that (C, 2) vertex pairs name, in either direction; pairs that are no edge are passed
    over."""
    span = 1 + max(int(edges.vertices.max(initial=0)), int(pairs.max(initial=0)))
    low, high = pairs.min(axis=1).astype(np.int64), pairs.max(axis=1).astype(np.int64)
    return np.isin(edges.vertices[:, 0] * span + edges.vertices[:, 1], low * span + high)


def unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors scaled to length 1; zero vectors stay zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def dihedral_angles(mesh: TriangleMesh, edges: Edges) -> np.ndarray:
    """(E,) angle in degrees between the normals of the two faces at each edge: 0 is flat, 180 folded back.

    180 also stands for an edge without exactly two faces of the same orientation, or at a face without area.
    """
    normals = unit(mesh.area_normals)
    first, second = normals[edges.faces[:, 0]], normals[edges.faces[:, 1]]
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    angle = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", first, second)))
    measured = consistent(edges) & first.any(axis=1) & second.any(axis=1)
    return np.where(measured, angle, 180.0)


def consistent(edges: Edges) -> np.ndarray:
    """(E,) bool: exactly two faces meet, and they pass the edge in opposite directions, as on an orientable surface."""
    forward = np.bincount(edges.of_face.ravel(), weights=edges.forward.ravel(), minlength=len(edges.vertices))
    return (edges.face_count == 2) & (forward == 1)


def closed(edges: Edges) -> bool:
    """Whether a surface encloses a volume: every edge is passed as often one way as the other."""
    forward = np.bincount(edges.of_face.ravel(), weights=edges.forward.ravel(), minlength=len(edges.vertices))
    return bool((2 * forward == edges.face_count).all())


def crease_mask(mesh: TriangleMesh, edges: Edges, *, crease_angle: float) -> np.ndarray:
    """(E,) bool: the edge stays sharp, because its faces meet at more than `crease_angle` degrees (0 to 180), or
    because it is a boundary, not a manifold, or joins faces of opposite orientation."""
    return (dihedral_angles(mesh, edges) > crease_angle) | ~consistent(edges)


def curves(edges: Edges, creases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N,) with exactly two edges in the (E,) mask `creases`, ascending, and their (N, 2) neighbours along
    it."""
    pairs = edges.vertices[creases]
    ends, others = pairs.T.ravel(), pairs[:, ::-1].T.ravel()
    order = np.argsort(ends, kind="stable")
    order = order[np.bincount(ends, minlength=1)[ends[order]] == 2]
    return ends[order[::2]], others[order].reshape(-1, 2)


def fans(edges: Edges, passable: np.ndarray) -> np.ndarray:
    """(F, 3) int64: corners of one vertex share a number where faces around it connect across `passable` (E,) edges.

    Every edge's faces are joined in a chain, so that more than two faces may meet where the mask allows it.
    """
    order = edges.half_edges
    edge = edges.of_face.ravel()[order]
    joined = (edge[:-1] == edge[1:]) & passable[edge[:-1]]
    one, other = order[:-1][joined], order[1:][joined]
    low_one, low_other = (_corner_at(edges, halves, low=True) for halves in (one, other))
    high_one, high_other = (_corner_at(edges, halves, low=False) for halves in (one, other))
    rows, columns = np.concatenate([low_one, high_one]), np.concatenate([low_other, high_other])
    graph = coo_array((np.ones(len(rows), bool), (rows, columns)), shape=(edges.of_face.size,) * 2)
    return connected_components(graph, directed=False)[1].reshape(edges.of_face.shape).astype(np.int64)


def _corner_at(edges: Edges, halves: np.ndarray, *, low: bool) -> np.ndarray:
    """Flat corner index at the lower or the higher vertex of flat half-edges."""
    face, slot = np.divmod(halves, 3)
    starts_there = edges.forward.ravel()[halves] == low
    return face * 3 + np.where(starts_there, slot, (slot + 1) % 3)


def corner_normals(mesh: TriangleMesh, *, crease_angle: float = CREASE_ANGLE, creases: np.ndarray | None = None) \
        -> np.ndarray:
    """(F, 3, 3) unit normals of the face corners.

    Faces around a vertex that connect without crossing a crease share the mean of their normals, weighted by the angle
    that each fills at the vertex (G. Thuermer, C. Wuethrich, "Computing Vertex Normals from Polygonal Facets", JGT
    1998). creases: (C, 2) vertex pairs; without them, edges sharper than `crease_angle` degrees. Boundaries,
    non-manifold edges and edges between faces of opposite orientation always separate. A corner whose normals cancel
    takes its face's normal, a face without area the normal of its neighbours or +Z.
    """
    edges = edges_of(mesh.faces)
    if creases is None:
        sharp = crease_mask(mesh, edges, crease_angle=crease_angle)
    else:
        sharp = find_edges(edges, creases) | ~consistent(edges)
    fan = fans(edges, ~sharp)
    face_normals = unit(mesh.area_normals)
    weighted = (corner_angles(mesh)[..., None] * face_normals[:, None]).reshape(-1, 3)
    sums = np.stack([np.bincount(fan.ravel(), weights=weighted[:, axis]) for axis in range(3)], axis=1)
    # Cancelled sums are rounding noise: their direction means nothing.
    sums[np.linalg.norm(sums, axis=1) < 1e-9] = 0
    normals = unit(sums)[fan]
    upright = np.broadcast_to((0.0, 0.0, 1.0), face_normals.shape)
    for fallback in (face_normals, _neighbourhood(mesh, face_normals), upright):
        missing = ~normals.any(axis=2)
        normals[missing] = np.repeat(fallback[:, None], 3, axis=1)[missing]
    return normals


def corner_angles(mesh: TriangleMesh) -> np.ndarray:
    """(F, 3) interior angles in radians; 0 at a corner with an edge without length."""
    leaving = unit(mesh.corners[:, NEXT] - mesh.corners)
    arriving = -np.roll(leaving, 1, axis=1)
    cross = np.linalg.norm(np.cross(leaving, arriving), axis=2)
    return np.arctan2(cross, np.einsum("fij,fij->fi", leaving, arriving)) * leaving.any(axis=2) * arriving.any(axis=2)


def _neighbourhood(mesh: TriangleMesh, face_normals: np.ndarray) -> np.ndarray:
    """(F, 3) mean normal of all faces that share a vertex with a face."""
    sums = np.stack([np.bincount(mesh.faces.ravel(), weights=np.repeat(face_normals[:, axis], 3),
                                 minlength=len(mesh.positions)) for axis in range(3)], axis=1)
    return unit(sums[mesh.faces].sum(axis=1))
