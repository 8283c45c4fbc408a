"""From a clean mesh to a rough one: made fine enough, and moved by noise."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import Edges, crease_mask, curves, edges_of, unit
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.subdivision import MAX_FACES, loop, split_long_edges

BALANCE = 0.5
"""Share of the smoothing that is taken back beforehand, see `balanced`."""


def bounding_radius(mesh: TriangleMesh) -> float:
    """Radius in metres of the sphere about the centre of the bounding box through the farthest vertex that a face uses.

    The unit of sigma. Not the smallest enclosing sphere, at most sqrt(3) times its radius, but it needs no search.
    """
    centre = mesh.bounds.mean(axis=0)
    return float(np.linalg.norm(mesh.corners.reshape(-1, 3) - centre, axis=1).max())


def displace(mesh: TriangleMesh, *, sigma: float, radius: float, direction: Literal["isotropic", "normal"],
             rng: np.random.Generator) -> TriangleMesh:
    """Move every vertex by Gaussian noise of standard deviation `sigma * radius` metres.

    isotropic: independently along each axis. normal: along the area-weighted vertex normal. A vertex moves as one for
    all of its faces, so no crack opens at a crease or a seam. Equal `rng` states give displacements proportional to
    sigma; sigma 0 gives the same positions bit for bit. Raises UserError for a negative or non-finite sigma or radius.
    """
    for name, value in (("sigma", sigma), ("radius", radius)):
        if not 0 <= value < np.inf:
            raise UserError(f"noise: {name}: expected a finite number >= 0, got {value:g}")
    if sigma == 0:
        return mesh
    if direction == "isotropic":
        offsets = rng.standard_normal(mesh.positions.shape)
    else:
        offsets = rng.standard_normal((len(mesh.positions), 1)) * vertex_normals(mesh)
    return replace(mesh, positions=mesh.positions + sigma * radius * offsets)


def vertex_normals(mesh: TriangleMesh) -> np.ndarray:
    """(V, 3) unit vectors, the area-weighted mean of the normals of a vertex's faces; +Z where they cancel or lack."""
    weighted = np.repeat(mesh.area_normals, 3, axis=0)
    sums = np.stack([np.bincount(mesh.faces.ravel(), weights=weighted[:, axis], minlength=len(mesh.positions))
                     for axis in range(3)], axis=1)
    normals = unit(sums)
    normals[~normals.any(axis=1)] = (0, 0, 1)
    return normals


@dataclass(frozen=True, kw_only=True, eq=False)
class RoughBase:
    """An R3DM before its noise."""

    mesh: TriangleMesh
    creases: np.ndarray
    """(C, 2) vertex pairs that stay sharp, also in its shading normals."""


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
