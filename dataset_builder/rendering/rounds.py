"""Sampling in rounds: every pixel a little, then more where the noise is, until each layer is as good as was asked.

Samples that decide how many follow must not be averaged with those: a pixel that looks dark by chance would be left
dark. So the noise of a pixel is predicted from the samples of the pixels around it, and its own have no say
(`allocation`): how often a pixel is asked is independent of what it answers, and its mean is unbiased.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy as np

from dataset_builder.rendering.allocation import SHARE, predicted_deviation, wanted
from dataset_builder.rendering.moments import Estimate, gathered, pooled, quantile, relative
from dataset_builder.rendering.neighbours import moderated
from dataset_builder.seeding import derive_seed

Stop = Literal["spp", "error", "cap", "time"]
"""Why sampling of a layer ended: it had a fixed spp, or one of the three ends of a goal."""

BATCH_SIZES = (4, 16, 64, 256, 1024)
"""Samples per batch in later rounds: each size is a kernel of its own."""

GROWTH = 8.0
"""After a round, a pixel has at most this many times the samples it had: predictions are noisy themselves."""

AIM = 0.97
"""Share of the error asked for that rounds aim at, to arrive rather than come close again and again."""

SLACK = 0.02
"""A pixel that lacks this share of its samples at most is there."""

Sample = Callable[[np.ndarray, int, int], Estimate]
"""(pixels, spp, seed) -> their estimate."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal:
    """How good one layer is to be.

    channels: of the pass, that the layer takes. inside: (P,) pixels that count. error, seconds: 0 where not asked for.
    cap: most spp of any pixel.
    """

    layer: str
    channels: slice
    inside: np.ndarray
    error: float
    seconds: float
    cap: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """What sampling in rounds found, why it ended for each layer that had a goal, and how many rounds it took."""

    found: Estimate
    stopped: Mapping[str, Stop]
    rounds: int


def refine(sample: Sample, pixels: np.ndarray, width: int, *, first: int, batches: int, goals: Sequence[Goal],
           seed: int, clock: Callable[[], float] = perf_counter) -> Refined:
    """Sample pixels until every goal is reached, capped or out of time; without goals, `first` samples each.

    pixels: (P,) indices row * width + column, rising. batches: independent ones in every round. seed: 64 bits.
    """
    start, stopped, smallest = clock(), dict[str, Stop](), batches * BATCH_SIZES[0]
    rounds = [found := sample(pixels, first, seed)]
    known = moderated(found, pixels, width)
    while open_goals := [goal for goal in goals if goal.layer not in stopped]:
        spent, wishes = clock() - start, []
        for goal in open_goals:
            extra = _extra(goal, known, pixels, width, smallest)
            if stop := _stop(goal, known, extra, spent):
                stopped[goal.layer] = stop
            else:
                wishes.append(_within(goal, found, extra, spent))
        if wishes:
            own_seed = derive_seed(seed, "round", len(rounds))
            rounds.append(_more(sample, pixels, np.max(wishes, axis=0), batches, own_seed))
            found = pooled(rounds)
            known = moderated(found, pixels, width)
    return Refined(found=known, stopped=stopped, rounds=len(rounds))


def _reached(goal: Goal, found: Estimate) -> float:
    """The error that SHARE of the pixels stay below."""
    return quantile(relative(found.mean[goal.inside, goal.channels], found.error[goal.inside, goal.channels]), SHARE)


def _extra(goal: Goal, found: Estimate, pixels: np.ndarray, width: int, smallest: int) -> np.ndarray:
    """(P,) samples that each pixel lacks for one goal, of which a round can take no less than `smallest`; 0 for pixels
    that are there, or at the cap."""
    wish = np.where(goal.inside, GROWTH * found.spp, 0)
    if goal.error:
        deviation = predicted_deviation(found, goal.channels, goal.inside, pixels, width)
        # One factor for all pixels, so that what is predicted for the layer is what was found
        expected = np.quantile((deviation / np.sqrt(found.spp))[goal.inside], SHARE) if goal.inside.any() else 0.0
        scale = _reached(goal, found) / expected if expected else 1.0
        wish = wanted(scale * deviation, AIM * goal.error)
    lacking = np.minimum(wish, GROWTH * found.spp) - found.spp
    room = goal.cap - found.spp
    return np.where((lacking > SLACK * found.spp) & (room >= smallest), np.minimum(lacking, room), 0)


def _stop(goal: Goal, found: Estimate, extra: np.ndarray, spent: float) -> Stop | None:
    """Why a goal is done with, if it is."""
    if goal.error and _reached(goal, found) <= goal.error:
        return "error"
    if goal.seconds and spent >= goal.seconds:
        return "time"
    return None if extra.any() else "cap"


def _within(goal: Goal, found: Estimate, extra: np.ndarray, spent: float) -> np.ndarray:
    """(P,) as many of the samples lacking as the goal's time may still allow, at the rate so far."""
    if not goal.seconds or not extra.any():
        return extra
    left = (goal.seconds - spent) / max(spent, 1e-3)
    return extra * min(1.0, left * float(found.spp.sum()) / float(extra.sum()))


def _more(sample: Sample, pixels: np.ndarray, extra: np.ndarray, batches: int, seed: int) -> Estimate:
    """About `extra` (P,) further samples, at least one batch of the smallest size where it is not 0: pixels that need
    much get large batches, several if need be."""
    sizes = batches * np.array(BATCH_SIZES)
    chosen = np.searchsorted(sizes, np.maximum(extra, sizes[0]), side="right") - 1
    times = np.where(extra > 0, np.maximum(extra // sizes[chosen], 1), 0).astype(np.int64)
    parts = []
    for kind, size in enumerate(sizes.tolist()):
        if len(here := np.flatnonzero((chosen == kind) & (times > 0))):
            entries = np.repeat(here, times[here])
            part = sample(pixels[entries], size, derive_seed(seed, size))
            parts.append(gathered(part, entries, len(pixels)))
    return pooled(parts)
