"""An object out of a scene of splats."""

import numpy as np
from scipy import ndimage

from dataset_builder.errors import UserError
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_moves import chosen

CELLS = 64
"""Along the longest side of what is looked at for parts."""
OUTLIERS = 0.01
"""Share of splats at either end of an axis that the cells' size does not depend on."""


def cropped(cloud: SplatCloud, *, box: np.ndarray | None = None, ball: np.ndarray | None = None) -> SplatCloud:
    """The splats whose middles lie in a (2, 3) box, lowest corner first, and in a (4,) ball, middle and radius, in the
    cloud's units and axes. Raises UserError where none does."""
    keep = np.ones(len(cloud), bool)
    if box is not None:
        keep &= ((cloud.centres >= box[0]) & (cloud.centres <= box[1])).all(axis=1)
    if ball is not None:
        keep &= np.linalg.norm(cloud.centres - ball[:3], axis=1) <= ball[3]
    if not keep.any():
        low, high = cloud.centres.min(axis=0), cloud.centres.max(axis=0)
        raise UserError(f"crop: expected it to hold splats, got none of {len(cloud):,}, whose middles lie between "
                        f"{np.round(low, 3).tolist()} and {np.round(high, 3).tolist()}")
    return chosen(cloud, keep) if not keep.all() else cloud


def main_body(cloud: SplatCloud) -> SplatCloud:
    """The splats of the part that covers most: cells with splats in them that touch, corners included, are one part.

    Cells are 1/64 of the extent, or as wide as twice the median splat where that is more.
    """
    low, high = np.quantile(cloud.centres, (OUTLIERS, 1 - OUTLIERS), axis=0)
    widest = cloud.scales.max(axis=1)
    size = max(float((high - low).max()) / CELLS, 2 * float(np.median(widest)), 1e-12)
    margin = CELLS // 4
    count = np.minimum(np.ceil((high - low) / size).astype(int) + 1, CELLS + 1) + 2 * margin
    cell = np.floor((cloud.centres - low) / size).astype(int) + margin
    inside = ((cell >= 0) & (cell < count)).all(axis=1)
    flat = np.ravel_multi_index(tuple(np.where(inside[:, None], cell, 0).T), tuple(count))
    # What a splat covers, seen from its widest side
    ordered = np.sort(cloud.scales, axis=1)
    cover = np.where(inside, cloud.opacities * ordered[:, 1] * ordered[:, 2], 0).astype(np.float64)
    weight = np.bincount(flat, weights=cover, minlength=int(np.prod(count))).reshape(count)
    label, number = ndimage.label(weight > 0, structure=np.ones((3, 3, 3)))
    shares = np.bincount(label.ravel(), weights=weight.ravel(), minlength=number + 1)
    keep = inside & (label.ravel()[flat] == shares.argmax())
    return chosen(cloud, keep) if not keep.all() else cloud


def ball_about(cloud: SplatCloud, middle: np.ndarray) -> float:
    """Radius of the ball about a point that holds all splats out to three standard deviations."""
    reach = np.linalg.norm(cloud.centres - middle, axis=1) + 3 * cloud.scales.max(axis=1)
    return float(reach.max())
