"""Means of pixels with honest errors: from batches, from several iterations together, and over a whole layer.

Nothing here traces a ray. Estimates are independent of each other; how many samples each took of a pixel must not
depend on what it found there, so that pooling by number of samples is unbiased (see `adaptive`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t

FLOOR = 0.1
"""Share of a layer's mean below which a pixel's error counts in absolute terms."""

FIGURES = ("mean", "error", "freedom", "half", "odd", "peak")
"""Arrays (P, C) of an estimate."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """What is known about P pixels in C channels."""

    mean: np.ndarray
    """(P, C) float64."""
    error: np.ndarray
    """(P, C) float64, standard error of the mean."""
    spp: np.ndarray
    """(P,) samples behind each pixel."""
    freedom: np.ndarray
    """(P, C) degrees of freedom of `error`, so that mean +- t(freedom) error is a confidence interval."""
    half: np.ndarray
    """(P, C) mean of the first half of the batches, rounded down; of the first of two halves that judge each other.
    With an even number of batches, 2 `mean` - `half` is independent of it. `mean` where there is one batch."""
    odd: np.ndarray
    """(P, C) mean of every other batch, from the first; of two halves that judge each other, mean of what each has as
    `half`. Where four divides the number of batches, its difference to `mean` is independent of that of `half`."""
    peak: np.ndarray
    """(P, C) the largest contribution of one batch to the sum of all `spp` samples: |batch mean| x its samples."""

    @classmethod
    def empty(cls, channels: int = 16) -> "Estimate":
        """No pixels, enough channels for any pass."""
        nothing = np.zeros((0, channels))
        return cls(mean=nothing, error=nothing, spp=np.zeros(0, dtype=np.int64), freedom=nothing,
                   half=nothing, odd=nothing, peak=nothing)

    @classmethod
    def exact(cls, values: np.ndarray) -> "Estimate":
        """(P, C) values known without noise, from one sample."""
        values = values.astype(np.float64)
        return cls(mean=values, error=np.zeros_like(values), spp=np.ones(len(values), dtype=np.int64),
                   freedom=np.full(values.shape, np.inf), half=values, odd=values, peak=np.abs(values))

    def padded(self, channels: int) -> "Estimate":
        """With further channels that are exactly 0."""
        more = ((0, 0), (0, channels - self.mean.shape[1]))
        values = {name: np.pad(getattr(self, name), more) for name in ("mean", "error", "half", "odd", "peak")}
        return Estimate(**values, spp=self.spp, freedom=np.pad(self.freedom, more, mode="edge"))

    def rounded(self) -> "Estimate":
        """In single precision."""
        return Estimate(spp=self.spp, **{name: getattr(self, name).astype(np.float32).astype(np.float64)
                                         for name in FIGURES})

    def without_parts(self) -> "Estimate":
        """With the mean for parts of the samples and no peak: of layers without light nobody asks for them."""
        return replace(self, half=self.mean, odd=self.mean, peak=np.zeros_like(self.mean))

    def interval(self, level: float = 0.95) -> np.ndarray:
        """(P, C) half width of the confidence interval of each mean (Student's t)."""
        return t.ppf((1 + level) / 2, np.maximum(self.freedom, 1)) * self.error


def of_batches(means: np.ndarray, spp: int) -> Estimate:
    """Mean and standard error of (P, B, C) batch means; one batch has no error that could be known, so infinity."""
    batches = means.shape[1]
    # Batch by batch: NumPy's reductions over a short axis in the middle take ten times as long
    mean = sum(means[:, b] for b in range(batches)) / batches
    squares = sum((means[:, b] - mean) ** 2 for b in range(batches))
    error = np.sqrt(squares / (batches * (batches - 1))) if batches > 1 else np.full_like(mean, np.inf)
    first = max(batches // 2, 1)
    half = sum(means[:, b] for b in range(first)) / first
    odd = sum(means[:, b] for b in range(0, batches, 2)) / ((batches + 1) // 2)
    peak = np.abs(means[:, 0])
    for b in range(1, batches):
        peak = np.maximum(peak, np.abs(means[:, b]))
    return Estimate(mean=mean, error=error, spp=np.full(len(mean), spp, dtype=np.int64),
                    freedom=np.full_like(mean, batches - 1), half=half, odd=odd, peak=peak * (spp / batches))


def pooled(estimates: Sequence[Estimate]) -> Estimate:
    """Independent estimates of the same pixels as one, each weighted by its samples.

    Degrees of freedom by Welch and Satterthwaite (Satterthwaite, Biometrics Bulletin 2, 1946, equation 17).
    """
    spp = np.sum([found.spp for found in estimates], axis=0)
    shares = [(found.spp / np.maximum(spp, 1))[:, None] for found in estimates]
    mean = sum(share * found.mean for share, found in zip(shares, estimates, strict=True))
    # One that took no sample of a pixel says nothing of it: its share is 0, and so is what it adds
    parts = [np.where(share > 0, share * np.where(share > 0, found.error, 0), 0) ** 2
             for share, found in zip(shares, estimates, strict=True)]
    variance = np.sum(parts, axis=0)
    doubt = sum(part**2 / np.maximum(found.freedom, 1) for part, found in zip(parts, estimates, strict=True))
    most = sum(np.where(share > 0, found.freedom, 0) for share, found in zip(shares, estimates, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = np.where(doubt > 0, variance**2 / doubt, most)
    half, odd = (sum(share * getattr(found, name) for share, found in zip(shares, estimates, strict=True))
                 for name in ("half", "odd"))
    peak = np.max([found.peak for found in estimates], axis=0)
    return Estimate(mean=mean, error=np.sqrt(variance), spp=spp, freedom=freedom, half=half, odd=odd,
                    peak=peak)


def averaged(halves: Sequence[Estimate]) -> Estimate:
    """Independent estimates of the same pixels as one, each with the same weight whatever its samples."""
    n = len(halves)
    parts = [(found.error / n) ** 2 for found in halves]
    variance = np.sum(parts, axis=0)
    doubt = sum(part**2 / np.maximum(found.freedom, 1) for part, found in zip(parts, halves, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = np.where(doubt > 0, variance**2 / doubt, sum(found.freedom for found in halves))
    spp = np.sum([found.spp for found in halves], axis=0)
    # In samples of the average, where those of a half that took fewer weigh more
    peak = np.max([found.peak * (spp / (n * np.maximum(found.spp, 1)))[:, None] for found in halves], axis=0)
    return Estimate(mean=np.sum([found.mean for found in halves], axis=0) / n, error=np.sqrt(variance), spp=spp,
                    freedom=freedom, half=halves[0].mean, odd=np.sum([found.half for found in halves], axis=0) / n,
                    peak=peak)


def gathered(found: Estimate, entries: np.ndarray, count: int) -> Estimate:
    """Entries of an estimate, of which several may be of one pixel, as an estimate of `count` pixels.

    entries: (E,) pixel of each, rising. Entries of one pixel have equal spp, so that they weigh the same. Pixels
    without an entry have spp 0.
    """
    firsts = np.searchsorted(entries, np.arange(count + 1))
    number = np.diff(firsts)
    have = np.flatnonzero(number)

    def total(values: np.ndarray, over: np.ufunc = np.add) -> np.ndarray:
        summed = np.zeros((count, *values.shape[1:]))
        if len(have):
            summed[have] = over.reduceat(values, firsts[have], axis=0)
        return summed

    n = np.maximum(number, 1)[:, None]
    return Estimate(mean=total(found.mean) / n, error=np.sqrt(total(found.error**2)) / n,
                    spp=total(found.spp).astype(np.int64), freedom=total(found.freedom),
                    half=total(found.half) / n, odd=total(found.odd) / n, peak=total(found.peak, np.maximum))


def relative(mean: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(P, C) errors relative to what they are errors of: e / sqrt(mean^2 + (FLOOR m)^2), m the mean of all pixels.

    Its mean square is the relative mean squared error that the layer may be expected to have.
    """
    m = FLOOR * float(np.abs(mean).mean()) if mean.size else 0.0
    return error / np.sqrt(np.maximum(mean**2 + m**2, np.finfo(np.float64).tiny))


def root_mean_square(relative_errors: np.ndarray) -> float:
    """Over all pixels and channels of (P, C); 0 for none."""
    return float(np.sqrt(np.mean(relative_errors**2))) if relative_errors.size else 0.0


def quantile(relative_errors: np.ndarray, share: float = 0.95) -> float:
    """What `share` of the pixels stay below: a pixel of (P, C) counts by the root mean square of its channels."""
    of_pixels = np.sqrt(np.mean(relative_errors**2, axis=1))
    return float(np.quantile(of_pixels, share)) if of_pixels.size else 0.0
