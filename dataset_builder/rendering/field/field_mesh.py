"""The mesh of a field: what it is solid at, without what floats about, in the colours that the field shows there."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.marching import largest_parts, level_mesh, solid
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_look import Look
from dataset_builder.rendering.field.field_model import GAIN, OUTSIDE, SHIFT, Kind
from dataset_builder.rendering.field.field_pixels import chosen_images
from dataset_builder.rendering.field.field_sight import seen_cells

LEVELS = (0.05, 0.1, 0.2, 0.3, 0.5)
"""Opacities of a cell of density that are tried."""
COMPARED = 24
"""Images whose masks decide."""
FINEST = 128
"""Pixels along the longer side of an image that are compared."""
AHEAD = 3.0
"""Cells before the surface from which its colour is looked at."""
INSIDE = 5.0
"""Optical depth of a cell inside of a surface."""
FAINT = 0.25
"""Opacity below which a colour is not divided by it any further."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldSurface:
    """A mesh and where it came from."""

    mesh: TriangleMesh
    """In the field's frame, metres, without colours."""
    level: float
    """See FieldRecord."""
    silhouette_iou: float
    bodies: int
    dropped: int


def surface_of(values: np.ndarray, kind: Kind, images: PosedImages, chosen: np.ndarray, *, centre: np.ndarray,
               radius: float, where: str) -> FieldSurface:
    """The surface of a grid (R, R, R) of first values at the level whose silhouette the masks of images agree with
    best. Raises UserError where there is none at any level."""
    compared = chosen[chosen_images(len(chosen), COMPARED)]
    seen = seen_cells(optical_of(values, kind), images, chosen, centre=centre, radius=radius)
    best: FieldSurface | None = None
    for level in LEVELS if kind == "density" else (0.0,):
        raw = density_of(level) if kind == "density" else OUTSIDE
        whole = level_mesh(solid(values, raw, seen), raw, 2 / len(values))
        if whole is None:
            continue
        bare, bodies, dropped = largest_parts(whole)
        mesh = TriangleMesh(positions=(bare.positions - 1) * radius + centre, faces=bare.faces, uvs=bare.uvs,
                            material=bare.material)
        share = silhouette_iou(mesh, images, compared)
        if best is None or share > best.silhouette_iou:
            best = FieldSurface(mesh=mesh, level=level, silhouette_iou=share, bodies=bodies, dropped=dropped)
    if best is None:
        raise UserError(f"{where}: expected a field with a surface, got none at opacities of {LEVELS[0]} to "
                        f"{LEVELS[-1]} per cell (check masks and cameras, or take more steps)")
    return best


def optical_of(values: np.ndarray, kind: Kind) -> np.ndarray:
    """Optical depth of cells of first values, a cell long; inside of a distance field all of it."""
    if kind == "sdf":
        return np.where(values >= OUTSIDE, INSIDE, 0.0)
    return np.where(values > 0, np.logaddexp(0, GAIN * values + SHIFT), 0.0)


def density_of(opacity: float) -> float:
    """Value of a cell of that opacity; see `FieldModel.optical`."""
    return float((np.log(np.expm1(-np.log1p(-opacity))) - SHIFT) / GAIN)


def silhouette_iou(mesh: TriangleMesh, images: PosedImages, compared: np.ndarray) -> float:
    """Intersection over union of a mesh's silhouette and the masks of some images: the sum of minima of the two over
    the sum of maxima, over middles of pixels, of which large images have only every so many looked at."""
    scene = RayScene([(mesh.positions, mesh.faces, 1)])
    both = either = 0.0
    for number in compared:
        row, column = pixel_grid(images)
        mask = np.asarray(images.pixels[number, row, column, 3], dtype=np.float64)
        hit = scene.first_hit(*images.rays(number, column + 0.5, row + 0.5))[0]
        both, either = both + np.minimum(mask, hit).sum(), either + np.maximum(mask, hit).sum()
    return float(both / either) if either else 0.0


def pixel_grid(images: PosedImages) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns (P,) of pixels evenly spread over an image, at most FINEST along its longer side."""
    height, width = images.pixels.shape[1:3]
    stride = -(-max(height, width) // FINEST)
    row, column = np.meshgrid(np.arange(stride // 2, height, stride), np.arange(stride // 2, width, stride),
                              indexing="ij")
    return row.ravel(), column.ravel()


def coloured(mesh: TriangleMesh, look: Look, *, cell: float, white: float) -> TriangleMesh:
    """The mesh with the colours that a field shows at its vertices, seen from outside along the normal; cell: of the
    field, metres."""
    normals = np.zeros_like(mesh.positions)
    for corner in range(3):
        np.add.at(normals, mesh.faces[:, corner], mesh.area_normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    origins = mesh.positions + AHEAD * cell * normals
    from_outside, inwards = ([owned(mi.Float, values) for values in array.T.astype(np.float32)]
                             for array in (origins, -normals))
    found, opacity = look(mi.Point3f(*from_outside), mi.Vector3f(*inwards), mi.Bool(True))
    shown = np.stack([np.array(channel) for channel in found / (dr.maximum(opacity, FAINT) * white)], axis=1)
    colours = np.concatenate([np.clip(shown, 0, 1), np.ones((len(shown), 1))], axis=1)
    return TriangleMesh(positions=mesh.positions, faces=mesh.faces, uvs=mesh.uvs, material=mesh.material,
                        colors=colours[mesh.faces].astype(np.float32))
