"""The plane that most of many points lie on, such as the ground of a reconstructed scene."""

import numpy as np

from dataset_builder.geometry.raycast import open3d

DRAWS, ROUGH = 2000, 0.01
"""Planes that are tried, and how far from one a point may be, in median distances from the points' middle."""


def largest_plane(points: np.ndarray) -> tuple[np.ndarray, float]:
    """(3,) unit normal of the plane that most of (N >= 3, 3) points lie on, its sign arbitrary, and their share.

    RANSAC (Fischler and Bolles 1981) with Open3D's `segment_plane`, its seed fixed.
    """
    library = open3d()
    middle = np.median(points, axis=0)
    reach = float(np.median(np.linalg.norm(points - middle, axis=1))) or 1.0
    cloud = library.geometry.PointCloud(library.utility.Vector3dVector((points - middle) / reach))
    library.utility.random.seed(0)
    plane, inliers = cloud.segment_plane(distance_threshold=ROUGH, ransac_n=3, num_iterations=DRAWS)
    normal = np.array(plane[:3], dtype=np.float64)
    return normal / np.linalg.norm(normal), len(inliers) / len(points)
