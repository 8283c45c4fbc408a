"""Sampling in iterations: every pixel a little, then more where the noise is, until each layer is as good as was asked.

Samples that decide how many follow must not be averaged with those: a pixel that looks dark by chance would be left
dark, and a picture whose rare bright paths have not come yet would be taken for finished. So there are two halves with
random numbers of their own, and each is told by the other where to go on and when to stop: how often a half asks a
pixel is independent of what it finds there. The result is their plain average.

A half that goes by the noise of the other also takes it for an end too early: where the other happened to find little
noise it took few samples. So one number of the layer comes from both halves, the error that the record will state:
neither stops before that is the error asked for. A pixel has little say in the quantile of all of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from time import perf_counter
from typing import Literal

import numpy as np

from dataset_builder.rendering.sampling.heavy_tails import layer_mean
from dataset_builder.rendering.sampling.moments import Estimate, averaged, gathered, pooled, quantile, relative
from dataset_builder.rendering.sampling.pixel_noise import SHARE, deviations, expected_error, moderated, wanted
from dataset_builder.seeding import derive_seed

Stop = Literal["spp", "error", "cap", "time"]
"""Why sampling of a layer ended: it had a fixed spp, or one of the three ends of a goal."""

BATCH_SIZES = (4, 16, 64, 256, 1024)
"""Samples per batch in later iterations: powers of two, which share a kernel."""

GROWTH = 8.0
"""After an iteration, a pixel has at most this many times the samples it had: errors are noisy themselves."""

AIM = 0.97
"""Share of the error asked for that iterations aim at, to arrive rather than come close again and again."""

DOUBT = 2.0
"""Times the samples it had that every pixel gets in an iteration where the errors are there but the mean is unknown."""

SLACK = 0.02
"""A pixel that lacks this share of its samples at most is there."""

MIN_BATCHES = 2
"""Independent batches in a half: fewer have no error."""

Sample = Callable[[np.ndarray, int, int, int], Estimate]
"""(pixels, spp, batches, seed) -> their estimate."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Goal:
    """How good one layer is to be."""

    layer: str
    channels: slice
    """Those of the pass that the layer takes."""
    inside: np.ndarray
    """(P,) pixels that count."""
    error: float
    """Relative error that 95% of the pixels are to stay below; 0 where not asked for."""
    seconds: float
    """0 where not asked for."""
    cap: int
    """Most spp that any pixel gets."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sampled:
    """What a pass took so far, so that sampling can go on from there."""

    halves: tuple[Estimate, ...]
    """One estimate where spp is fixed; two that judge each other where there are goals."""
    iterations: tuple[int, ...] = (1,)
    """That each half took."""
    stopped: Mapping[str, Stop] = field(default_factory=dict)
    """Why sampling of each layer with a goal ended."""

    def rounded(self) -> "Sampled":
        """In single precision, as it is kept: the same bits, kept or not."""
        return replace(self, halves=tuple(half.rounded() for half in self.halves))

    def without_parts(self) -> "Sampled":
        """Without what parts of the samples found."""
        return replace(self, halves=tuple(half.without_parts() for half in self.halves))

    @property
    def together(self) -> Estimate:
        """All samples together, each pixel's error as it was found."""
        return averaged(self.halves) if len(self.halves) > 1 else self.halves[0]

    def estimate(self, pixels: np.ndarray, width: int) -> Estimate:
        """All samples together, each pixel's error moderated by its neighbours'."""
        return moderated(self.together, pixels, width)


def more_samples(sample: Sample, pixels: np.ndarray, before: Sampled | None, *, spp: int, part: int, batches: int,
                 seed: int) -> Sampled:
    """`spp` further samples of every pixel, as part number `part` of the pass: the first has the pass's own seed."""
    found = sample(pixels, spp, batches, derive_seed(seed, "part", part) if part else seed)
    return Sampled(halves=(pooled([before.halves[0], found]) if before else found,))


