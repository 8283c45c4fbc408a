"""Monte Carlo means and standard errors on a list of pixels.

A pixel's samples are split into independent batches, each stratified by a scrambled Sobol sequence of its own
(`owen_sobol`) or, where there are no powers of two, by Mitsuba's `multijitter` (Kensler, "Correlated multi-jittered
sampling", Pixar technical memo 13-01, 2013). Samples within a batch are correlated on purpose, batches are not: the
spread of their means gives an unbiased standard error, which the spread of the samples would overstate.
Sums run over contiguous samples in a fixed order, so that a repetition gives the same bits; no float32 sum runs over
more than one batch, so that none drifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from dataset_builder.rendering.buffers import owned
from dataset_builder.rendering.sampling.moments import Estimate, of_batches, pooled
from dataset_builder.rendering.sampling.owen_sobol import POINTS, OwenSobol
from dataset_builder.seeding import derive_seed

LANES = 1 << 21
"""Samples traced at once: bounds memory, and keeps the device busy."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Samplers:
    """Random numbers of every lane."""

    strata: OwenSobol | mi.Sampler
    """For what comes first in a path, stratified within the lane's batch."""
    rest: mi.Sampler
    """For what comes after, independent: beyond some dozen dimensions strata gain nothing, and cost a tenth of the
    time."""
    group: mi.UInt32
    """Which of the independent samples of its pixel the lane belongs to; lanes of one group may share what is random,
    see `Shared`."""
    seed: int
    """64 bits, for random numbers that are drawn later."""


Integrand = Callable[[Samplers, "mi.Vector2f"], "list[mi.Float]"]
"""Samplers and film position in [0, 1]^2 of every lane -> C channels."""


@dataclass(frozen=True, kw_only=True)
class Groups:
    """How samples fall into groups that are independent of each other: one for each batch, and for each time that a
    pixel is listed."""

    count: int
    samples: int
    """Of the largest group, over all of its pixels."""
    per_pixel: int
    """Samples of a pixel in a group."""
    seed: int
    """64 bits."""


