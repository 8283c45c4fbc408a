"""How rough a rough mesh is: measured against the clean one."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.geometry.rough_base import bounding_radius


@dataclass(frozen=True, kw_only=True)
class Roughness:
    """Distance of points on a rough mesh from the clean surface."""

    rms: float
    """In bounding-sphere radii of the clean mesh."""
    maximum: float
    """In bounding-sphere radii of the clean mesh."""
    points: int
    """How many were measured."""
    radius: float
    """Metres."""


def measure_roughness(rough: TriangleMesh, clean: TriangleMesh, *,
                      at: Literal["vertices", "centroids", "both"] = "both") -> Roughness:
    """Unsigned distance from the vertices and/or the face centroids of `rough` to the surface of `clean`.

    Good to about 1e-7 radii: Open3D measures in float32, so both meshes are moved to the origin and scaled to radius 1.
    """
    radius, centre = bounding_radius(clean), clean.bounds.mean(axis=0)
    used = rough.positions[np.unique(rough.faces)]
    centroids = rough.corners.mean(axis=1)
    points = {"vertices": used, "centroids": centroids, "both": np.concatenate([used, centroids])}[at]
    scene = RayScene([((clean.positions - centre) / radius, clean.faces, 1)])
    distance = scene.distance((points - centre) / radius)
    return Roughness(rms=float(np.sqrt(np.mean(distance**2))), maximum=float(distance.max()), points=len(points),
                     radius=radius)