def refine(sample: Sample, pixels: np.ndarray, width: int, *, first: int, batches: int, goals: Sequence[Goal],
           seed: int, before: Sampled | None = None, clock: Callable[[], float] = perf_counter) -> Sampled:
    """Sample pixels until every goal is reached, capped or out of time.

    pixels: (P,) indices row * width + column, rising. first: samples of every pixel that there are before any decision,
    unless there are some `before`. batches: independent ones in every iteration. seed: 64 bits.
    """
    start, each = clock(), max(MIN_BATCHES, batches // 2)
    halves = [[half] for half in before.halves] if before else [
        [sample(pixels, max(each, first // 2), each, derive_seed(seed, "half", k))] for k in (0, 1)]
    count = list(before.iterations) if before else [1, 1]
    while True:
        found = [pooled(half) for half in halves]
        known = [moderated(half, pixels, width) for half in found]
        both = moderated(averaged(found), pixels, width)
        excess = {goal.layer: _excess(goal, both) for goal in goals}
        unknown = [[goal.layer for goal in goals if _unknown(goal, half)] for half in found]
        extras = [{goal.layer: _extra(goal, found[k], known[1 - k], each * BATCH_SIZES[0], excess=excess[goal.layer],
                                      unknown=goal.layer in unknown[1 - k]) for goal in goals} for k in (0, 1)]
        stopped = {goal.layer: _stop(goal, excess[goal.layer], [extra[goal.layer] for extra in extras],
                                     clock() - start, unknown=any(goal.layer in names for names in unknown))
                   for goal in goals}
        open_goals = [goal for goal in goals if not stopped[goal.layer]]
        if not open_goals:
            break
        for k, half in enumerate(halves):
            spent = clock() - start
            extra = np.max([_within(goal, found[k], extras[k][goal.layer], spent) for goal in open_goals], axis=0)
            if extra.any():
                half.append(_more(sample, pixels, extra, each, derive_seed(seed, "round", k, count[k])))
                count[k] += 1
    ended = {layer: stop for layer, stop in stopped.items() if stop}
    return Sampled(halves=tuple(found), iterations=tuple(count), stopped=ended)


def _excess(goal: Goal, together: Estimate) -> float:
    """The error that the layer has, as its record will say, over the one asked for; 0 where none is."""
    if not goal.error:
        return 0.0
    means, errors = (values[goal.inside, goal.channels] for values in (together.mean, together.error))
    return quantile(relative(means, errors), SHARE) / goal.error


def _unknown(goal: Goal, half: Estimate) -> bool:
    """Whether a half says that it does not know the layer's mean: then errors of pixels cannot be relied on either."""
    return bool(goal.error) and layer_mean(half, goal.channels, goal.inside).known == "unknown"


def _extra(goal: Goal, own: Estimate, other: Estimate, smallest: int, *, excess: float = 0.0,
           unknown: bool = False) -> np.ndarray:
    """(P,) samples that a half lacks for one goal, by what the other half knows; an iteration can take no fewer than
    `smallest` of a pixel. 0 for pixels that are there, or at the cap. excess: see `_excess`. unknown: whether the other
    half does not know the layer's mean."""
    wish = np.where(goal.inside, GROWTH * own.spp, 0)
    if goal.error:
        # For the average of both halves to have the error asked for
        deviation, asked = deviations(other, goal.channels, goal.inside), sqrt(2) * goal.error
        reached = expected_error(deviation, own.spp)
        there = reached <= asked and excess <= 1
        if there and not unknown:
            return np.zeros(len(own.spp))
        wish = (np.where(goal.inside, DOUBT * own.spp, 0) if there else
                wanted(deviation, AIM * min(asked, reached / max(excess, 1))))
    lacking = np.minimum(wish, GROWTH * own.spp) - own.spp
    room = goal.cap // 2 - own.spp
    return np.where((lacking > SLACK * own.spp) & (room >= smallest), np.minimum(lacking, room), 0)


def _stop(goal: Goal, excess: float, extras: Sequence[np.ndarray], spent: float, *, unknown: bool = False,
          ) -> Stop | None:
    """Why a goal is done with, if it is."""
    if goal.seconds and spent >= goal.seconds:
        return "time"
    if any(extra.any() for extra in extras):
        return None
    return "error" if goal.error and excess <= 1 and not unknown else "cap"


def _within(goal: Goal, found: Estimate, extra: np.ndarray, spent: float) -> np.ndarray:
    """(P,) as many of the samples lacking as the goal's time may still allow, at the rate so far."""
    if not goal.seconds or not extra.any():
        return extra
    left = max(goal.seconds - spent, 0) / max(spent, 1e-3)
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
            part = sample(pixels[entries], size, batches, derive_seed(seed, size))
            parts.append(gathered(part, entries, len(pixels)))
    return pooled(parts)