Elsewhere = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""What comes to pixels from elsewhere than their own samples: (P,) pixels, (P, B) groups of their batches ->
(P, B, C), added to the means."""

Shared = Callable[[Groups], tuple[Integrand, Elsewhere | None]]
"""What pixels of a group share, such as light paths, made anew for each set of groups: the integrand, and what comes
from elsewhere, if anything."""


def stratified(spp: int, batches: int) -> tuple[int, int, int]:
    """(repetitions, batches in each, samples per batch) that are used for `spp`, which may grow a little: batches are
    equal, and those of `multijitter` full grids of strata."""
    batches = min(batches, spp)
    repetitions = math.ceil(spp / (batches * POINTS))
    least = math.ceil(spp / batches / repetitions)
    if not _on_grid(least):
        return repetitions, batches, least
    return repetitions, batches, mi.load_dict({"type": "multijitter", "sample_count": least}).sample_count()


def _on_grid(per_batch: int) -> bool:
    """Whether `multijitter` serves a batch: it is calmer where there are no powers of two, and nearly sound above 16
    and at 9, with correlations below 0.01. In other small batches it permutes strata unevenly, see `owen_sobol`."""
    return per_batch == 9 or (per_batch > 16 and per_batch.bit_count() > 1)


def estimate(integrand: Integrand, pixels: np.ndarray, *, width: int, height: int, spp: int, batches: int,
             seed: int) -> Estimate:
    """`estimate_shared` of an integrand whose pixels share nothing."""
    return estimate_shared(lambda _: (integrand, None), pixels, width=width, height=height, spp=spp, batches=batches,
                           seed=seed)


def estimate_shared(shared: Shared, pixels: np.ndarray, *, width: int, height: int, spp: int, batches: int,
                    seed: int) -> Estimate:
    """Means of an integrand over the areas of pixels. pixels: (P,) indices row * width + column, which may repeat, each
    time with its own random numbers; seed: 64 bits."""
    _, batches, per_batch = stratified(spp, batches)
    found = [_once(shared, pixels, width, height, batches, per_batch, own) for own in _seeds(spp, batches, seed)]
    return found[0] if len(found) == 1 else pooled(found)


def groups_of(pixels: np.ndarray, spp: int, batches: int, seed: int) -> list[Groups]:
    """The sets of groups that `estimate_shared` makes something for, one after the other."""
    _, batches, per_batch = stratified(spp, batches)
    return [_groups(_times_before(pixels), batches, per_batch, own) for own in _seeds(spp, batches, seed)]


def _seeds(spp: int, batches: int, seed: int) -> list[int]:
    """Of every repetition."""
    return [seed, *(derive_seed(seed, "more", k) for k in range(1, stratified(spp, batches)[0]))]


def _groups(times: np.ndarray, batches: int, per_batch: int, seed: int) -> Groups:
    return Groups(count=batches * (1 + int(times.max(initial=0))), samples=per_batch * int((times == 0).sum()),
                  per_pixel=per_batch, seed=derive_seed(seed, "shared"))


def _once(shared: Shared, pixels: np.ndarray, width: int, height: int, batches: int, per_batch: int,
          seed: int) -> Estimate:
    lanes, times = batches * per_batch, _times_before(pixels)
    integrand, elsewhere = shared(_groups(times, batches, per_batch, seed))
    parts = []
    for number, entries in enumerate(_chunks(np.arange(len(pixels)), max(1, LANES // lanes))):
        own = derive_seed(seed, number, int(pixels[entries[0]]))
        parts.append(_batch_means(integrand, pixels[entries], times[entries], width, height, batches, per_batch, own))
    means = np.concatenate(parts)
    if elsewhere:
        means += elsewhere(pixels, times[:, None] * batches + np.arange(batches))
    return of_batches(means, lanes)


def _times_before(pixels: np.ndarray) -> np.ndarray:
    """(P,) how often each pixel was listed before."""
    order = np.argsort(pixels, kind="stable")
    placed = pixels[order]
    first = np.concatenate([[True], placed[1:] != placed[:-1]]) if len(pixels) else np.zeros(0, dtype=bool)
    begin = np.maximum.accumulate(np.where(first, np.arange(len(pixels)), 0))
    times = np.empty(len(pixels), dtype=np.int64)
    times[order] = np.arange(len(pixels)) - begin
    return times


def _chunks(entries: np.ndarray, size: int) -> Iterator[np.ndarray]:
    for first in range(0, len(entries), size):
        yield entries[first:first + size]


def _batch_means(integrand: Integrand, pixels: np.ndarray, times: np.ndarray, width: int, height: int, batches: int,
                 per_batch: int, seed: int) -> np.ndarray:
    """(P, batches, C) float64."""
    count, b = len(pixels) * batches * per_batch, dr.opaque(mi.UInt32, batches)
    batch = dr.arange(mi.UInt32, count) // dr.opaque(mi.UInt32, per_batch)
    slot = batch // b
    group = dr.gather(mi.UInt32, owned(mi.UInt32, (times * batches).astype(np.uint32)), slot) + batch - slot * b
    samplers = _samplers(per_batch, count, seed, group)
    pixel = dr.gather(mi.UInt32, owned(mi.UInt32, pixels.astype(np.uint32)), slot)
    size = dr.opaque(mi.Float, width), dr.opaque(mi.Float, height)
    row = pixel // dr.opaque(mi.UInt32, width)
    column = pixel - row * dr.opaque(mi.UInt32, width)
    position = (mi.Vector2f(mi.Float(column), mi.Float(row)) + samplers.strata.next_2d()) / mi.Vector2f(*size)
    channels = integrand(samplers, position)
    # All of them by one kernel, before they are summed one by one
    dr.eval(channels)
    sums = [dr.block_sum(channel, per_batch, mode="evaluated") for channel in channels]
    dr.eval(sums)
    stacked = np.stack([np.array(channel, dtype=np.float64) for channel in sums], axis=-1)
    return stacked.reshape(len(pixels), batches, -1) / per_batch


def _samplers(per_batch: int, lanes: int, seed: int, group: mi.UInt32) -> Samplers:
    rest = mi.load_dict({"type": "independent"})
    rest.seed(seed >> 32, lanes)
    strata: Any = OwenSobol.of_batches(per_batch, lanes, seed)
    if _on_grid(per_batch):
        strata = mi.load_dict({"type": "multijitter", "sample_count": per_batch})
        strata.set_samples_per_wavefront(per_batch)
        strata.seed(seed & 0xFFFFFFFF, lanes)
    return Samplers(strata=strata, rest=rest, group=group, seed=derive_seed(seed, "later"))
