"""Vertex noise, the `rough` of a rough mesh."""

from dataclasses import replace
from typing import Literal

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import unit
from dataset_builder.geometry.mesh import TriangleMesh


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
