"""Shading normals, smooth within a surface and split at its creases."""

import numpy as np

from dataset_builder.geometry.edges import NEXT, consistent, crease_mask, edges_of, fans, find_edges, unit
from dataset_builder.geometry.mesh import TriangleMesh

CREASE_ANGLE = 30.0


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
