"""A coloured mesh as Gaussian splats, so that viewers of splats show it."""

import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.rough_base import vertex_normals
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_harmonics import Y0
from dataset_builder.tonemap import srgb

SPREAD = 0.7
"""Standard deviation along the surface, in roots of the area that belongs to a vertex."""
LEAST = 0.5
"""Least of these, as a share of the median: vertices crowd where a grid cuts a surface."""
FLAT = 0.1
"""Standard deviation across the surface, as a share of that along it."""
OPACITY = 0.99


def splats_of_mesh(mesh: TriangleMesh) -> SplatCloud:
    """One flat splat at each vertex, of the mesh's colour there, sRGB-encoded, the same from all sides."""
    used, corner = np.unique(mesh.faces, return_inverse=True)
    corner = corner.reshape(mesh.faces.shape)
    normals = vertex_normals(mesh)[used]
    thirds = np.repeat(np.linalg.norm(mesh.area_normals, axis=1) / 6, 3)
    spread = SPREAD * np.sqrt(np.bincount(corner.ravel(), weights=thirds, minlength=len(used)))
    spread = np.maximum(spread, max(LEAST * float(np.median(spread)), 1e-9))
    shown = np.ones((*corner.shape, 3)) if mesh.colors is None else mesh.colors[..., :3].astype(np.float64)
    times = np.bincount(corner.ravel(), minlength=len(used))
    colour = np.stack([np.bincount(corner.ravel(), weights=shown[..., k].ravel(), minlength=len(used)) / times
                       for k in range(3)], axis=1)
    turns = np.concatenate([1 + normals[:, 2:], np.cross([0, 0, 1.0], normals)], axis=1)
    turns[normals[:, 2] < -1 + 1e-9] = (0, 1, 0, 0)
    single = {"centres": mesh.positions[used], "scales": spread[:, None] * (1, 1, FLAT),
              "turns": turns / np.linalg.norm(turns, axis=1, keepdims=True), "opacities": np.full(len(used), OPACITY),
              "harmonics": ((srgb(np.clip(colour, 0, 1)) - 0.5) / Y0)[:, None]}
    return SplatCloud(srgb=True, **{name: np.ascontiguousarray(value, np.float32) for name, value in single.items()})
