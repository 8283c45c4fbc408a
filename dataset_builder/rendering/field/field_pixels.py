"""The pixels that a field is fitted to, drawn on the device."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import ndimage

from dataset_builder.errors import UserError
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.geometry.visual_hull import SEEN
from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.field.field_rays import FieldCameras, ball_span
from dataset_builder.seeding import rng

MOST_IMAGES = 300
"""Images that are fitted to, evenly chosen of more."""
MOST_PIXELS = 1 << 22
"""Pixels that are fitted to, drawn of more."""
NEAR = 2
"""Pixels about a mask that are fitted to as well."""
LEFT = 1e-3
"""Transmittance below which what is behind does not matter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FitPixels:
    """P pixels on and next to masks, of which rays meet what may hold something."""

    cameras: FieldCameras
    image: mi.UInt32
    """(P,) place among the cameras."""
    corner: mi.UInt32
    """(P,) column + row << 16."""
    colour: mi.Float
    """(P * 4) radiance times opacity, in units of white, and opacity."""
    near: mi.Float
    """(P,) radii from the camera to where something may be."""
    far: mi.Float
    """(P,) radii from the camera to where nothing more can be seen."""

    @property
    def count(self) -> int:
        """P."""
        return dr.width(self.image)

    def spanned(self, occupied: np.ndarray, optical: np.ndarray) -> FitPixels:
        """The same pixels with the spans that rays have through cells (S, S, S) that may hold something; those that
        have none are left out. optical: (S, S, S) optical depth of a cell, of what is known to be there."""
        x, y = pixel_middle(self.corner)
        near, far = spans(*self.cameras.rays(self.image, x, y), occupied, optical)
        keep = dr.compress(far > near)
        return FitPixels(cameras=self.cameras, image=dr.gather(mi.UInt32, self.image, keep),
                         corner=dr.gather(mi.UInt32, self.corner, keep), near=dr.gather(mi.Float, near, keep),
                         far=dr.gather(mi.Float, far, keep),
                         colour=dr.ravel(dr.gather(mi.Vector4f, self.colour, keep)))


def pixel_middle(corner: mi.UInt32) -> tuple[mi.Float, mi.Float]:
    """Film position of the middle of a pixel, in pixels."""
    return mi.Float(corner & 0xFFFF) + 0.5, mi.Float(corner >> 16) + 0.5


def chosen_images(count: int, most: int = MOST_IMAGES) -> np.ndarray:
    """Indices of at most `most` of `count` images, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))


def fit_pixels(images: PosedImages, chosen: np.ndarray, *, centre: np.ndarray, radius: float, white: float, seed: int,
               where: str) -> FitPixels:
    """Pixels of the `chosen` images on and next to masks, without spans; one image is read at a time.

    Raises UserError where no image has a mask, and where pixels are not finite.
    """
    share = -(-MOST_PIXELS // len(chosen))
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for place, number in enumerate(chosen):
        pixels = np.asarray(images.pixels[number], dtype=np.float32)
        if not np.isfinite(pixels).all():
            name = images.names[number] if images.names else f"image {number}"
            raise UserError(f"{where}: {name}: expected finite pixels, got NaN or infinity")
        mask = ndimage.maximum_filter(pixels[..., 3] > SEEN, size=2 * NEAR + 1)
        at = np.flatnonzero(mask)
        if len(at) > share:
            at = np.sort(rng(seed, "pixels", place).choice(at, share, replace=False))
        row, column = np.divmod(at, pixels.shape[1])
        colour = pixels.reshape(-1, 4)[at] / np.array([white, white, white, 1], np.float32)
        found.append((np.full(len(at), place, np.uint32), (column + (row << 16)).astype(np.uint32), colour))
    image, corner, colour = (np.concatenate([each[k] for each in found]) for k in range(3))
    if not len(image):
        raise UserError(f"{where}: expected images that show the object, got {len(chosen)} whose opacity is 0 all over "
                        "(check masks and cameras)")
    nothing = dr.zeros(mi.Float, len(image))
    return FitPixels(cameras=FieldCameras.of(images, chosen, centre, radius), image=owned(mi.UInt32, image),
                     corner=owned(mi.UInt32, corner), colour=owned(mi.Float, colour), near=nothing, far=nothing)


@dr.syntax
def spans(origin: mi.Point3f, direction: mi.Vector3f, occupied: np.ndarray,
          optical: np.ndarray) -> tuple[mi.Float, mi.Float]:
    """Where rays meet the first occupied cell and leave the last that can be seen, radii, a cell more at both ends;
    the same twice where there is none. Cells are taken whole: a step is half of one."""
    side = dr.opaque(mi.UInt32, len(occupied))
    may = owned(mi.Float, np.where(occupied, optical, -1).astype(np.float32))
    cell = 2 / mi.Float(side)
    step, limit = 0.5 * cell, dr.opaque(mi.Float, -np.log(LEFT))
    t, end = ball_span(origin, direction)
    near, far, depth, margin = mi.Float(dr.inf), mi.Float(0), mi.Float(0), 4 * cell
    while (t < end) & (depth < limit):
        at = mi.Vector3u(dr.clip((origin + t * direction) * 0.5 + 0.5, 0, 1 - 1e-6) * mi.Float(side))
        here = dr.gather(mi.Float, may, (at.z * side + at.y) * side + at.x)
        if here >= 0:
            near = dr.minimum(near, t)
            far = t
            depth += 0.5 * here
        t += step
    # Behind what is opaque now, a fit may still find that something lies deeper
    far = dr.select(depth < limit, far + cell, dr.minimum(far + margin, end))
    met = far > near
    return dr.select(met, dr.maximum(near - cell, 0), 0), dr.select(met, far, 0)
