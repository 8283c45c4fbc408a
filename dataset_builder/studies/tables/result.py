"""The result of a row, and whether the published order is reproduced: pair by pair, with the error of each difference.

Of every two rows that the paper compares, the one that it prints as better should be the better one here. A pair is
*told apart* where the interval of its difference, example by example and clustered by object
(`lightnet.results.clustered_means`), does not contain 0; only such pairs can agree with the paper's order or contradict
it. With one seed the interval does not include the spread between trainings. All pairs together give Kendall's tau.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import hypot, isnan, nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Literal

from dataset_builder.lightnet.measures.metrics import METRICS, Metric
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate, reach
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.tables.paper import Group, Printed, Table, TableRow
from dataset_builder.studies.tables.table_kinds import NO_WEIGHTS

Better = Literal["low", "high"]
Verdict = Literal["as printed", "against", "not told apart"]
TABLE_COLUMNS = ("row", "title", "note", "seeds", "examples", "objects", "steps", "parameters", "seconds_per_step",
                 *(f"{metric.name}{end}" for metric in METRICS for end in (
                     "", "_error", "_sd_over_seeds", "_paper", "_corrected", "_corrected_error", "_ceiling")))
PAIR_COLUMNS = ("group", "metric", "better_in_paper", "worse_in_paper", "printed_gain", "gain", "gain_error",
                "half_width", "verdict", "altered")


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two rows by name."""

    group: str
    metric: str
    better: str
    """The one that the paper prints as better."""
    worse: str
    printed: float
    gain: ClusteredMean
    """Mean over examples of how much better it is here, so that > 0 is the printed order."""
    altered: bool
    """One of them is not quite what the paper's is."""

    @property
    def as_printed(self) -> bool:
        """Whether the means stand in the printed order, told apart or not."""
        return self.gain.mean > 0

    @property
    def verdict(self) -> Verdict:
        """What can be said of it."""
        if not self.gain.told_apart:
            return "not told apart"
        return "as printed" if self.as_printed else "against"


@dataclass(frozen=True, kw_only=True)
class Order:
    """All pairs of one metric."""

    metric: str
    pairs: tuple[Pair, ...]

    @property
    def kendall(self) -> float:
        """Kendall's tau-a: pairs in the printed order less the others, over all; ties of the paper are no pairs."""
        signs = [(pair.gain.mean > 0) - (pair.gain.mean < 0) for pair in self.pairs]
        return sum(signs) / len(signs)

    def count(self, verdict: Verdict) -> int:
        """Pairs of which that can be said."""
        return sum(pair.verdict == verdict for pair in self.pairs)


def printed_pairs(printed: Mapping[str, Printed], metric: str, better: Better) \
        -> list[tuple[str, str, float]]:
    """(better row, worse row, how much better) of every two rows that the paper does not print as equal."""
    sign = 1 if better == "high" else -1
    found = []
    for one, two in combinations(printed, 2):
        gain = sign * (printed[one].of(metric) - printed[two].of(metric))
        if gain:
            found.append((one, two, gain) if gain > 0 else (two, one, -gain))
    return found


def summary(order: Order, symbol: str) -> str:
    """One sentence on one metric."""
    pairs = order.pairs
    right = sum(pair.as_printed for pair in pairs)
    return (f"{symbol}: {right} of {len(pairs)} pairs in the paper's order (Kendall's tau {order.kendall:+.2f}); told "
            f"apart: {order.count('as printed')} as printed, {order.count('against')} against it")


def verdict(orders: Sequence[Order]) -> str:
    """What all metrics together say; that of rows which are not quite the paper's is said, too."""
    pairs = [pair for order in orders for pair in order.pairs]
    altered = sum(pair.altered for pair in pairs)
    caveat = f" In {altered} of {len(pairs)} pairs a row has losses off that the paper's had on." if altered else ""
    return _verdict(pairs) + caveat


def _verdict(pairs: Sequence[Pair]) -> str:
    told = [pair for pair in pairs if pair.verdict != "not told apart"]
    against = sum(pair.verdict == "against" for pair in told)
    if not told:
        return "No two rows are told apart: this run neither reproduces the paper's order nor contradicts it."
    if against:
        return (f"The paper's order is not reproduced: {len(told)} of {len(pairs)} pairs are told apart, {against} of "
                "them against it.")
    if len(told) == len(pairs):
        return "The paper's order is reproduced, by all metrics and pairs."
    return f"Nothing contradicts the paper's order: {len(told)} of {len(pairs)} pairs are told apart, all as printed."


