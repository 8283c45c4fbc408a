"""The surface of splats: median depths from all around, fused; and the colours that they show there."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.depth_fusion import fused, lightened
from dataset_builder.geometry.marching import largest_parts
from dataset_builder.geometry.pinhole import Pinhole, sphere_lattice
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_mesh import FieldSurface, silhouette_iou
from dataset_builder.rendering.field.splat_look import Sight

FOV = 40.0
"""Of the cameras, degrees."""
ROOM = 1.03
"""Share by which the ball fits their images."""
FREE = 0.1
"""Opacity up to which nothing is there; between this and a half, nothing is known."""


def splat_surface(sight: Sight, *, centre: np.ndarray, radius: float, cells: int,
                  views: int) -> FieldSurface:
    """The mesh of what rays see in a ball, from images all around with `cells` pixels along a side, of a grid with as
    many cells. Open where no camera sees it. Raises UserError where nothing is opaque enough to have a surface."""
    images = _cameras(centre, radius, cells, views)
    depths = np.empty((views, cells, cells))
    for number in range(views):
        row, column = np.divmod(np.arange(cells * cells), cells)
        origins, ways = images.rays(number, column + 0.5, row + 0.5)
        colour, opacity, depth = seen_along(sight, origins, ways)
        images.pixels[number] = np.concatenate([colour, opacity[:, None]], axis=1).reshape(cells, cells, 4)
        along = ways @ images.poses[number, :3, 2]
        depths[number] = np.where(opacity > FREE, depth * along, np.inf).reshape(cells, cells)
    whole = fused(depths, images.poses, float(images.focal[0, 0]), centre=centre, radius=radius, cells=cells)
    if not len(whole.faces):
        raise UserError("splats: expected a surface that blocks half of the light from some side, got opacities of at "
                        f"most {images.pixels[..., 3].max():.2f}")
    mesh, bodies, dropped = largest_parts(whole)
    mesh = lightened(mesh)
    return FieldSurface(mesh=mesh, level=0.0, silhouette_iou=silhouette_iou(mesh, images, np.arange(views)),
                        bodies=bodies, dropped=dropped)


def _cameras(centre: np.ndarray, radius: float, size: int, views: int) -> PosedImages:
    """Black images of cameras all around that see the ball."""
    distance = ROOM * radius / np.sin(np.radians(FOV / 2))
    cameras = [Pinhole(position=centre + distance * way, target=centre, fov=FOV, width=size, height=size)
               for way in sphere_lattice(views)]
    return PosedImages(pixels=np.zeros((views, size, size, 4), np.float32),
                       poses=np.array([each.opencv_pose for each in cameras]),
                       focal=np.full((views, 2), cameras[0].focal), centre=np.full((views, 2), size / 2))


def seen_along(sight: Sight, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, 3) radiance times opacity, (N,) opacity and (N,) depth along rays, one sample each."""
    o = mi.Point3f(*(owned(mi.Float, part.astype(np.float32)) for part in origins.T))
    d = mi.Vector3f(*(owned(mi.Float, part.astype(np.float32)) for part in directions.T))
    colour, opacity, depth = sight(o, d, mi.Bool(True))
    dr.eval(colour, opacity, depth)
    return np.array(colour).T.astype(np.float64), np.array(opacity, np.float64), np.array(depth, np.float64)
