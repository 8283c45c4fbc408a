"""Monte Carlo means and standard errors on a list of pixels.

A pixel's samples are split into independent batches, each stratified by Mitsuba's `multijitter` (Kensler, "Correlated
multi-jittered sampling", Pixar technical memo 13-01, 2013). Samples within a batch are correlated on purpose, batches
are not: the spread of their means gives an unbiased standard error, which the spread of the samples would overstate.
Sums run over contiguous samples in a fixed order, so that a repetition gives the same bits.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.seeding import derive_seed

MAX_CHANNELS = 16
LANES = 1 << 21
"""Samples traced at once: bounds memory, and keeps the device busy."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """mean, error: (P, C) float64, P pixels; error is the standard error of the mean. spp: samples per pixel."""

    mean: np.ndarray
    error: np.ndarray
    spp: int

    @classmethod
    def empty(cls) -> "Estimate":
        """No pixels, enough channels for any pass."""
        return cls(mean=np.zeros((0, MAX_CHANNELS)), error=np.zeros((0, MAX_CHANNELS)), spp=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Samplers:
    """Random numbers of every lane. strata: for what comes first in a path, stratified within the lane's batch. rest:
    for what comes after, independent: beyond some dozen dimensions strata gain nothing, and cost a tenth of the time.
    """

    strata: mi.Sampler
    rest: mi.Sampler


Integrand = Callable[[Samplers, mi.Vector2f], list[mi.Float]]
"""Samplers and film position in [0, 1]^2 of every lane -> C channels."""


def stratified(spp: int, batches: int) -> tuple[int, int]:
    """(batches, samples per batch) that are used for `spp`: a batch is a full grid of strata, so spp may grow a
    little."""
    batches = min(batches, spp)
    sampler = mi.load_dict({"type": "multijitter", "sample_count": max(1, math.ceil(spp / batches))})
    return batches, sampler.sample_count()


def estimate(integrand: Integrand, pixels: np.ndarray, *, width: int, height: int, spp: int, batches: int,
             seed: int) -> Estimate:
    """Means of an integrand over the areas of pixels. pixels: (P,) indices row * width + column; seed: 64 bits."""
    batches, per_batch = stratified(spp, batches)
    lanes = batches * per_batch
    parts = [_batch_means(integrand, chunk, width, height, batches, per_batch, derive_seed(seed, int(chunk[0])))
             for chunk in _chunks(pixels, max(1, LANES // lanes))]
    return _over_batches(np.concatenate(parts), lanes)


def _over_batches(means: np.ndarray, spp: int) -> Estimate:
    """Mean and standard error of (P, B, C) batch means; one batch has no error that could be known, so infinity."""
    batches = means.shape[1]
    # Batch by batch: NumPy's reductions over a short axis in the middle take ten times as long
    mean = sum(means[:, b] for b in range(batches)) / batches
    squares = sum((means[:, b] - mean) ** 2 for b in range(batches))
    error = np.sqrt(squares / (batches * (batches - 1))) if batches > 1 else np.full_like(mean, np.inf)
    return Estimate(mean=mean, error=error, spp=spp)


def _chunks(pixels: np.ndarray, size: int) -> Iterator[np.ndarray]:
    for first in range(0, len(pixels), size):
        yield pixels[first:first + size]


def _batch_means(integrand: Integrand, pixels: np.ndarray, width: int, height: int, batches: int, per_batch: int,
                 seed: int) -> np.ndarray:
    """(P, batches, C) float64."""
    count = len(pixels) * batches * per_batch
    samplers = _samplers(per_batch, count, seed)
    slot = dr.arange(mi.UInt32, count) // dr.opaque(mi.UInt32, batches * per_batch)
    pixel = dr.gather(mi.UInt32, mi.UInt32(pixels.astype(np.uint32)), slot)
    size = dr.opaque(mi.Float, width), dr.opaque(mi.Float, height)
    row = pixel // dr.opaque(mi.UInt32, width)
    column = pixel - row * dr.opaque(mi.UInt32, width)
    position = (mi.Vector2f(mi.Float(column), mi.Float(row)) + samplers.strata.next_2d()) / mi.Vector2f(*size)
    sums = [dr.block_sum(channel, per_batch, mode="evaluated") for channel in _evaluated(integrand(samplers, position))]
    dr.eval(sums)
    stacked = np.stack([np.array(channel, dtype=np.float64) for channel in sums], axis=-1)
    return stacked.reshape(len(pixels), batches, -1) / per_batch


def _samplers(per_batch: int, lanes: int, seed: int) -> Samplers:
    strata = mi.load_dict({"type": "multijitter", "sample_count": per_batch})
    strata.set_samples_per_wavefront(per_batch)
    strata.seed(seed & 0xFFFFFFFF, lanes)
    rest = mi.load_dict({"type": "independent"})
    rest.seed(seed >> 32, lanes)
    return Samplers(strata=strata, rest=rest)


def _evaluated(channels: list[mi.Float]) -> list[mi.Float]:
    """All channels computed by one kernel, before they are summed one by one."""
    dr.eval(channels)
    return channels
