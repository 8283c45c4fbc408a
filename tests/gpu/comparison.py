"""Replicas of two renderings of the same plans: how far apart their means are, in standard errors.

The error is that of replicas, not of pixels: these err together where they share light paths.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

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


def deviations(first: np.ndarray, second: np.ndarray) -> Iterator[Deviation]:
    """Of the means of (R, H, W, C) replicas, by part and channel: Student's t of as many replicas on both sides, as the
    normal deviate of the same probability."""
    replicas = len(first)
    for name, rows, columns in parts(first.shape[1], first.shape[2]):
        for channel in range(first.shape[3]):
            a, b = (side[:, rows, columns, channel].mean(axis=(1, 2), dtype=np.float64) for side in (first, second))
            error = float(np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / replicas))
            off, scale = float(b.mean() - a.mean()), max(abs(float(a.mean())), abs(float(b.mean())))
            z = 0.0 if abs(off) <= ROUNDING * scale else np.inf
            if z and error:
                z = float(np.sign(off) * norm.isf(t.sf(abs(off) / error, 2 * (replicas - 1))))
            yield Deviation(where=f"{name}, channel {channel}", z=z, ratio=float(b.mean()) / (float(a.mean()) or 1e-30))


def parts(height: int, width: int) -> Iterator[tuple[str, slice, slice]]:
    """The whole picture, then its parts."""
    yield "all", slice(None), slice(None)
    for row in range(PARTS):
        for column in range(PARTS):
            yield (f"part {row + 1}, {column + 1}", slice(height * row // PARTS, height * (row + 1) // PARTS),
                   slice(width * column // PARTS, width * (column + 1) // PARTS))
