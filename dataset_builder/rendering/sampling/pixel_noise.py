"""How noisy pixels are, what those around a pixel say about it, and where further samples pay.

A few batches leave a pixel's own standard error vague, and where light comes rarely but strongly it is also too small:
a pixel that missed all of it knows nothing of what it missed, but some of its neighbours do. Outlines are no noise of
this kind: they are told by contrast (`outlines`).
"""

from dataclasses import replace

import numpy as np

from dataset_builder.rendering.sampling.moments import Estimate, relative
from dataset_builder.rendering.sampling.outlines import OutlineSides, outline_variance, sides

PRIOR = 12.0
"""Degrees of freedom that the neighbours' noise counts for at most. Intervals of real scenes cover best so,
`docs/accuracy.md`."""

EXPLAINED = 4.0
"""Variances up to this multiple of an outline's own are the outline's, and say nothing about the pixels around."""

SURE = 3.0
"""Squared contrast, in those that noise is expected to make, above which a pixel begins to count as crossed: normal
means have as much at one pixel in 300."""

TINY = 1e-9
"""Weight of a side, in shares of its brightness, that is rounding."""

MIN_DEVIATION = 0.15
"""Deviation at least, in root mean squares over the layer: few samples may have missed what makes a pixel noisy."""

SHARE = 0.95
"""Share of the pixels that a goal is to hold for."""


def around(values: np.ndarray, pixels: np.ndarray, width: int) -> np.ndarray:
    """(P, C) means of values >= 0 over the up to eight neighbours of each pixel that are listed, over all pixels where
    there are none."""
    row, column = np.divmod(pixels, width)
    row, column = row - row.min() + 1, column - column.min() + 1
    image = np.zeros((row.max() + 2, column.max() + 2, values.shape[1] + 1))
    image[row, column, :-1], image[row, column, -1] = values, 1
    rows = image[:-2] + image[1:-1] + image[2:]
    blocks = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]
    total = blocks[row - 1, column - 1] - image[row, column]
    count = np.rint(total[:, -1:])
    # What is left of a pixel's own value after adding and taking it away again is rounding, never below 0
    return np.where(count > 0, np.maximum(total[:, :-1], 0) / np.maximum(count, 1), values.mean(axis=0))


def _neighbours(pixels: np.ndarray, width: int) -> np.ndarray:
    """(P,) how many of the eight pixels next to each are listed."""
    row, column = np.divmod(pixels, width)
    listed = np.zeros((row.max() + 3, width + 2))
    listed[row + 1, column + 1] = 1
    rows = listed[:-2] + listed[1:-1] + listed[2:]
    return (rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:])[row, column] - 1


def _smoothed(values: np.ndarray, pixels: np.ndarray, width: int) -> np.ndarray:
    """(P, C) means over 5 x 5 pixels, the nearer the heavier."""
    for _ in range(2):
        values = (values + 8 * around(values, pixels, width)) / 9
    return values


def _of_sides(means: np.ndarray, own: np.ndarray, outline: np.ndarray, between: OutlineSides, pixels: np.ndarray,
              width: int) -> np.ndarray:
    """(P, C) variance of one sample that the two sides of an outline give each pixel, by its share of them.

    A lamp or a black wall has no noise of its own beside one that is lit: the mean of all around is that of neither. So
    each neighbour counts for a side by how near it is to it, unless its variance is an outline's. A pixel outside its
    neighbours has more in it than they can tell, such as a lamp smaller than a pixel: its own variance counts there,
    if it is more. own: (P, C) variance of one sample, by batches; outline: (P, C) `outline_variance`.
    """
    least, counted = means.min(axis=0), own >= EXPLAINED * outline
    level, low, high = means - least, between.low - least, between.high - least
    count, levels, noise, product = np.split(around(np.concatenate(
        [counted, counted * level, counted * own, counted * own * level], axis=1), pixels, width), 4, axis=1)
    of_each = []
    for weight, total in ((levels - low * count, product - low * noise),
                          (high * count - levels, high * noise - product)):
        of_each.append(np.divide(total, weight, out=np.zeros_like(total), where=weight > TINY * high))
    mixed = ((level - low) * of_each[0] + (high - level) * of_each[1]) / np.maximum(high - low, np.finfo(float).tiny)
    return np.maximum(mixed, between.outside * np.maximum(own - outline, 0))


def moderated(found: Estimate, pixels: np.ndarray, width: int) -> Estimate:
    """The estimate with each pixel's variance drawn towards what is to be expected there: what it is on 5 x 5 pixels
    about it, outlines left out, and what an outline across the pixel itself makes. Where there is one, the noise of its
    two sides, each by its share of the pixel, takes the place of that on 5 x 5 pixels.

    s^2 = (f s_own^2 + g (s_around^2 + s_outline^2)) / (f + g) with f + g degrees of freedom (Smyth, Statistical
    Applications in Genetics and Molecular Biology 3(1), 2004, section 3), s^2 being the variance of one sample and g
    PRIOR, or less where fewer pixels are next to it: a pixel alone keeps its own. pixels: (P,) indices row * width +
    column, none twice.
    """
    if not len(pixels) or not np.isfinite(found.error).all():
        return found
    spp = found.spp[:, None]
    own = found.error**2 * spp
    between = sides(found, _smoothed(own, pixels, width), pixels, width)
    outline = outline_variance(found, between)
    smooth = _smoothed(np.where(own <= EXPLAINED * outline, 0, own), pixels, width)
    crossed = np.where(outline > 0, np.maximum(1 - SURE * (1 - between.told), 0), 0)
    smooth = (1 - crossed) * smooth + crossed * _of_sides(found.mean, own, outline, between, pixels, width)
    prior = np.minimum(PRIOR, found.freedom * _neighbours(pixels, width)[:, None])
    freedom = found.freedom + prior
    variance = (found.freedom * own + prior * (smooth + outline)) / freedom
    return replace(found, error=np.sqrt(variance / spp), freedom=freedom)


def deviations(found: Estimate, channels: slice, inside: np.ndarray) -> np.ndarray:
    """(P,) deviation of one sample of each pixel, relative as `moments.relative` means it, root mean square over
    channels; 0 for pixels that are not `inside`."""
    result = np.zeros(len(inside))
    if inside.any():
        errors = relative(found.mean[inside, channels], found.error[inside, channels])
        own = np.sqrt(np.mean(errors**2, axis=1) * found.spp[inside])
        result[inside] = np.maximum(own, MIN_DEVIATION * np.sqrt(np.mean(own**2)))
    return result


def expected_error(deviation: np.ndarray, spp: np.ndarray) -> float:
    """What SHARE of the pixels with a deviation stay below, if each has `spp` (P,) samples; 0 for none."""
    inside = deviation > 0
    return float(np.quantile(deviation[inside] / np.sqrt(spp[inside]), SHARE)) if inside.any() else 0.0


def wanted(deviation: np.ndarray, error: float) -> np.ndarray:
    """(P,) samples that bring the error of SHARE of the pixels to `error`: n = (s / error)^2 sqrt(q / s), for a
    deviation s and its quantile q over the layer.

    Halfway, in the exponent of s, between the split with the smallest mean squared error, n ~ s (Neyman, Journal of the
    Royal Statistical Society 97, 1934), and the one with equal errors everywhere, n ~ s^2.
    """
    inside = deviation > 0
    if not inside.any():
        return np.zeros(len(deviation))
    q = float(np.quantile(deviation[inside], SHARE))
    return deviation**1.5 * np.sqrt(q) / error**2
