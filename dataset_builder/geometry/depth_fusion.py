"""Depth images from all around -> one surface: truncated signed distances, averaged in a grid.

B. Curless, M. Levoy, "A Volumetric Method for Building Complex Models from Range Images", SIGGRAPH 1996, by Open3D,
whose ScalableTSDFVolume of 0.20 integrates nothing, without an error; its UniformTSDFVolume works, and gives the same
mesh on any number of threads.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import open3d
from dataset_builder.geometry.remeshing import decimated
from dataset_builder.geometry.subdivision import EQUILATERAL

TRUNCATION = 4.0
"""Distance from a surface up to which depths are averaged, cells."""
LEAST = 0.01
"""Share of the largest part's area below which a part is dropped."""
MOST_FACES = 300_000


def fused(depths: np.ndarray, poses: np.ndarray, focal: float, *, centre: np.ndarray, radius: float,
          cells: int) -> TriangleMesh:
    """The surface that (N, H, W) depths along the axes of cameras show, metres: 0 where nothing is known, inf where
    nothing is. Open where no camera sees.

    poses: (N, 4, 4) frame_from_camera as in `PosedImages`; focal: pixels, of all, the middle of the image being the
    principal point. centre, radius: the ball that it lies in, whose cube has `cells` along a side. No faces where
    nothing is seen.
    """
    o3d = open3d()
    _, height, width = depths.shape
    camera = o3d.camera.PinholeCameraIntrinsic(width, height, focal, focal, width / 2 - 0.5, height / 2 - 0.5)
    side = 2 * radius
    volume = o3d.pipelines.integration.UniformTSDFVolume(
        length=side, resolution=cells, sdf_trunc=TRUNCATION * side / cells,
        color_type=o3d.pipelines.integration.TSDFVolumeColorType.NoColor, origin=np.asarray(centre, float) - radius)
    blank = o3d.geometry.Image(np.zeros((height, width, 3), np.uint8))
    for depth, pose in zip(depths, poses, strict=True):
        # A finite distance behind everything clears the space before it
        far = float(np.linalg.norm(pose[:3, 3] - centre)) + 4 * radius
        image = np.ascontiguousarray(np.minimum(depth, far), dtype=np.float32)
        images = o3d.geometry.RGBDImage()
        images.color, images.depth = blank, o3d.geometry.Image(image)
        volume.integrate(images, camera, np.linalg.inv(pose))
    made = volume.extract_triangle_mesh()
    return bare_mesh(np.asarray(made.vertices), np.asarray(made.triangles))


def bare_mesh(positions: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """A mesh of one material, without colours."""
    count = len(faces)
    return TriangleMesh(positions=positions, faces=faces.reshape(-1, 3), uvs=np.zeros((count, 3, 2)),
                        material=np.zeros(count))


def main_parts(mesh: TriangleMesh) -> tuple[TriangleMesh, int, int]:
    """A mesh without parts below `LEAST` and with at most `MOST_FACES` faces, how many parts it has, and how many were
    dropped."""
    a, b, c = mesh.faces.T
    ones = np.ones(2 * len(mesh.faces), bool)
    graph = coo_array((ones, (np.concatenate([a, b]), np.concatenate([b, c]))), shape=(len(mesh.positions),) * 2)
    part = connected_components(graph, directed=False)[1][a]
    areas = np.bincount(part, weights=np.linalg.norm(mesh.area_normals, axis=1))
    large = areas >= LEAST * areas.max()
    faces = mesh.faces[large[part]]
    used, compact = np.unique(faces, return_inverse=True)
    kept = bare_mesh(mesh.positions[used], compact.reshape(-1, 3))
    if len(faces) > MOST_FACES:
        area = float(np.linalg.norm(kept.area_normals, axis=1).sum()) / 2
        kept = decimated(kept, (area / (EQUILATERAL * MOST_FACES))**0.5)
    return kept, int(large.sum()), int((areas > 0).sum() - large.sum())


def vertex_normals(mesh: TriangleMesh) -> np.ndarray:
    """(V, 3) unit normals, those of faces weighted by area; 0 for a vertex without."""
    total = np.zeros_like(mesh.positions)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(mesh.faces[:, corner], weights=mesh.area_normals[:, axis],
                                          minlength=len(total))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1)
