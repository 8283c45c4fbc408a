"""How well a field shows images that it was not fitted to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.rendering.field.field_look import Look
from dataset_builder.rendering.field.field_mesh import pixel_grid
from dataset_builder.rendering.field.field_pixels import chosen_images
from dataset_builder.rendering.field.field_rays import FieldCameras
from dataset_builder.tonemap import srgb

MOST_HELD_OUT = 64
"""Images that are looked at, evenly chosen of more."""
ACROSS = 2
"""Rays along a side of a pixel."""
COVERED = 0.5
"""Opacity from which a pixel belongs to a mask."""


@dataclass(frozen=True, kw_only=True)
class HeldOutFigures:
    """See FieldRecord."""

    held_out: int = 0
    psnr: float = 0.0
    psnr_worst: float = 0.0
    ssim: float = 0.0
    opacity_iou: float = 0.0
    depth_95: float = 0.0


def held_out_figures(look: Look, mesh: TriangleMesh, images: PosedImages, *, white: float, radius: float,
                     clean: TriangleMesh | None) -> HeldOutFigures:
    """Figures over images; all are 0 where no image shows the object. Colours are divided by `white` and sRGB-encoded,
    outside of masks they are those on black."""
    from skimage.metrics import structural_similarity

    chosen = chosen_images(len(images.pixels), MOST_HELD_OUT) if len(images.pixels) else np.zeros(0, int)
    psnr, ssim, both, either = [], [], 0.0, 0.0
    for number, found in zip(chosen, looked_at(look, images, chosen), strict=True):
        truth = np.asarray(images.pixels[number], dtype=np.float64)
        shown, wanted = srgb(found[..., :3] / white), srgb(truth[..., :3] / white)
        inside = truth[..., 3] > COVERED
        if not inside.any():
            continue
        psnr.append(-10 * np.log10(max(float(np.mean((shown - wanted)[inside] ** 2)), 1e-10)))
        ssim.append(structural_similarity(shown, wanted, channel_axis=2, data_range=1.0, gaussian_weights=True,
                                          sigma=1.5, use_sample_covariance=False))
        both += float(np.minimum(found[..., 3], truth[..., 3]).sum())
        either += float(np.maximum(found[..., 3], truth[..., 3]).sum())
    if not psnr:
        return HeldOutFigures()
    return HeldOutFigures(held_out=len(psnr), psnr=float(np.mean(psnr)), psnr_worst=float(min(psnr)),
                          ssim=float(np.mean(ssim)), opacity_iou=both / either,
                          depth_95=0.0 if clean is None else depth_95(mesh, clean, images, chosen, radius))


def looked_at(look: Look, images: PosedImages, chosen: np.ndarray) -> Iterator[np.ndarray]:
    """(H, W, 4) images that a field shows where others were taken, means over the areas of pixels."""
    height, width = images.pixels.shape[1:3]
    cameras = FieldCameras.of(images, chosen, np.zeros(3), 1.0)
    lane = dr.arange(mi.UInt32, height * width * ACROSS**2)
    columns = dr.opaque(mi.UInt32, width * ACROSS)
    row = lane // columns
    x, y = (mi.Float(place) * (1 / ACROSS) + 0.5 / ACROSS for place in (lane - row * columns, row))
    for place in range(len(chosen)):
        image = dr.opaque(mi.UInt32, place, dr.width(lane))
        colour, opacity = look(*cameras.rays(image, x, y), mi.Bool(True))
        dr.eval(colour, opacity)
        fine = np.stack([*(np.array(channel) for channel in colour), np.array(opacity)], axis=1)
        yield fine.reshape(height, ACROSS, width, ACROSS, 4).mean(axis=(1, 3), dtype=np.float64)


def depth_95(mesh: TriangleMesh, clean: TriangleMesh, images: PosedImages, chosen: np.ndarray, radius: float) -> float:
    """95th percentile of |distance of the mesh - distance of the clean mesh| along rays that meet both, in radii; 0
    where none does."""
    scenes = [RayScene([(each.positions, each.faces, 1)]) for each in (mesh, clean)]
    row, column = pixel_grid(images)
    found = []
    for number in chosen:
        one, other = (scene.first_hit(*images.rays(number, column + 0.5, row + 0.5))[1] for scene in scenes)
        seen = np.isfinite(one) & np.isfinite(other)
        found.append(np.abs(one[seen] - other[seen]))
    apart = np.concatenate(found)
    return float(np.quantile(apart, 0.95)) / radius if len(apart) else 0.0
