"""The rough base: a clean mesh, subdivided until it is fine enough for noise, with the same shape."""

from dataclasses import dataclass, replace

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import Edges, crease_mask, curves, edges_of, unit
from dataset_builder.geometry.loop import loop
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.noise import vertex_normals
from dataset_builder.geometry.refine import MAX_FACES, split_long_edges

BALANCE = 0.5
"""Share of the smoothing that is taken back beforehand, see `balanced`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughBase:
    """An R3DM before its noise. creases: (C, 2) vertex pairs that stay sharp, also in its shading normals."""

    mesh: TriangleMesh
    creases: np.ndarray


def rough_base(mesh: TriangleMesh, *, edge_length: float, rounds: int, crease_angle: float,
               max_faces: int = MAX_FACES) -> RoughBase:
    """Split edges to `edge_length * 2**rounds` metres, then `rounds` rounds of Loop subdivision that keep creases.

    Edges sharper than `crease_angle` degrees are creases, and vertices where a crease turns by more are corners. Edges
    of the result are about `edge_length` or shorter; its volume is that of the mesh, see `balanced`. Raises UserError
    if it would need more than `max_faces` faces, for an edge length <= 0 and for rounds < 0.
    """
    if rounds < 0:
        raise UserError(f"rounds: expected >= 0, got {rounds}")
    coarse = split_long_edges(mesh, edge_length * 2**rounds, max_faces=max(max_faces // 4**rounds, 1))
    edges = edges_of(coarse.faces)
    sharp = crease_mask(coarse, edges, crease_angle=crease_angle)
    once, _ = loop(coarse, rounds=rounds, creases=sharp, corner_angle=crease_angle)
    control = balanced(coarse, once.positions[:len(coarse.positions)], edges, sharp)
    fine, creases = loop(control, rounds=rounds, creases=sharp, corner_angle=crease_angle)
    return RoughBase(mesh=fine, creases=creases)


def balanced(mesh: TriangleMesh, smoothed: np.ndarray, edges: Edges, creases: np.ndarray) -> TriangleMesh:
    """The control mesh that keeps its volume when smoothed: vertices move out by half of what smoothing pulls them in.

    smoothed: (V, 3) where subdivision takes the vertices of `mesh`. Moved by nothing, a polygon's arcs fall inside its
    circle; moved by all of it (progressive interpolation, F. Cheng et al., "Loop Subdivision Surface Based Progressive
    Interpolation", JCST 2009), they bulge out of the polygon by as much; half cancels the change of volume to first
    order. Only the part across the surface counts, or across the curve on a crease: what lies in a flat side stays
    inside it.
    """
    back = mesh.positions - smoothed
    normals = vertex_normals(mesh)
    outwards = np.einsum("ij,ij->i", back, normals)[:, None] * normals
    vertices, neighbours = curves(edges, creases)
    along = unit(mesh.positions[neighbours[:, 1]] - mesh.positions[neighbours[:, 0]])
    outwards[vertices] = back[vertices] - np.einsum("ij,ij->i", back[vertices], along)[:, None] * along
    return replace(mesh, positions=mesh.positions + BALANCE * outwards)
