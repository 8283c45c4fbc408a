"""One example rendered two ways, several times each: is the difference noise, or more, and could more have been seen?

Of a layer with light, the standard error of every pixel is known. It comes from the spread of B batches, so that the
difference of two pixels over its standard error follows Student's t rather than a normal distribution. The error of a
mean follows from those of its pixels where these are independent; where they share light paths (joined paths), it comes
from the spread of the means of the R repeats, with Student's t of 2 (R - 1) degrees of freedom. The noise of layers
without light, on outlines and textures, comes from the spread of the repeats of each pixel.

A layer differs where one of these does not hold:
- bias: |mean of the difference| <= allowed * mean + SIGMAS * its standard error, over the pixels that count;
- pixels: the share of pixels that differ by more than allowed * mean + SIGMAS of their own standard errors is at most
  FACTOR times what t says, plus SIGMAS standard deviations of such a share.
It is the same where both hold, and a mean that differs by SEEN times what is allowed would have been seen with a
probability of 95%. Otherwise it is not resolved. Means are those of absolute values with everything on, for layers may
be negative; allowed is `render.bias`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import Literal

import numpy as np
from scipy.stats import norm, t

from dataset_builder.rendering.sampling.pixel_noise import PRIOR

SIGMAS = 3.3
"""Standard errors that noise exceeds once in a thousand times, where they are known exactly."""

SEEN = 3.0
"""Times what is allowed that a mean would have to differ by to be seen."""
POWER = 1.645
"""Standard errors that noise stays below with a probability of 95%."""
Verdict = Literal["same", "differs", "not resolved"]

FACTOR = 2.0
"""Times the share that t gives: noise of light paths has longer tails than normal noise."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One layer, planned against everything on."""

    example: str
    layer: str
    pixels: int
    bias: float
    """Mean of the difference, relative to the mean."""
    bias_se: float
    """Its standard error, relative to the mean."""
    sigmas: float
    """Of these that noise exceeds once in a thousand times: more where they are known from few repeats."""
    worst_z: float
    """Largest |difference| of a pixel in its standard errors."""
    share: float
    """Of pixels beyond `SIGMAS` standard errors and what is allowed."""
    expected: float
    """What noise alone would give of `share`."""
    allowed: float
    """Relative bias that the spec allows."""

    @property
    def bias_holds(self) -> bool:
        """Whether the mean differs by no more than allowed and noise."""
        return abs(self.bias) <= self.allowed + self.sigmas * self.bias_se

    @property
    def pixels_hold(self) -> bool:
        """Whether no more pixels differ than noise explains."""
        slack = SIGMAS * sqrt(self.expected * (1 - self.expected) / max(self.pixels, 1))
        return self.share <= FACTOR * self.expected + slack

    @property
    def smallest(self) -> float:
        """Smallest difference of the mean, relative to it, that would have been seen with a probability of 95%."""
        return self.allowed + (self.sigmas + POWER) * self.bias_se

    @property
    def verdict(self) -> Verdict:
        """What may be said."""
        if not (self.bias_holds and self.pixels_hold):
            return "differs"
        return "same" if self.smallest <= SEEN * self.allowed else "not resolved"

    @property
    def samples(self) -> float:
        """Times the samples that it takes to resolve it, about."""
        return ((self.smallest - self.allowed) / ((SEEN - 1) * self.allowed)) ** 2


def noisy_difference(example: str, layer: str, planned: Sequence[np.ndarray], everything: Sequence[np.ndarray],
                     variance: np.ndarray, *, allowed: float, batches: int, together: bool = False) -> Difference:
    """Of (P, C) pixels of a layer with light, each side several times; variance: (P, C) of the difference of their
    means, from all standard errors. together: whether pixels of one of them share light paths.

    Channels of a pixel are noisy together, so that a pixel counts once: by the sum of its channels.
    """
    ours, theirs = (np.asarray(np.mean(side, axis=0, dtype=np.float64)) for side in (planned, everything))
    mean = _mean(theirs)
    difference = (ours - theirs).sum(axis=1)
    # Deviations of channels that vary together add up; where they do not, this is on the safe side
    deviation = np.sqrt(variance.astype(np.float64)).sum(axis=1)
    scale = mean * ours.shape[1]
    error, spread = sqrt(float(np.sum(deviation**2))) / max(len(difference), 1), inf
    if together:
        spread = sum(len(side) - 1 for side in (planned, everything))
        error = max(error, spread_of(planned, everything))
    beyond = np.abs(difference) > SIGMAS * deviation + allowed * scale
    z = np.abs(difference) / np.where(deviation > 0, deviation, np.inf)
    return Difference(example=example, layer=layer, pixels=len(difference), allowed=allowed,
                      bias=_over(float(difference.mean()), scale) if len(difference) else 0.0,
                      bias_se=_over(error, scale), sigmas=sigmas_of(spread), worst_z=float(z.max(initial=0.0)),
                      share=float(beyond.mean()) if len(beyond) else 0.0,
                      expected=float(2 * t.sf(SIGMAS, freedom(batches, min(len(planned), len(everything))))))


def clear_difference(example: str, layer: str, planned: Sequence[np.ndarray], everything: Sequence[np.ndarray], *,
                     allowed: float) -> Difference:
    """Of (P, C) pixels of a layer without light, each side several times.

    Noise sits on outlines and in textures, unlike from pixel to pixel, so that only the mean is judged.
    """
    ours, theirs = (np.asarray(np.mean(side, axis=0, dtype=np.float64)) for side in (planned, everything))
    mean, difference = _mean(theirs), ours - theirs
    noise = sum(float(np.var([one.sum(axis=1) for one in side], axis=0, ddof=1, dtype=np.float64).sum()) / len(side)
                for side in (planned, everything))
    return Difference(example=example, layer=layer, pixels=len(difference), allowed=allowed,
                      bias=_over(float(difference.mean()), mean) if difference.size else 0.0,
                      bias_se=_over(sqrt(noise) / max(difference.size, 1), mean), sigmas=SIGMAS, worst_z=0.0,
                      share=0.0, expected=0.0)


def spread_of(*sides: Sequence[np.ndarray]) -> float:
    """Standard error of the difference of means of both sides, summed over channels, from the spread of repeats."""
    means = [[float(one.sum(axis=1, dtype=np.float64).mean()) if len(one) else 0.0 for one in side] for side in sides]
    return sqrt(sum(float(np.var(side, ddof=1)) / len(side) for side in means))


def sigmas_of(degrees: float) -> float:
    """Standard errors that noise exceeds as rarely as `SIGMAS`, where they have so many degrees of freedom."""
    return SIGMAS if degrees == inf else float(t.isf(norm.sf(SIGMAS), degrees))


def freedom(batches: int, repeats: int = 1) -> float:
    """Degrees of freedom of a pixel's difference over its moderated standard error."""
    return 2 * (repeats * (batches - 1) + PRIOR)


def _mean(values: np.ndarray) -> float:
    return float(np.abs(values).mean(dtype=np.float64)) if values.size else 0.0


def _over(value: float, mean: float) -> float:
    """value / mean; infinite where there is a difference from nothing."""
    return value / mean if mean else (float("inf") if value else 0.0)
