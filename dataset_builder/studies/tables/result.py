"""The result of a row: means over examples and seeds, how it compares with the published numbers, and both as CSV."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, nan, sqrt
from pathlib import Path
from statistics import fmean, stdev
from typing import Any

from dataset_builder.lightnet.measures.metrics import METRICS, Metric
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate, reach
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.tables.paper import Group, Table, TableRow
from dataset_builder.studies.tables.rank_order import Order, Pair, printed_pairs
from dataset_builder.studies.tables.table_kinds import NO_WEIGHTS

TABLE_COLUMNS = ("row", "title", "note", "seeds", "examples", "objects", "steps", "parameters", "seconds_per_step",
                 *(f"{metric.name}{end}" for metric in METRICS for end in ("", "_error", "_sd_over_seeds", "_paper")))
PAIR_COLUMNS = ("group", "metric", "better_in_paper", "worse_in_paper", "printed_gain", "gain", "gain_error",
                "half_width", "verdict", "altered")


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

    def mean(self, metric: str) -> ClusteredMean:
        """Mean of a metric, with its error."""
        return over_seeds([values(rows, metric) for rows in self.scores], objects(self.scores[0]))

    def spread(self, metric: str) -> float:
        """Standard deviation of the mean over seeds; NaN for one seed."""
        means = [fmean(values(rows, metric)) for rows in self.scores]
        return stdev(means) if len(means) > 1 else nan

    def less(self, other: "RowResult", metric: str) -> ClusteredMean:
        """Mean of a metric less the other's, example by example and seed by seed."""
        return over_seeds([[one - two for one, two in zip(values(mine, metric), values(theirs, metric), strict=True)]
                           for mine, theirs in _beside(self.scores, other.scores)], objects(self.scores[0]))


def values(rows: Sequence[ScoreRow], metric: str) -> list[float]:
    """A metric of every row."""
    return [getattr(row.metrics, metric) for row in rows]


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
                  result.row.printed.of(metric.name) if result.row.printed else ""]
    return cells


def _pair_line(pair: Pair) -> list[object]:
    return [pair.group, pair.metric, pair.better, pair.worse, pair.printed, pair.gain.mean, pair.gain.error,
            pair.gain.half_width, pair.verdict, int(pair.altered)]
