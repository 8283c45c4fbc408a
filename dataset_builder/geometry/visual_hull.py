"""What the masks of posed images leave of space."""

import numpy as np
from scipy import ndimage

from dataset_builder.geometry.posed_images import PosedImages

SEEN = 0.02
"""Opacity from which a pixel counts as covered."""
WIDEST = 256
"""Pixels along the longer side that masks are reduced to: a block counts as covered where any pixel of it does."""


def cell_middles(cells: int) -> np.ndarray:
    """(cells^3, 3) middles x, y, z of the cells of [-1, 1]^3, in the order of a flattened (z, y, x) array."""
    axis = (np.arange(cells) + 0.5) * (2 / cells) - 1
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def visual_hull(images: PosedImages, chosen: np.ndarray, cells: int, *, centre: np.ndarray, radius: float,
                slack: float = 1.0, whole: float = 1.0) -> np.ndarray:
    """(cells, cells, cells) bool by z, y, x: cells of the box about a ball that lie in the ball, and whose middle every
    one of the `chosen` images sees within `slack` pixels and `whole` times half a cell's diagonal of its mask.

    What is outside of an image's frame, or behind its camera, the image says nothing about. One image is read at a
    time.
    """
    middles = cell_middles(cells)
    cell = 2 / cells
    alive = np.flatnonzero(np.linalg.norm(middles, axis=1) <= 1 + 0.5 * np.sqrt(3) * cell)
    for number in chosen:
        far, factor = _distance(np.asarray(images.pixels[number, ..., 3]) > SEEN)
        pose = images.poses[number]
        # camera_from_frame of a rigid pose
        points = (middles[alive] * radius + centre - pose[:3, 3]) @ pose[:3, :3]
        depth = np.maximum(points[:, 2], 1e-9)
        column, row = np.floor((points[:, :2] / depth[:, None] * images.focal[number] + images.centre[number]).T
                               / factor)
        height, width = far.shape
        silent = (column < 0) | (row < 0) | (column >= width) | (row >= height) | (points[:, 2] <= 0)
        found = far[np.clip(row, 0, height - 1).astype(int), np.clip(column, 0, width - 1).astype(int)] * factor
        reach = slack + whole * 0.5 * np.sqrt(3) * cell * radius * images.focal[number].max() / depth
        alive = alive[silent | (found <= reach)]
    inside = np.zeros(cells**3, dtype=bool)
    inside[alive] = True
    return inside.reshape(cells, cells, cells)


def _distance(mask: np.ndarray) -> tuple[np.ndarray, int]:
    """Distance of each block of pixels from the nearest covered one, in blocks; pixels along a block's side."""
    factor = -(-max(mask.shape) // WIDEST)
    rows, columns = (-(-side // factor) for side in mask.shape)
    padded = np.zeros((rows * factor, columns * factor), dtype=bool)
    padded[:mask.shape[0], :mask.shape[1]] = mask
    blocks = padded.reshape(rows, factor, columns, factor).any(axis=(1, 3))
    if not blocks.any():
        return np.full(blocks.shape, np.inf), factor
    return ndimage.distance_transform_edt(~blocks), factor
