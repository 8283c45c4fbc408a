"""What strata hide: batches agree about a pixel that an outline crosses, and all of them may be off.

Stratified samples know the share of a pixel on either side of an edge so well that every batch often counts the same
number, though the truth lies between two of them. Their spread then says nothing, and neither do pixels off the
outline. What the spread should be follows from the contrast between a pixel's neighbours.
"""

import numpy as np

from dataset_builder.rendering.sampling.moments import Estimate

STRATA = 0.2
"""Variance of the share of a pixel that a straight edge cuts off, in n stratified samples, times n^1.5. On average over
edges at all angles it is 0.13, and 0.07 to 0.18 for 4 to 1024 points of both kinds and shares of 1/8 to 7/8. This is
that of nine in ten angles: the angle is unknown, and with 0.13 the intervals at round lamps held 1 to 3% less."""

UNSEEN = 0.25
"""Samples added on either side: one sample's width is two standard errors, so that the interval of a pixel beside an
outline holds a share that no sample may have met."""

CHANCE = 10.0
"""Squared range of nine independent means over their variance, about as expected of normal ones (9.5): contrast that
noise makes by itself."""


def share_variance(share: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Variance, times `samples`, of the `share` of a pixel that as many stratified samples find on one side of an edge:
    never more than that of independent ones, for which it is p (1 - p)."""
    return np.minimum(share * (1 - share), STRATA / np.sqrt(samples))


def outline_variance(found: Estimate, noise: np.ndarray, pixels: np.ndarray, width: int) -> np.ndarray:
    """(P, C) variance of one sample of each pixel that an outline across it would make, 0 where there is no contrast.

    The lowest and the highest mean among a pixel and its up to eight neighbours are taken for the two sides, and its
    own mean between them for the share; a mean that lies outside its neighbours' may have any. noise: (P, C) variance
    of one sample about each pixel, which makes contrast too. pixels: (P,) indices row * width + column.
    """
    low, high = _extremes(found.mean, pixels, width)
    outside = (found.mean < low) | (found.mean > high)
    low, high = np.minimum(low, found.mean), np.maximum(high, found.mean)
    contrast, spp = high - low, found.spp[:, None]
    share = np.divide(found.mean - low, contrast, out=np.zeros_like(contrast), where=contrast > 0)
    share = (np.where(outside, 0.5, share) * spp + UNSEEN) / (spp + 2 * UNSEEN)
    squared = np.maximum(contrast**2 - CHANCE * noise / spp, 0)
    return squared * share_variance(share, spp / (found.freedom + 1))


def _extremes(values: np.ndarray, pixels: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """(P, C) lowest and highest of the listed neighbours of each pixel; infinite where there are none."""
    row, column = np.divmod(pixels, width)
    row, column = row - row.min() + 1, column - column.min() + 1
    shape = (row.max() + 2, column.max() + 2, values.shape[1])
    found = []
    for extreme, nothing in ((np.minimum, np.inf), (np.maximum, -np.inf)):
        image = np.full(shape, nothing)
        image[row, column] = values
        ends = extreme(image[:, :-2], image[:, 2:])
        rows = extreme(ends, image[:, 1:-1])
        ring = extreme(extreme(rows[:-2], rows[2:]), ends[1:-1])
        found.append(ring[row - 1, column - 1])
    return found[0], found[1]
