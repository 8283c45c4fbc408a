"""Which way to spend a budget is best, and what it is told apart from.

Arms are compared example by example and seed by seed. Two things would change a difference: other held-out objects,
whose share is clustered by object (`lightnet.results.clustered_means`), and other seeds. Two or three seeds of one pair
of arms hardly tell the latter, so all arms lend theirs: of the means m[a, s] of A arms and S seeds, what is left after
each arm's and each seed's own mean is taken off has the variance

    v = sum (m[a, s] - m[a, .] - m[., s] + m[., .])^2 / ((A - 1)(S - 1))

and the difference of two arms, over S seeds, 2 v / S. This takes arms to be alike in how much seeds move them. The
interval is the root of the sum of both squared intervals, which covers with its probability at least. What is not in it
are other training objects: all arms of a study have the same ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, inf, nan, sqrt
from pathlib import Path
from statistics import fmean

import numpy as np

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate, reach
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.studies.budget.arm_trainings import ArmTraining
from dataset_builder.studies.budget.arms import PLAIN, Arm
from dataset_builder.studies.comma_separated import write_csv

PSNR = "psnr"
COLUMNS = ("arm", "budget", "render_seconds", "target_spp", "rough_spp", "source_spp", "denoised", "noise", "examples",
           "learnt", "seeds", *(metric.name for metric in METRICS), "psnr_less_best", "half_width", "told_apart")


@dataclass(frozen=True, kw_only=True)
class ArmResult:
    """One arm measured."""

    arm: Arm
    learnt: int
    """Examples that passed the gates."""
    scores: tuple[tuple[ScoreRow, ...], ...]
    """By seed, examples in the same order everywhere."""

    def by_seed(self, metric: str) -> list[list[float]]:
        """A metric of every example, by seed."""
        return [[getattr(row.metrics, metric) for row in rows] for rows in self.scores]

    def mean(self, metric: str) -> float:
        """Over examples and seeds."""
        return fmean(map(fmean, self.by_seed(metric)))


@dataclass(frozen=True)
class BudgetResults:
    """All arms."""

    arms: tuple[ArmResult, ...]

    @classmethod
    def of(cls, work: Sequence[ArmTraining]) -> "BudgetResults":
        """From finished trainings."""
        by_arm: dict[Arm, list[ArmTraining]] = {}
        for one in work:
            by_arm.setdefault(one.arm, []).append(one)
        return cls(tuple(ArmResult(arm=arm, learnt=len(own[0].job.keys), scores=tuple(one.kept() for one in own))
                         for arm, own in by_arm.items()))

    @property
    def budgets(self) -> list[float]:
        """Rising."""
        return sorted({one.arm.budget for one in self.arms})

    @property
    def seeds(self) -> int:
        """Trainings of each arm."""
        return len(self.arms[0].scores)

    @property
    def objects(self) -> list[str]:
        """The object of every held-out example."""
        return [row.object for row in self.arms[0].scores[0]]

    def at(self, budget: float) -> list[ArmResult]:
        """Arms of one budget."""
        return [one for one in self.arms if one.arm.budget == budget]

    def best(self, budget: float) -> ArmResult:
        """The highest PSNR of one budget. The choice is part of the luck: whatever is not told apart may be it."""
        return max(self.at(budget), key=lambda one: one.mean(PSNR))

    @cached_property
    def seed_deviation(self) -> float:
        """Root of v in dB: how much a seed moves the PSNR of one arm against the others; NaN of one seed."""
        found = np.array([[fmean(values) for values in one.by_seed(PSNR)] for one in self.arms])
        freedom = self._freedom
        if not freedom:
            return nan
        left = found - found.mean(axis=1, keepdims=True) - found.mean(axis=0, keepdims=True) + found.mean()
        return sqrt(float(np.sum(left**2)) / freedom)

    @property
    def _freedom(self) -> int:
        return (len(self.arms) - 1) * (self.seeds - 1)

    def less(self, one: ArmResult, other: ArmResult) -> ClusteredMean:
        """PSNR of one arm less another's, with an interval over objects and seeds; of one seed over objects alone."""
        pairs = zip(one.by_seed(PSNR), other.by_seed(PSNR), strict=True)
        differences = [[mine - theirs for mine, theirs in zip(*pair, strict=True)] for pair in pairs]
        found = estimate([fmean(several) for several in zip(*differences, strict=True)], self.objects)
        if not self._freedom or one is other:
            return found
        error = self.seed_deviation * sqrt(2 / self.seeds)
        return replace(found, error=hypot(found.error, error), naive=hypot(found.naive, error),
                       half_width=hypot(found.half_width, reach(self._freedom) * error))

    def plain(self, one: ArmResult) -> ArmResult:
        """The arm with the same examples and a plain loss."""
        return next(other for other in self.at(one.arm.budget) if other.arm == replace(one.arm, noise=PLAIN))

    def as_good(self, budget: float) -> list[ArmResult]:
        """The best arm of a budget and all that are not told apart from it, best first."""
        best = self.best(budget)
        near = [one for one in self.at(budget) if one is best or not self.less(one, best).told_apart]
        return sorted(near, key=lambda one: -one.mean(PSNR))


def write_arms(found: BudgetResults, path: Path) -> None:
    """A line for each arm as CSV. Raises OutputError."""
    write_csv(path, COLUMNS, [_line(found, one) for one in found.arms])


def _line(found: BudgetResults, one: ArmResult) -> list[object]:
    arm, best = one.arm, found.best(one.arm.budget)
    gap = found.less(one, best)
    width = 0.0 if one is best else gap.half_width
    return [arm.name, arm.budget, arm.seconds, arm.mix.target, arm.mix.rough, arm.mix.source, int(arm.mix.denoised),
            arm.noise, arm.examples, one.learnt, found.seeds, *(one.mean(metric.name) for metric in METRICS), gap.mean,
            width if width < inf else nan, int(one is not best and gap.told_apart)]
