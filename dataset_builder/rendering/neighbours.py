"""What the pixels around a pixel say about its noise.

A few batches leave a pixel's own standard error vague, and where light comes rarely but strongly it is also too small:
a pixel that missed all of it knows nothing of what it missed, but some of its neighbours do.
"""

from dataclasses import replace

import numpy as np

from dataset_builder.rendering.moments import Estimate

PRIOR = 12.0
"""Degrees of freedom that the neighbours' noise counts for. Intervals of real scenes cover best so, `docs/accuracy.md`.
"""


def around(values: np.ndarray, pixels: np.ndarray, width: int) -> np.ndarray:
    """(P, C) means over the up to eight neighbours of each pixel that are listed, over all where there are none."""
    row, column = np.divmod(pixels, width)
    row, column = row - row.min() + 1, column - column.min() + 1
    image = np.zeros((row.max() + 2, column.max() + 2, values.shape[1] + 1))
    image[row, column, :-1], image[row, column, -1] = values, 1
    steps = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    total = sum(image[row + i, column + j] for i, j in steps)
    count = total[:, -1:]
    return np.where(count > 0, total[:, :-1] / np.maximum(count, 1), values.mean(axis=0))


def moderated(found: Estimate, pixels: np.ndarray, width: int) -> Estimate:
    """The estimate with each pixel's variance drawn towards what it is on 5 x 5 pixels about it.

    s^2 = (f s_own^2 + PRIOR s_around^2) / (f + PRIOR) with f + PRIOR degrees of freedom (Smyth, Statistical
    Applications in Genetics and Molecular Biology 3(1), 2004, section 3), s^2 being the variance of one sample. pixels:
    (P,) indices row * width + column, none twice.
    """
    if not len(pixels) or not np.isfinite(found.error).all():
        return found
    spp = found.spp[:, None]
    own = found.error**2 * spp
    smooth = own
    for _ in range(2):
        smooth = (smooth + 8 * around(smooth, pixels, width)) / 9
    freedom = found.freedom + PRIOR
    variance = (found.freedom * own + PRIOR * smooth) / freedom
    return replace(found, error=np.sqrt(variance / spp), freedom=freedom)