@dataclass(frozen=True, kw_only=True)
class RowResult:
    """One row measured."""

    row: TableRow
    scores: tuple[tuple[ScoreRow, ...], ...]
    """Rows of every seed, examples in the same order."""
    facts: dict[str, Any]
    """What its trainings said."""

    @property
    def altered(self) -> bool:
        """Whether losses that it asks for were off."""
        return bool(self.facts.get("off"))

    @property
    def note(self) -> str:
        """What is to be known of it, such as that FR was off."""
        off = [NO_WEIGHTS if text.startswith("fr ") else text for text in self.facts.get("off", [])]
        return "; ".join([*([self.row.note] if self.row.note else []), *off])

    def mean(self, metric: str, part: str = "metrics") -> ClusteredMean:
        """Mean of a metric, with its error. part: of `ScoreRow`, as it was measured, corrected, or of the ceiling."""
        return over_seeds([values(rows, metric, part) for rows in self.scores], objects(self.scores[0]))

    @property
    def noise_known(self) -> bool:
        """Whether the noise of the truth is known."""
        return not isnan(self.mean("psnr", "ceiling").mean)

    def spread(self, metric: str) -> float:
        """Standard deviation of the mean over seeds; NaN for one seed."""
        means = [fmean(values(rows, metric)) for rows in self.scores]
        return stdev(means) if len(means) > 1 else nan

    def less(self, other: "RowResult", metric: str) -> ClusteredMean:
        """Mean of a metric less the other's, example by example and seed by seed."""
        return over_seeds([[one - two for one, two in zip(values(mine, metric), values(theirs, metric), strict=True)]
                           for mine, theirs in _beside(self.scores, other.scores)], objects(self.scores[0]))


def values(rows: Sequence[ScoreRow], metric: str, part: str = "metrics") -> list[float]:
    """A metric of every row."""
    return [getattr(getattr(row, part), metric) for row in rows]


def objects(rows: Sequence[ScoreRow]) -> list[str]:
    """The object of every row."""
    return [row.object for row in rows]


def over_seeds(by_seed: Sequence[Sequence[float]], clusters: Sequence[str]) -> ClusteredMean:
    """Mean over examples of values that were measured with each of K seeds.

    The variance over objects, of each example's mean over seeds, and that of the mean over K seeds add up: neither
    other objects nor other trainings would repeat the value. Of a handful of seeds the latter is hardly known: the
    interval is the root of the sum of both squared intervals, which covers with its probability at least (Banerjee
    1960). With one seed it is not known at all, and left out.
    """
    found = estimate([fmean(several) for several in zip(*by_seed, strict=True)], clusters)
    if len(by_seed) < 2:
        return found
    between = stdev(fmean(of_one) for of_one in by_seed) / sqrt(len(by_seed))
    return replace(found, error=hypot(found.error, between), naive=hypot(found.naive, between),
                   half_width=hypot(found.half_width, reach(len(by_seed) - 1) * between))


def orders(table: Table, results: Sequence[RowResult]) -> list[Order]:
    """For every metric the pairs of every group of rows that the paper compares; none where it prints no numbers."""
    found = [Order(metric=metric.name, pairs=tuple(pair for group in table.groups
                                                   for pair in _pairs(group, table, results, metric)))
             for metric in METRICS]
    return [order for order in found if order.pairs]


def _pairs(group: Group, table: Table, results: Sequence[RowResult], metric: Metric) -> list[Pair]:
    by_name = {result.row.name: result for result in results}
    printed = {name: numbers for name in group.rows if name in by_name and (numbers := table.row(name).printed)}
    pairs = []
    for better, worse, gain in printed_pairs(printed, metric.name, metric.better):
        first, second = by_name[better], by_name[worse]
        here = first.less(second, metric.name) if metric.better == "high" else second.less(first, metric.name)
        pairs.append(Pair(group=group.title, metric=metric.name, better=better, worse=worse, printed=gain, gain=here,
                          altered=first.altered or second.altered))
    return pairs


def _beside(mine: Sequence[tuple[ScoreRow, ...]], theirs: Sequence[tuple[ScoreRow, ...]]) \
        -> list[tuple[tuple[ScoreRow, ...], tuple[ScoreRow, ...]]]:
    """Seeds of two rows beside each other; what learns nothing has one for all."""
    count = max(len(mine), len(theirs))
    first, second = ([*scores] if len(scores) == count else [*scores] * count for scores in (mine, theirs))
    return list(zip(first, second, strict=True))


def write_files(table: Table, results: Sequence[RowResult], folder: Path) -> None:
    """Write `table.csv`, a line per row, and `pairs.csv`, one per pair and metric. Raises OutputError."""
    pairs = [pair for order in orders(table, results) for pair in order.pairs]
    write_csv(folder / "table.csv", TABLE_COLUMNS, map(_row_line, results))
    write_csv(folder / "pairs.csv", PAIR_COLUMNS, map(_pair_line, pairs))


def _row_line(result: RowResult) -> list[object]:
    means = {metric.name: result.mean(metric.name) for metric in METRICS}
    cells: list[object] = [result.row.name, result.row.title, result.note, len(result.scores), means["psnr"].examples,
                           means["psnr"].objects, result.row.spec.steps if result.row.spec else "",
                           result.facts.get("parameters", ""), result.facts.get("seconds_per_step", "")]
    for metric in METRICS:
        cells += [means[metric.name].mean, means[metric.name].error, result.spread(metric.name),
                  result.row.printed.of(metric.name) if result.row.printed else "",
                  (corrected := result.mean(metric.name, "corrected")).mean, corrected.error,
                  result.mean(metric.name, "ceiling").mean]
    return cells


def _pair_line(pair: Pair) -> list[object]:
    return [pair.group, pair.metric, pair.better, pair.worse, pair.printed, pair.gain.mean, pair.gain.error,
            pair.gain.half_width, pair.verdict, int(pair.altered)]
