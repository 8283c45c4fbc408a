"""Whether the mean of a layer is known: what its largest contributions say of those that have not come yet.

Where light arrives through rare bright paths, most pictures have met too few of them: their means are low, and the
spread of what was met does not show it. The largest contributions do: they follow a generalised Pareto distribution,
whose shape k tells how the ones beyond them go on (Vehtari, Simpson, Gelman, Yao and Gabry, "Pareto smoothed importance
sampling", JMLR 25, 2024). From k = 1/2 there is no variance that an error could come from, from k = 1 no mean.
"""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Literal, get_args

import numpy as np

from dataset_builder.rendering.sampling.moments import Estimate

Known = Literal["known", "widened", "unknown"]
"""Whether the error of a mean may be relied on: as it is, after it was widened by what the tail lets expect, or not."""

HEAVY, MOST = 0.5, 0.1
"""A mean is unknown from this shape, where there is no variance, or where the top holds this share of it."""
MATTERS = 0.01
"""Least light beyond what was met, over the mean, that makes it unknown: the outlines of an even picture have a heavy
tail, too, but hold next to nothing."""
TOP_PART = 0.001
"""Part of the contributions that is the top, at least one of them."""
ROUNDING = 1e-6
"""Share of the largest contribution, and of the mean of the image that a layer is a part of, that is rounding."""
FEWEST = 25
"""Contributions above 0 that a tail takes."""
CLOSEST = 0.9
"""Shape beyond which the mean of what has not come is no longer worked out: it has none from 1."""
TOGETHER, PRIOR = 1.4, 1.0
"""Where pixels share light paths: the standard error of their mean over what they would give if they were independent,
to begin with; and the degrees of freedom that this counts for beside the two of what halves of the batches differ by.
It depends on the scene and grows with the number of pixels: in the mini dataset 0.8 to 3.3 at 32x32, and up to 4.4 at
96x96."""


@dataclass(frozen=True, kw_only=True)
class LayerMean:
    """The mean of a layer over its pixels and channels, and what may be said of its error."""

    error: float
    """Relative standard error, widened by `expected`."""
    expected: float
    """Light beyond what was met that the tail lets expect, over the mean."""
    tail: float
    """Pareto shape k of the largest contributions; 0 where there are too few."""
    top_share: float
    """Share of the mean that the top 0.1% of the contributions hold."""

    @property
    def known(self) -> Known:
        """What the tail says of the error: it is widened where most of it is what was not met."""
        heavy = self.tail >= HEAVY or self.top_share >= MOST
        if (heavy and self.expected >= MATTERS) or not np.isfinite(self.error):
            return "unknown"
        return "widened" if self.error**2 < 2 * self.expected**2 else "known"


def least_known(*means: LayerMean) -> Known:
    """The worst that several say."""
    return max((mean.known for mean in means), key=get_args(Known).index)


def layer_mean(found: Estimate, channels: slice, inside: np.ndarray, *, together: bool = False,
               image: slice | None = None) -> LayerMean:
    """Of the pixels `inside` (P,) of an estimate whose errors are those of each pixel alone.

    A pixel's contribution is its largest batch, but no more than its standard error: so what is bright and even, a lamp
    in the picture, is none. together: whether pixels share light paths, so that their errors do not cancel out; image:
    channels of the image that the layer is a part of, which says what is rounding.
    """
    mean, error, peak = (getattr(found, name)[inside, channels] for name in ("mean", "error", "peak"))
    total = float(abs(mean.sum())) / max(mean.shape[1], 1)
    whole = float(abs(found.mean[inside, image].sum())) / max(mean.shape[1], 1) if image else 0.0
    if total <= ROUNDING * whole:
        return LayerMean(error=0.0, expected=0.0, tail=0.0, top_share=0.0)
    # Channels of a pixel are noisy together
    spread = sqrt(float(np.sum(error.mean(axis=1) ** 2))) / total
    if together:
        # All light paths of a batch are others than those of the rest
        halves = [float((half[inside, channels] - mean).sum()) / mean.shape[1] / total
                  for half in (found.half, found.odd)]
        spread = sqrt((PRIOR * (TOGETHER * spread) ** 2 + sum(off**2 for off in halves)) / (PRIOR + len(halves)))
    contributions = np.sort(np.minimum(peak / np.maximum(found.spp[inside], 1)[:, None], error).mean(axis=1)) / total
    shape = pareto_tail(contributions)
    # Mean of what is beyond the largest, which one of as many is
    expected = float(contributions[-1]) / (1 - float(np.clip(shape, 0, CLOSEST)))
    top = max(1, round(TOP_PART * len(contributions)))
    return LayerMean(error=hypot(spread, expected), expected=expected, tail=shape,
                     top_share=float(contributions[-top:].sum()))


def pareto_tail(values: np.ndarray) -> float:
    """Shape k of the tail of (N,) rising values >= 0; 0 where there are too few.

    The generalised Pareto distribution is fitted to the min(N / 5, 3 sqrt(N)) largest, over the next one, by its
    posterior mean (Zhang and Stephens, Technometrics 51, 2009), and k drawn towards 1/2 with a weight of ten of them
    (Vehtari et al., appendix C).
    """
    values = values[np.isfinite(values) & (values > ROUNDING * values.max(initial=0))]
    if len(values) < FEWEST:
        return 0.0
    count = int(min(len(values) / 5, 3 * sqrt(len(values))))
    beyond = values[-count:] - values[-count - 1]
    beyond = beyond[beyond > 0]
    n = len(beyond)
    if n < FEWEST // 5:
        return 0.0
    grid = 30 + int(sqrt(n))
    quartile, most = beyond[int(n / 4 + 0.5) - 1], beyond[-1]
    theta = 1 / most + (1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3 * quartile)
    # At exactly 0, an exponential distribution, shape and scale are 0 / 0
    theta = np.where(theta == 0, 1e-9 / most, theta)
    shapes = np.log1p(-theta[:, None] * beyond).mean(axis=1)
    likelihood = n * (np.log(-theta / shapes) - shapes - 1)
    weights = 1 / np.exp(np.minimum(likelihood - likelihood[:, None], 700)).sum(axis=1)
    best = float(np.sum(weights * theta) / weights.sum())
    return (n * float(np.log1p(-best * beyond).mean()) + 5) / (n + 10)
