"""Depth images from all around -> one surface: truncated signed distances, averaged in a grid.

B. Curless, M. Levoy, "A Volumetric Method for Building Complex Models from Range Images", SIGGRAPH 1996, by Open3D,
whose ScalableTSDFVolume of 0.20 integrates nothing, without an error; its UniformTSDFVolume works, and gives the same
mesh on any number of threads.
"""

import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import open3d
from dataset_builder.geometry.remeshing import decimated
from dataset_builder.geometry.subdivision import EQUILATERAL

TRUNCATION = 4.0
"""Distance from a surface up to which depths are averaged, cells."""
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
    faces = np.asarray(made.triangles).reshape(-1, 3)
    return TriangleMesh(positions=np.asarray(made.vertices).reshape(-1, 3), faces=faces,
                        uvs=np.zeros((len(faces), 3, 2)), material=np.zeros(len(faces)))


def lightened(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh, or one of `MOST_FACES` where it has more."""
    if len(mesh.faces) <= MOST_FACES:
        return mesh
    area = float(np.linalg.norm(mesh.area_normals, axis=1).sum()) / 2
    return decimated(mesh, (area / (EQUILATERAL * MOST_FACES))**0.5)
