"""What strata hide: batches agree about a pixel that an outline crosses, and all of them may be off.

Stratified samples know the share of a pixel on either side of an edge so well that every batch often counts the same
number, though the truth lies between two of them. Their spread then says nothing, and neither do pixels off the
outline. What the spread should be follows from the contrast between a pixel's neighbours.
"""

from dataclasses import dataclass

import numpy as np

from dataset_builder.rendering.sampling.moments import Estimate

STRATA = 0.2
"""Variance of the share of a pixel that a straight edge cuts off, in n stratified samples, times n^1.5. On average over
edges at all angles it is 0.13, and 0.07 to 0.18 for 4 to 1024 points of both kinds and shares of 1/8 to 7/8. This is
that of nine in ten angles: the angle is unknown, and with 0.13 the intervals at round lamps held 1 to 3% less."""

UNSEEN = 0.25
"""Samples added on either side: one sample's width is two standard errors, so that the interval of a pixel beside an
outline holds a share that no sample may have met."""

ALONE = 2.0
"""The same where a batch is one sample, and nothing is stratified (Agresti and Coull, The American Statistician 52,
1998). In batches of n it is this times n^-1.5, as the variance of shares is, and never less than UNSEEN."""

CHANCE = 10.0
"""Squared range of nine independent means over their variance, about as expected of normal ones (9.5): contrast that
noise makes by itself."""


def share_variance(share: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Variance, times `samples`, of the `share` of a pixel that as many stratified samples find on one side of an edge:
    never more than that of independent ones, for which it is p (1 - p)."""
    return np.minimum(share * (1 - share), STRATA / np.sqrt(samples))


@dataclass(frozen=True, kw_only=True, eq=False)
class OutlineSides:
    """(P, C) each: what lies on either side of an outline that may cross a pixel."""

    low: np.ndarray
    """The lowest mean among the pixel and its up to eight neighbours."""
    high: np.ndarray
    """The highest."""
    outside: np.ndarray
    """Of truth: whether either is the pixel's own alone."""
    told: np.ndarray
    """Share of (high - low)^2 that noise does not make by itself, 0 to 1."""

    @property
    def contrast(self) -> np.ndarray:
        """(P, C) difference of the two."""
        return self.high - self.low


def sides(found: Estimate, noise: np.ndarray, pixels: np.ndarray, width: int) -> OutlineSides:
    """Sides by the means of pixels and their neighbours. noise: (P, C) variance of one sample about each pixel. pixels:
    (P,) indices row * width + column."""
    low, high = _extremes(found.mean, pixels, width)
    outside = (found.mean < low) | (found.mean > high)
    low, high = np.minimum(low, found.mean), np.maximum(high, found.mean)
    squared = (high - low) ** 2
    told = np.maximum(squared - CHANCE * noise / found.spp[:, None], 0)
    return OutlineSides(low=low, high=high, outside=outside,
                        told=np.divide(told, squared, out=np.zeros_like(told), where=squared > 0))


def outline_variance(found: Estimate, between: OutlineSides) -> np.ndarray:
    """(P, C) variance of one sample of each pixel that an outline across it would make, 0 where there is no contrast.

    A pixel's mean between its two sides is taken for its share of them; one that lies outside its neighbours' may have
    any.
    """
    contrast, spp = between.contrast, found.spp[:, None]
    samples = spp / (found.freedom + 1)
    share = np.divide(found.mean - between.low, contrast, out=np.zeros_like(contrast), where=contrast > 0)
    unseen = np.maximum(UNSEEN, ALONE * samples**-1.5)
    share = (np.where(between.outside, 0.5, share) * spp + unseen) / (spp + 2 * unseen)
    return between.told * contrast**2 * share_variance(share, samples)


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
