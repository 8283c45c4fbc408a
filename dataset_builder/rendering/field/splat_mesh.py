"""The surface of splats: median depths from all around, fused; and the colours that they show there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.spatial import cKDTree

from dataset_builder.errors import UserError
from dataset_builder.geometry.depth_fusion import fused, main_parts, vertex_normals
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.pinhole import look_at
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.splat_look import Sight

VIEWS = 64
FOV = 40.0
"""Of the cameras, degrees."""
ROOM = 1.03
"""Share by which the ball fits their images."""
FREE = 0.1
"""Opacity up to which nothing is there; between this and a half, nothing is known."""
ABOVE = 4.0
"""Height over a vertex from which its colour is looked up, cells."""
SEEN = 0.5
"""Opacity that a colour needs to be taken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SplatMesh:
    """A mesh of splats, and how it was taken."""

    mesh: TriangleMesh
    """With colours, linear, radiance of the splats over `white`, in [0, 1]."""
    bodies: int
    dropped: int
    """Smaller parts that were taken away."""
    silhouette_iou: float
    """Of the mesh's silhouettes and the opacities of the images that it was taken from, sum of minima over sum of
    maxima."""


def splat_mesh(sight: Sight, *, centre: np.ndarray, radius: float, cells: int, white: float = 1.0) -> SplatMesh:
    """The mesh of what rays see in a ball, taken from images with `cells` pixels along a side.

    Raises UserError where nothing is opaque enough to have a surface.
    """
    poses, focal, ways = _cameras(centre, radius, cells)
    seen = [_image(sight, pose, ways) for pose in poses]
    along = ways[:, 2]
    depths = np.stack([np.where(opacity > FREE, np.where(depth > 0, depth * along, 0), np.inf)
                       for _, opacity, depth in seen]).reshape(-1, cells, cells)
    mesh = fused(depths, poses, focal, centre=centre, radius=radius, cells=cells)
    if not len(mesh.faces):
        raise UserError(f"splats: expected a surface that blocks half of the light from some side, got opacities of at "
                        f"most {max(float(opacity.max()) for _, opacity, _ in seen):.2f}")
    mesh, bodies, dropped = main_parts(mesh)
    scene = RayScene([(mesh.positions, mesh.faces, 1)])
    both = either = 0.0
    for pose, (_, opacity, _) in zip(poses, seen, strict=True):
        rays = ways @ pose[:3, :3].T
        hit = scene.first_hit(np.broadcast_to(pose[:3, 3], rays.shape), rays)[0] > 0
        both, either = both + float(opacity[hit].sum()), either + float(np.maximum(opacity, hit).sum())
    colours = _colours(sight, mesh, ABOVE * 2 * radius / cells) / white
    shown = np.concatenate([np.clip(colours, 0, 1), np.ones((len(colours), 1))], axis=1)
    return SplatMesh(mesh=replace(mesh, colors=shown[mesh.faces]), bodies=bodies, dropped=dropped,
                     silhouette_iou=both / either)


def _cameras(centre: np.ndarray, radius: float, size: int) -> tuple[np.ndarray, float, np.ndarray]:
    """(N, 4, 4) frame_from_camera on a Fibonacci sphere, their focal length, and (size^2, 3) unit ways through pixels
    in a camera's frame."""
    number = np.arange(VIEWS) + 0.5
    polar, azimuth = np.arccos(1 - 2 * number / VIEWS), np.pi * (1 + 5**0.5) * number
    out = np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)
    poses = np.tile(np.eye(4), (VIEWS, 1, 1))
    for pose, way in zip(poses, out, strict=True):
        right, up, forward = look_at(way, np.zeros(3))
        pose[:3, :3] = np.stack([right, -up, forward], axis=1)
        pose[:3, 3] = centre + way * (ROOM * radius / np.sin(np.radians(FOV / 2)))
    focal = size / (2 * np.tan(np.radians(FOV / 2)))
    at = (np.arange(size) + 0.5 - size / 2) / focal
    x, y = np.meshgrid(at, at)
    ways = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    return poses, focal, ways / np.linalg.norm(ways, axis=1, keepdims=True)


def _image(sight: Sight, pose: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return seen_along(sight, np.broadcast_to(pose[:3, 3], ways.shape), ways @ pose[:3, :3].T)


def seen_along(sight: Sight, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, 3) radiance times opacity, (N,) opacity and (N,) depth along rays, one sample each."""
    o = mi.Point3f(*(owned(mi.Float, part.astype(np.float32)) for part in origins.T))
    d = mi.Vector3f(*(owned(mi.Float, part.astype(np.float32)) for part in directions.T))
    colour, opacity, depth = sight(o, d, mi.Bool(True))
    dr.eval(colour, opacity, depth)
    return np.array(colour).T.astype(np.float64), np.array(opacity, np.float64), np.array(depth, np.float64)


def _colours(sight: Sight, mesh: TriangleMesh, above: float) -> np.ndarray:
    """(V, 3) linear radiance of vertices, seen from outside along their normals; where that misses, of the nearest
    that it does not."""
    normals = vertex_normals(mesh)
    light, opacity, _ = seen_along(sight, mesh.positions + above * normals, -normals)
    good = (opacity >= SEEN) & normals.any(axis=1)
    colours = light / np.maximum(opacity, 1e-6)[:, None]
    if good.any() and not good.all():
        colours[~good] = colours[good][cKDTree(mesh.positions[good]).query(mesh.positions[~good])[1]]
    return colours
