"""Means over many rows, their standard errors, and which method is better than which.

Examples of one object, or of one view, are not independent, so that the usual s / sqrt(n) promises too much. Standard
errors here are clustered by object (Liang and Zeger 1986, with the factor G / (G - 1) for G clusters):

    se^2 = G / (G - 1) * sum over objects of (sum over its examples of (x - mean))^2 / n^2

which is s^2 / n where every example has an object of its own. G is small in practice; intervals are therefore those of
Student's t with G - 1 degrees of freedom. They hold for new objects in such rooms, not for new kinds of rooms.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isnan, nan, sqrt
from statistics import median
from typing import Literal

import numpy as np
from scipy.stats import t

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.evaluate import ScoreRow

LEVEL = 0.95
"""Of intervals."""
ONE_OBJECT = "One object: no standard error over objects, and no difference is told apart"
"""What is to be known of figures on a single object."""

Verdict = Literal["better", "worse", "open"]


@dataclass(frozen=True, kw_only=True)
class ClusteredMean:
    """A mean with its standard errors; NaN where there is but one object, one example."""

    mean: float
    error: float
    """Standard error, clustered by object."""
    naive: float
    """Standard error as if examples were independent."""
    examples: int
    objects: int
    half_width: float
    """Of the interval that covers the mean over all objects with probability `LEVEL`; infinite for one object."""

    @property
    def told_apart(self) -> bool:
        """Whether it is told apart from 0: the interval does not hold it."""
        return abs(self.mean) > self.half_width


@dataclass(frozen=True, kw_only=True)
class Summary:
    """One method."""

    method: str
    metrics: dict[str, ClusteredMean]
    """By name."""
    seconds: float
    """Median over examples."""
    corrected: dict[str, ClusteredMean]
    """Estimates against truth without noise; NaN where nobody knows the noise, as in `ceiling`."""
    ceiling: dict[str, ClusteredMean]
    """Of a perfect prediction on the same examples."""

    @property
    def noise_known(self) -> bool:
        """Whether the noise of the truth is known."""
        return not isnan(self.ceiling["psnr"].mean)


@dataclass(frozen=True, kw_only=True)
class Paired:
    """One metric of one method less the same of another, example by example."""

    method: str
    other: str
    metric: str
    difference: ClusteredMean
    ahead: int
    """Examples in which it is better."""
    verdict: Verdict


def summarise(rows: Sequence[ScoreRow]) -> list[Summary]:
    """Every method that rows hold, in the order of its first row."""
    return [_summary(method, [row for row in rows if row.method == method]) for method in methods(rows)]


def methods(rows: Sequence[ScoreRow]) -> list[str]:
    """Names, in the order of their first rows."""
    return list(dict.fromkeys(row.method for row in rows))


def compare(rows: Sequence[ScoreRow], method: str, other: str) -> list[Paired]:
    """`method` less `other` in every metric, on the examples that both have rows of."""
    theirs = {row.key: row for row in rows if row.method == other}
    pairs = [(row, theirs[row.key]) for row in rows if row.method == method and row.key in theirs]
    return [_paired(method, other, metric.name, metric.better == "low", pairs) for metric in METRICS]


def estimate(values: Sequence[float], clusters: Sequence[str]) -> ClusteredMean:
    """Mean of values with standard errors; clusters: the object of every value."""
    count, names = len(values), sorted(set(clusters))
    array = np.asarray(values, np.float64)
    residuals = array - array.mean()
    naive = sqrt(float(np.sum(residuals**2)) / (count - 1) / count) if count > 1 else nan
    sums = np.bincount([names.index(cluster) for cluster in clusters], weights=residuals)
    groups = len(names)
    error = sqrt(groups / (groups - 1) * float(np.sum(sums**2))) / count if groups > 1 else nan
    return ClusteredMean(mean=float(array.mean()), error=error, naive=naive, examples=count, objects=groups,
                         half_width=reach(groups - 1) * error if groups > 1 else inf)


def reach(freedom: int) -> float:
    """Standard errors that an interval of probability `LEVEL` reaches to either side, by degrees of freedom."""
    return float(t.ppf((1 + LEVEL) / 2, freedom))


def chosen(rows: Sequence[ScoreRow], method: str) -> dict[str, ScoreRow]:
    """Rows of a method by what they are: `best`, `median` and `worst` of its PSNR; keys decide between equals.

    Of an even number the lower median; no median of two, and of one example only the best.
    """
    ranked = sorted((row for row in rows if row.method == method), key=lambda row: (-row.metrics.psnr, row.key))
    names = ("best", "median", "worst") if len(ranked) > 2 else ("best", "worst")[:len(ranked)]
    places = {"best": 0, "median": len(ranked) // 2, "worst": -1}
    return {name: ranked[places[name]] for name in names}


def _summary(method: str, rows: Sequence[ScoreRow]) -> Summary:
    objects = [row.object for row in rows]
    metrics, corrected, ceiling = (
        {metric.name: estimate([getattr(getattr(row, part), metric.name) for row in rows], objects)
         for metric in METRICS} for part in ("metrics", "corrected", "ceiling"))
    return Summary(method=method, metrics=metrics, seconds=median(row.seconds for row in rows), corrected=corrected,
                   ceiling=ceiling)


def _paired(method: str, other: str, metric: str, low_is_better: bool,
            pairs: Sequence[tuple[ScoreRow, ScoreRow]]) -> Paired:
    differences = [getattr(mine.metrics, metric) - getattr(theirs.metrics, metric) for mine, theirs in pairs]
    found = estimate(differences, [mine.object for mine, _ in pairs])
    gains = [-value if low_is_better else value for value in differences]
    return Paired(method=method, other=other, metric=metric, difference=found, ahead=sum(gain > 0 for gain in gains),
                  verdict=_verdict(found, low_is_better))


def _verdict(found: ClusteredMean, low_is_better: bool) -> Verdict:
    """`open` where the interval holds 0."""
    gain = -found.mean if low_is_better else found.mean
    if not found.told_apart:
        return "open"
    return "better" if gain > 0 else "worse"
