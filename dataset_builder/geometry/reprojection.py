"""A picture seen from another camera: pixels with depth carried over, where the other camera sees the same surface."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.geometry.pinhole import Pinhole

TOLERANCE = 0.02
"""Of the depth: surfaces that are further apart are two, of which one hides the other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What one camera has for a warp."""

    camera: Pinhole
    depth: np.ndarray
    """(H, W) metres along the view axis, as the layer `depth` has it."""
    inside: np.ndarray
    """(H, W) bool: pixels that count."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Correspondence:
    """Which pixels of one view have their like in another, and where it lies."""

    pixels: np.ndarray
    """(H, W) bool: those that have."""
    corners: np.ndarray
    """(4, N) positions in the other picture, counted by rows, that each of these N pixels lies between."""
    weights: np.ndarray
    """(4, N) bilinear weights of them; their sum is 1."""

    def here(self, picture: np.ndarray) -> np.ndarray:
        """(N, C) values of an own picture (H, W, C)."""
        return picture[self.pixels]

    def there(self, picture: np.ndarray) -> np.ndarray:
        """(N, C) values of the other view's picture (H, W, C) at the same places of the surface, bilinear."""
        flat = picture.reshape(-1, picture.shape[-1])
        return np.einsum("kn,knc->nc", self.weights, flat[self.corners])


def correspond(here: View, there: View, tolerance: float = TOLERANCE) -> Correspondence:
    """Where the surface that `here` sees lies in the picture of `there`.

    Each pixel centre goes out to its depth and into the other camera. It has its like where all four pixels about that
    place are inside, and their depths within `tolerance` of the distance found: not where the other camera sees
    something in front, and not at silhouettes.
    """
    points = here.camera.unproject(here.depth)[here.inside]
    columns, rows, distance = _placed(there.camera, points)
    left, top = np.floor(columns).astype(np.int64), np.floor(rows).astype(np.int64)
    height, width = there.depth.shape
    found = (distance > 0) & (left >= 0) & (top >= 0) & (left < width - 1) & (top < height - 1)
    left, top, columns, rows, distance = (value[found] for value in (left, top, columns, rows, distance))
    corners = np.stack([top * width + left, top * width + left + 1, (top + 1) * width + left,
                        (top + 1) * width + left + 1])
    same = np.abs(there.depth.ravel()[corners] - distance) <= tolerance * distance
    alike = (same & there.inside.ravel()[corners]).all(axis=0)
    pixels = here.inside.copy()
    pixels[here.inside] = _within(found, alike)
    x, y = (columns - left)[alike], (rows - top)[alike]
    return Correspondence(pixels=pixels, corners=corners[:, alike],
                          weights=np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y]))


def _placed(camera: Pinhole, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N,) column and row, counted from the middle of the first pixel, and distance along the view axis of points
    (N, 3)."""
    columns, rows, distance = camera.project(points).T
    ahead = distance > 0
    # Behind the camera they mean nothing, and may be beyond all whole numbers
    return np.where(ahead, columns - 0.5, -1.0), np.where(ahead, rows - 0.5, -1.0), distance


def _within(mask: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """(N,) bool: a mask (N,) of which only the `chosen` of those that it holds stay."""
    found = mask.copy()
    found[mask] = chosen
    return found
