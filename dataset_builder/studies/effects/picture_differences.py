"""Two renderings of one example with independent samples: is the difference noise, or more than that?

Of a layer with light, the standard error of every pixel is known. It comes from the spread of B batches, so that the
difference of two pixels over its standard error follows Student's t rather than a normal distribution. Either side has
B - 1 degrees of freedom of its own and those that the pixels around it count for, `neighbours.PRIOR`. Of a layer
without light, the noise on outlines and textures comes from a third rendering.

A layer passes where both rules hold:
- bias: |mean of the difference| <= allowed * mean + SIGMAS * its standard error, over the pixels that count;
- pixels: the share of pixels that differ by more than allowed * mean + SIGMAS of their own standard errors is at most
  FACTOR times what t says, plus SIGMAS standard deviations of such a share.
Means are those of absolute values with everything on, for layers may be negative; allowed is `render.bias`.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.stats import t

from dataset_builder.rendering.sampling.pixel_noise import PRIOR

SIGMAS = 3.3
"""Standard errors that noise exceeds once in a thousand times, where they are known exactly."""

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
        return abs(self.bias) <= self.allowed + SIGMAS * self.bias_se

    @property
    def pixels_hold(self) -> bool:
        """Whether no more pixels differ than noise explains."""
        slack = SIGMAS * sqrt(self.expected * (1 - self.expected) / max(self.pixels, 1))
        return self.share <= FACTOR * self.expected + slack

    @property
    def holds(self) -> bool:
        """The verdict."""
        return self.bias_holds and self.pixels_hold


def noisy_difference(example: str, layer: str, planned: np.ndarray, everything: np.ndarray, variance: np.ndarray, *,
                     allowed: float, batches: int) -> Difference:
    """Of (P, C) pixels of a layer with light; variance: (P, C) of the difference, from both standard errors.

    Channels of a pixel are noisy together, so that a pixel counts once: by the sum of its channels.
    """
    mean = _mean(everything)
    difference = (planned.astype(np.float64) - everything).sum(axis=1)
    # Deviations of channels that vary together add up; where they do not, this is on the safe side
    deviation = np.sqrt(variance.astype(np.float64)).sum(axis=1)
    scale = mean * planned.shape[1]
    beyond = np.abs(difference) > SIGMAS * deviation + allowed * scale
    z = np.abs(difference) / np.where(deviation > 0, deviation, np.inf)
    return Difference(example=example, layer=layer, pixels=len(difference), allowed=allowed,
                      bias=_over(float(difference.mean()), scale) if len(difference) else 0.0,
                      bias_se=_over(sqrt(float(np.sum(deviation**2))) / max(len(difference), 1), scale),
                      worst_z=float(z.max(initial=0.0)), share=float(beyond.mean()) if len(beyond) else 0.0,
                      expected=float(2 * t.sf(SIGMAS, freedom(batches))))


def clear_difference(example: str, layer: str, planned: np.ndarray, everything: np.ndarray, again: np.ndarray, *,
                     allowed: float) -> Difference:
    """Of (P, C) pixels of a layer without light; again: the planned one with other samples.

    Noise sits on outlines and in textures, unlike from pixel to pixel, so that only the mean is judged.
    """
    mean = _mean(everything)
    difference = planned.astype(np.float64) - everything
    noise = planned.astype(np.float64) - again
    error = sqrt(float(np.sum(noise.sum(axis=1) ** 2))) / max(noise.size, 1)
    return Difference(example=example, layer=layer, pixels=len(difference), allowed=allowed,
                      bias=_over(float(difference.mean()), mean) if difference.size else 0.0,
                      bias_se=_over(error, mean), worst_z=0.0, share=0.0, expected=0.0)


def freedom(batches: int) -> float:
    """Degrees of freedom of a pixel's difference over its moderated standard error."""
    return 2 * (batches - 1 + PRIOR)


def _mean(values: np.ndarray) -> float:
    return float(np.abs(values).mean(dtype=np.float64)) if values.size else 0.0


def _over(value: float, mean: float) -> float:
    """value / mean; infinite where there is a difference from nothing."""
    return value / mean if mean else (float("inf") if value else 0.0)
