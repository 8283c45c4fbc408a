"""Filling the rim of an object, where a picture of it ends a little before its mask does.

Each pixel outside takes the value of the nearest pixel that is known. So nothing of the background, or of the black
around the object, gets in from the far side. Then the pixels that were asked for are smoothed in between: the
biharmonic surface through their surroundings (scikit-image; Damelin and Hoang 2018). A constant rim stays constant.

The cost is bounded: the equations are solved for pixels within `REACH` of a known one, and for no more than
`MAX_PIXELS` of them. What lies farther off keeps the nearest value. A rim at 800x800 has a few thousand.
"""

import numpy as np
from scipy.ndimage import distance_transform_edt
from skimage.restoration import inpaint_biharmonic

from dataset_builder.errors import UserError

REACH = 16.0
"""Pixels."""
MAX_PIXELS = 60_000
"""Pixels solved for at once: about a second, and 400 MB."""
MARGIN = 3
"""Pixels about those asked for that the equations see; the biharmonic stencil reaches two."""


def fill(picture: np.ndarray, known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(H, W, C) picture with the `asked` pixels (H, W) filled from the `known` ones; all others are as they were.

    Values stay within the range of the known ones. Best given display values, whose range is small: in linear light a
    highlight at the rim would outweigh all else. Raises UserError where nothing is known.
    """
    asked = asked & ~known
    if not asked.any():
        return picture.copy()
    if not known.any():
        raise UserError("expected at least one known pixel to fill from, got none")
    filled = picture.copy()
    box = _box(asked)
    distance, nearest = distance_transform_edt(~known, return_indices=True)
    around = picture[tuple(index[box] for index in nearest)]
    smooth = _smooth(around, _near(distance, asked)[box])
    filled[asked] = smooth[asked[box]].astype(picture.dtype)
    return filled


def _near(distance: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """The asked pixels that are solved for: those close to what is known, and not too many."""
    near = asked & (distance <= REACH)
    if np.count_nonzero(near) <= MAX_PIXELS:
        return near
    limit = np.partition(distance[near], MAX_PIXELS)[MAX_PIXELS]
    return near & (distance < limit)


def _smooth(around: np.ndarray, solved: np.ndarray) -> np.ndarray:
    """`around` with the pixels to be solved replaced. Always in double precision: the equations are ill-conditioned."""
    if not solved.any():
        return around
    smooth: np.ndarray = inpaint_biharmonic(around.astype(np.float64), solved, channel_axis=-1)
    return smooth


def _box(asked: np.ndarray) -> tuple[slice, slice]:
    """Rows and columns that hold all asked pixels and a margin."""
    rows, columns = np.flatnonzero(asked.any(axis=1)), np.flatnonzero(asked.any(axis=0))
    return (slice(max(rows[0] - MARGIN, 0), rows[-1] + MARGIN + 1),
            slice(max(columns[0] - MARGIN, 0), columns[-1] + MARGIN + 1))
