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

WIDE, UNKNOWN = 0.5, 0.6
"""Shapes from which an error is widened, and from which nothing is known: `docs/accuracy.md` says how they were set."""
TOP, MOST = 0.015, 0.1
"""Shares of the mean in the top of the contributions: from the first an error is widened, and unknown if it was widened
already; from the second it is unknown."""
TOP_PART = 0.001
"""Part of the contributions that is the top, at least one of them."""
FEWEST = 25
"""Contributions above 0 that a tail takes."""
CLOSEST = 0.9
"""Shape beyond which the mean of what has not come is no longer worked out: it has none from 1."""
TOGETHER = 1.25
"""Standard error of a layer's mean over what its pixels give as if they were independent, where they share light
paths; measured in the rooms of the mini dataset: 1.0 to 1.6."""
PRIOR = 3.0
"""Degrees of freedom that the pixels' errors count for beside the one of the two halves."""


@dataclass(frozen=True, kw_only=True)
class LayerMean:
    """The mean of a layer over its pixels and channels, and what may be said of its error."""

    error: float
    """Relative standard error, widened by the light that the tail lets expect beyond what was met."""
    tail: float
    """Pareto shape k of the largest contributions; 0 where there are too few."""
    top_share: float
    """Share of the mean that the top 0.1% of the contributions hold."""

    @property
    def known(self) -> Known:
        """What the tail says of the error."""
        if self.tail >= UNKNOWN or self.top_share >= MOST or not np.isfinite(self.error):
            return "unknown"
        return ("known", "widened", "unknown")[(self.tail >= WIDE) + (self.top_share >= TOP)]


def least_known(*means: LayerMean) -> Known:
    """The worst that several say."""
    return max((mean.known for mean in means), key=get_args(Known).index)


def layer_mean(found: Estimate, channels: slice, inside: np.ndarray, *, together: bool = False) -> LayerMean:
    """Of the pixels `inside` (P,) of an estimate whose errors are those of each pixel alone.

    A pixel's contribution is its largest batch, but no more than its standard error: so what is bright and even, a lamp
    in the picture, is none. together: whether pixels share light paths, so that their errors do not cancel out.
    """
    mean, error, half, peak = (getattr(found, name)[inside, channels] for name in ("mean", "error", "half", "peak"))
    total = float(abs(mean.sum())) / max(mean.shape[1], 1)
    if not total:
        return LayerMean(error=0.0, tail=0.0, top_share=0.0)
    # Channels of a pixel are noisy together
    apart = sqrt(float(np.sum(error.mean(axis=1) ** 2))) / total * (TOGETHER if together else 1.0)
    halves = float(abs((half - mean).sum())) / mean.shape[1] / total
    contributions = np.sort(np.minimum(peak / np.maximum(found.spp[inside], 1)[:, None], error).mean(axis=1)) / total
    shape, largest = pareto_tail(contributions)
    expected = max(largest, float(contributions[-1])) / (1 - float(np.clip(shape, 0, CLOSEST)))
    top = max(1, round(TOP_PART * len(contributions)))
    return LayerMean(error=hypot(sqrt((PRIOR * apart**2 + halves**2) / (PRIOR + 1)), expected), tail=shape,
                     top_share=float(contributions[-top:].sum()))


def pareto_tail(values: np.ndarray) -> tuple[float, float]:
    """(shape k, value that one of all is expected beyond) of the tail of (N,) rising values >= 0.

    The generalised Pareto distribution is fitted to the min(N / 5, 3 sqrt(N)) largest, over the next one, by its
    posterior mean (Zhang and Stephens, Technometrics 51, 2009), and k drawn towards 1/2 with a weight of ten of them
    (Vehtari et al., appendix C). (0, 0) where there are too few.
    """
    values = values[np.isfinite(values) & (values > 0)]
    if len(values) < FEWEST:
        return 0.0, 0.0
    count = int(min(len(values) / 5, 3 * sqrt(len(values))))
    beyond = values[-count:] - values[-count - 1]
    beyond = beyond[beyond > 0]
    n = len(beyond)
    if n < FEWEST // 5:
        return 0.0, 0.0
    grid = 30 + int(sqrt(n))
    quartile, most = beyond[int(n / 4 + 0.5) - 1], beyond[-1]
    theta = 1 / most + (1 - np.sqrt(grid / (np.arange(1, grid + 1) - 0.5))) / (3 * quartile)
    shapes = np.log1p(-theta[:, None] * beyond).mean(axis=1)
    likelihood = n * (np.log(-theta / shapes) - shapes - 1)
    weights = 1 / np.exp(np.minimum(likelihood - likelihood[:, None], 700)).sum(axis=1)
    best = float(np.sum(weights * theta) / weights.sum())
    shape = float(np.log1p(-best * beyond).mean())
    scale = -shape / best
    return (n * shape + 5) / (n + 10), float(values[-count - 1] + scale * (n**shape - 1) / shape)
