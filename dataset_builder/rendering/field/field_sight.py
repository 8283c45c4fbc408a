"""Which cells of a field some image sees: those behind what is opaque say nothing of themselves."""

import numpy as np

from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.rendering.field.field_pixels import chosen_images

COARSE = 64
"""Cells along a side, at most, that sight is worked out for."""
BLOCKED = 0.7
"""Transmittance below which a ray sees nothing more."""
STEP = 0.75
"""Of a ray, cells."""
RAYS = 64
"""Along the longer side of an image."""
FEW = 0.08
"""Share of the images that must see a cell: through a small hole in a surface, few see what is behind it."""
MOST = 60
"""Images that are looked through, evenly chosen of more."""


def seen_cells(optical: np.ndarray, images: PosedImages, chosen: np.ndarray, *, centre: np.ndarray,
               radius: float) -> np.ndarray:
    """(R, R, R) bool: cells that a share FEW or more of the `chosen` images see, and their neighbours. An image
    sees the cells that its rays pass before less than BLOCKED of the light is left.

    optical: (R, R, R) optical depth of a cell, by z, y, x. Blocks of cells are looked at where there are more than
    COARSE along a side.
    """
    block = -(-len(optical) // COARSE)
    coarse = _blocks(optical, block) * block
    side = len(coarse)
    found, looked = np.zeros(side**3, dtype=int), chosen[chosen_images(len(chosen), MOST)]
    cell, flat = 2 / side, coarse.ravel()
    for number in looked:
        passed = np.zeros(side**3, dtype=bool)
        origin, direction = _rays(images, number)
        origin = (origin - centre) / radius
        middle = -np.einsum("ij,ij->i", origin, direction)
        half = np.sqrt(np.maximum(3 - np.einsum("ij,ij->i", origin, origin) + middle**2, 0))
        t, end, depth = np.maximum(middle - half, 0), middle + half, np.zeros(len(origin))
        while len(t):
            at = ((origin + t[:, None] * direction) * 0.5 + 0.5) * side
            inside = ((at >= 0) & (at < side)).all(axis=1)
            x, y, z = np.clip(at, 0, side - 1).astype(int).T
            index = (z * side + y) * side + x
            passed[index[inside]] = True
            depth = depth + np.where(inside, flat[index] * STEP, 0)
            t = t + STEP * cell
            going = (t < end) & (depth < -np.log(BLOCKED))
            origin, direction, t, end, depth = (each[going] for each in (origin, direction, t, end, depth))
        found += passed
    seen = (found >= FEW * len(looked)).reshape(coarse.shape)
    for axis in range(3):
        seen = _widened(seen, axis)
    return seen.repeat(block, 0).repeat(block, 1).repeat(block, 2)[tuple(slice(n) for n in optical.shape)]


def _rays(images: PosedImages, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays through pixels of an image, evenly spread."""
    height, width = images.pixels.shape[1:3]
    stride = max(1, max(height, width) / RAYS)
    rows, columns = (np.arange(stride / 2, end, stride) for end in (height, width))
    row, column = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
    return images.rays(number, column, row)


def _blocks(values: np.ndarray, block: int) -> np.ndarray:
    """Means of cubes of `block` cells; what is beyond the grid is 0."""
    padded = np.pad(values, [(0, -len(values) % block)] * 3)
    n = len(padded) // block
    return padded.reshape(n, block, n, block, n, block).mean(axis=(1, 3, 5))


def _widened(seen: np.ndarray, axis: int) -> np.ndarray:
    """With neighbours along an axis."""
    padded = np.pad(seen, [(1, 1) if k == axis else (0, 0) for k in range(3)])
    parts = [np.take(padded, np.arange(k, k + seen.shape[axis]), axis) for k in range(3)]
    return parts[0] | parts[1] | parts[2]
