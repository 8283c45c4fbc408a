"""Two renderings of the same plans with other random numbers: how far apart they are, in standard errors."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

ERROR_RATE = 1e-3
"""Chance that a correct renderer fails a whole run, shared among all of its Z-tests (Bonferroni)."""
PARTS = 2
"""A picture is compared as a whole and in this many parts along each side: an error in one corner is not lost in the
mean, and each part has pixels enough for its mean to be normal."""
ROUNDING = 1e-5
"""Relative difference of means that is no difference: sums of single precision in another order."""


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """Of the means of one part of a picture."""

    where: str
    z: float
    ratio: float
    """Of the second mean to the first."""


def limit(tests: int) -> float:
    """|z| that one of so many tests exceeds by chance in ERROR_RATE of all runs."""
    return float(norm.isf(ERROR_RATE / 2 / max(tests, 1)))


def deviations(pairs: tuple[np.ndarray, np.ndarray], errors: tuple[np.ndarray, np.ndarray], *,
               together: bool = False) -> Iterator[Deviation]:
    """Of the means of (H, W, C) images with standard errors of each pixel, by part and channel.

    Pixels are independent, or may err `together`, where they share light paths: then the error of a mean is at most the
    mean of errors.
    """
    first, second = (image.astype(np.float64) for image in pairs)
    variance = sum(error.astype(np.float64) ** 2 for error in errors)
    for name, rows, columns in parts(first.shape[0], first.shape[1]):
        for channel in range(first.shape[2]):
            a, b, spread = (image[rows, columns, channel] for image in (first, second, variance))
            error = float(np.sqrt(spread).mean()) if together else float(np.sqrt(spread.sum()) / spread.size)
            off, scale = float(b.mean() - a.mean()), max(abs(float(a.mean())), abs(float(b.mean())))
            z = 0.0 if abs(off) <= ROUNDING * scale else off / error if error else np.inf
            yield Deviation(where=f"{name}, channel {channel}", z=z, ratio=float(b.mean()) / (float(a.mean()) or 1e-30))


def parts(height: int, width: int) -> Iterator[tuple[str, slice, slice]]:
    """The whole picture, then its parts."""
    yield "all", slice(None), slice(None)
    for row in range(PARTS):
        for column in range(PARTS):
            yield (f"part {row + 1}, {column + 1}", slice(height * row // PARTS, height * (row + 1) // PARTS),
                   slice(width * column // PARTS, width * (column + 1) // PARTS))
