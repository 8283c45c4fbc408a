"""What an object stands on: noise must not push flat things, such as rugs, through it."""

from dataclasses import replace

import numpy as np

from dataset_builder.geometry.edges import edges_of
from dataset_builder.geometry.mesh import TriangleMesh

REACH = 3.0
"""Standard deviations of noise that may sink."""
NEAR = 0.02
"""Share of the upper side within reach of the support above which noise is kept above it."""


def near_support(mesh: TriangleMesh, height: float) -> float:
    """Share of a mesh's upper side, by area seen from above, that lies less than `height` metres above its lowest
    point.

    The upper side is what faces up; sheets are seen from both sides, so all of a mesh with a boundary counts. 0 for a
    height of 0, and for a mesh without an upper side.
    """
    if height <= 0:
        return 0.0
    up = mesh.area_normals[:, 2] / 2
    up = np.abs(up) if (edges_of(mesh.faces).face_count == 1).any() else np.maximum(up, 0)
    low = mesh.corners[..., 2].mean(axis=1) < mesh.bounds[0, 2] + height
    return float(up[low].sum() / up.sum()) if up.sum() > 0 else 0.0


def mirrored_up(mesh: TriangleMesh, support: float) -> TriangleMesh:
    """The mesh with vertices below z = `support` metres mirrored to above it.

    A lift of the whole object would move its outline, and clamping would lay vertices into the floor, where nothing
    says which is seen. Vertices move as one for all of their faces, so that no crack opens.
    """
    positions = mesh.positions.copy()
    sunk = positions[:, 2] < support
    positions[sunk, 2] = 2 * support - positions[sunk, 2]
    return replace(mesh, positions=positions) if sunk.any() else mesh
