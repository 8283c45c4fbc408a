"""A table of the paper as files for programs: `table.csv`, a line per row, and `pairs.csv`, one per pair and metric."""

from collections.abc import Sequence
from pathlib import Path

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.tables.rank_order import Pair
from dataset_builder.studies.tables.result import RowResult, orders
from dataset_builder.studies.tables.row import Table

TABLE_COLUMNS = ("row", "title", "note", "seeds", "examples", "objects", "steps", "parameters", "seconds_per_step",
                 *(f"{metric.name}{end}" for metric in METRICS for end in ("", "_error", "_sd_over_seeds", "_paper")))
PAIR_COLUMNS = ("group", "metric", "better_in_paper", "worse_in_paper", "printed_gain", "gain", "gain_error",
                "half_width", "verdict", "altered")


def write_files(table: Table, results: Sequence[RowResult], folder: Path) -> None:
    """Write both. Raises OutputError."""
    pairs = [pair for order in orders(table, results) for pair in order.pairs]
    write_atomic(folder / "table.csv", comma_separated(TABLE_COLUMNS, map(_line, results)))
    write_atomic(folder / "pairs.csv", comma_separated(PAIR_COLUMNS, map(_pair_line, pairs)))


def _line(result: RowResult) -> list[object]:
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
