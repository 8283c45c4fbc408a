"""An evaluation as files: tables by example (CSV) and by method (Markdown), a figure, and examples in pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import whole_images
from dataset_builder.lightnet.measures.metrics import METRICS, Metric
from dataset_builder.lightnet.results.clustered_means import (
    LEVEL,
    ONE_OBJECT,
    Paired,
    Summary,
    chosen,
    compare,
    summarise,
)
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow
from dataset_builder.lightnet.results.pictures import cropped, found, given
from dataset_builder.report.example_sheet import SheetRow
from dataset_builder.report.noise_lines import CEILING, NOISE, beside, unknown, with_interval
from dataset_builder.report.page_parts import COLOURS, PALE, heading, markdown_table, panels, plus_minus, png, rounded
from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.trainings import PARTS

TABLE, SUMMARY, FIGURE, EXAMPLES = "table.csv", "summary.md", "summary.png", "examples.png"
DESCRIBED = ("method", "key", "view", "object", "room", "level", "sigma", "rough")
COLUMNS = (*DESCRIBED, *(metric.name for metric in METRICS), "seconds",
           *(metric.name + end for end in PARTS.values() if end for metric in METRICS))
PAIR_COLUMNS = ("methods", "metric", "difference", "if independent", f"{LEVEL:.0%} interval", "better in", "verdict")
SEEN = "**A method was trained on this split.** Its figures do not measure generalisation."
VERDICTS = {"better": "better", "worse": "worse", "open": "not told apart"}


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What was evaluated."""

    dataset: str
    split: str
    rows: Sequence[ScoreRow]
    notes: Mapping[str, str]
    """What each method is, by name."""
    trained: Sequence[str]
    """Names of the methods of checkpoints."""
    remarks: Sequence[str] = ()
    """What is to be known of the examples."""
    seen: bool = False
    """Whether this is the split that one of the methods was trained on."""
    noise_unknown: str = ""
    """Why nobody knows the noise of the truth; empty where it is known."""

    @property
    def said(self) -> list[str]:
        """What is to be known of the examples, and of figures where they show one object."""
        return [*self.remarks, *[ONE_OBJECT] * (len({row.object for row in self.rows}) == 1)]

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """What is compared: each trained method with the trained ones after it and with all that learn nothing."""
        rivals = [*self.trained, *(name for name in self.notes if name not in self.trained)]
        return [(name, other) for number, name in enumerate(self.trained) for other in rivals[number + 1:]]

    def compared(self) -> list[Paired]:
        """All comparisons, in every metric."""
        return [one for name, other in self.pairs for one in compare(self.rows, name, other)]

    @property
    def extent(self) -> str:
        """How much was looked at."""
        counts = [len({getattr(row, name) for row in self.rows}) for name in ("key", "view", "object", "room")]
        kinds = zip(counts, ("example", "view", "object", "room"), strict=True)
        return ", ".join(f"{count} {kind}{'s' if count != 1 else ''}" for count, kind in kinds)


def write_page(evaluation: Evaluation, out: Path) -> None:
    """Write the table, the summary and its figure into a folder. Raises OutputError."""
    write_atomic(out / TABLE, csv_table(evaluation.rows))
    write_atomic(out / FIGURE, png(summary_figure(evaluation)))
    write_atomic(out / SUMMARY, markdown(evaluation).encode())


def csv_table(rows: Sequence[ScoreRow]) -> bytes:
    """One line per example and method."""
    return comma_separated(COLUMNS, ([*(getattr(row, name) for name in DESCRIBED),
                                      *(getattr(row.metrics, metric.name) for metric in METRICS), row.seconds,
                                      *(getattr(getattr(row, part), metric.name) for part, end in PARTS.items() if end
                                        for metric in METRICS)] for row in rows), digits=7)


def markdown(evaluation: Evaluation) -> str:
    """The summary: methods as columns, comparisons as rows, and what the words mean."""
    summaries = summarise(evaluation.rows)
    parts = [f"# Evaluation on {evaluation.dataset}, split {evaluation.split}", f"{evaluation.extent}.",
             *(f"{remark[:1].upper()}{remark[1:]}." for remark in evaluation.said), *([SEEN] * evaluation.seen),
             markdown_table(("metric", *(one.method for one in summaries)), _mean_rows(summaries)), _meaning(),
             "## Noise of the truth", *_noise_parts(evaluation, summaries),
             "## Differences, example by example",
             markdown_table(PAIR_COLUMNS, [_pair_row(one) for one in evaluation.compared()]),
             "## Methods", "\n".join(f"- {name}: {note}" for name, note in evaluation.notes.items()),
             "## Metrics", "Over the object, on tone-mapped values: x / (1 + x) of exposed light, then the sRGB curve.",
             "\n".join(f"- {metric.symbol}: {metric.definition}." for metric in METRICS)]
    return "\n\n".join(parts) + "\n"


def console_table(evaluation: Evaluation) -> Table:
    """What the terminal shows: methods as rows."""
    table = Table("method", *(f"{metric.symbol} ({metric.better} is better)" for metric in METRICS), "seconds",
                  title=f"{evaluation.dataset}, split {evaluation.split}: {evaluation.extent}", title_justify="left")
    summaries = summarise(evaluation.rows)
    for one in summaries:
        figures = [beside(one.metrics[metric.name], one.corrected[metric.name], metric.name) for metric in METRICS]
        table.add_row(one.method, *figures, f"{one.seconds:.3g}")
    if summaries[0].noise_known:
        table.add_row(CEILING, *(plus_minus(summaries[0].ceiling[metric.name], metric.name) for metric in METRICS))
    return table


def verdict_lines(evaluation: Evaluation) -> list[str]:
    """What is to be known of the examples, and one sentence for each comparison, by PSNR."""
    remarks = [*evaluation.said, *([SEEN.replace("*", "")] * evaluation.seen),
               *([unknown(evaluation.noise_unknown)] if evaluation.noise_unknown else [])]
    compared = [one for one in evaluation.compared() if one.metric == "psnr"]
    return [*remarks, *(f"{one.method} against {one.other}: {plus_minus(one.difference, 'psnr', '+')} dB, "
                        f"{VERDICTS[one.verdict]}; better in {one.ahead} of {one.difference.examples}"
                        for one in compared)]


def summary_figure(evaluation: Evaluation) -> Figure:
    """A panel per metric: every example as a pale dot, means with their standard errors."""
    figure, axes = panels(len(METRICS), f"{evaluation.dataset}, split {evaluation.split}: {evaluation.extent}")
    summaries = summarise(evaluation.rows)
    for metric, one in zip(METRICS, axes, strict=True):
        for place, summary in enumerate(summaries):
            _dots(one, evaluation.rows, summary, metric, place, COLOURS[0] if summary.method in evaluation.trained
                  else COLOURS[1])
        if summaries[0].noise_known:
            one.axvline(summaries[0].ceiling[metric.name].mean, color=COLOURS[2], linestyle="--", linewidth=1.2)
        unit = f"{metric.symbol}, {metric.unit}" if metric.unit else metric.symbol
        one.set(title=f"{metric.symbol}: {metric.better} is better", xlabel=unit, yticks=range(len(summaries)))
        one.set_yticklabels([summary.method for summary in summaries] if one is axes[0] else [])
        one.set_ylim(len(summaries) - 0.4, -0.6)
        one.margins(x=0.12)
    figure.supxlabel("dots: examples; bars: one standard error of the mean, clustered by object"
                     + "; dashed: a perfect prediction, diamonds: without noise" * summaries[0].noise_known, fontsize=9)
    return figure


def _dots(axes: Axes, rows: Sequence[ScoreRow], summary: Summary, metric: Metric, place: int, colour: str) -> None:
    own = [getattr(row.metrics, metric.name) for row in rows if row.method == summary.method]
    spread = 0.5 * (np.arange(len(own)) / max(len(own) - 1, 1) - 0.5)
    axes.plot(own, place + spread, linestyle="none", marker=".", markersize=4, color=PALE, zorder=1)
    found = summary.metrics[metric.name]
    axes.errorbar([found.mean], [place], xerr=[found.error] if isfinite(found.error) else None, marker="o",
                  markersize=6, color=colour, capsize=4, linewidth=1.8, zorder=3)
    axes.plot([summary.corrected[metric.name].mean], [place], marker="D", markersize=6, markerfacecolor="none",
              color=COLOURS[2], zorder=4)
    axes.annotate(plus_minus(found, metric.name), (found.mean, place), xytext=(0, 11), textcoords="offset points",
                  ha="center", fontsize=8, color=colour, zorder=4,
                  bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.85})


def _mean_rows(summaries: Sequence[Summary]) -> list[list[str]]:
    rows = [[heading(metric), *(plus_minus(one.metrics[metric.name], metric.name) for one in summaries)]
            for metric in METRICS]
    return [*rows, ["seconds per image, median", *(f"{one.seconds:.3g}" for one in summaries)]]


def _noise_parts(evaluation: Evaluation, summaries: Sequence[Summary]) -> list[str]:
    if not summaries[0].noise_known:
        return [unknown(evaluation.noise_unknown or "nobody says it")]
    head = ("metric", CEILING, *(f"{one.method} without noise" for one in summaries))
    rows = [[heading(metric), plus_minus(summaries[0].ceiling[metric.name], metric.name),
             *(with_interval(one.corrected[metric.name], metric.name) for one in summaries)] for metric in METRICS]
    return [" ".join(NOISE.split()), markdown_table(head, rows)]


def _pair_row(one: Paired) -> list[str]:
    metric = next(metric for metric in METRICS if metric.name == one.metric)
    found = one.difference
    low, high = (rounded(found.mean + sign * found.half_width, one.metric, "+") for sign in (-1, 1))
    interval = f"{low} to {high}" if isfinite(found.half_width) else "one object: none"
    naive = f"± {rounded(found.naive, one.metric)}" if isfinite(found.naive) else ""
    return [f"{one.method} - {one.other}", metric.symbol, plus_minus(found, one.metric, "+"), naive, interval,
            f"{one.ahead} of {found.examples}", VERDICTS[one.verdict]]


def _meaning() -> str:
    return ("± is one standard error of the mean, clustered by object: examples of one object are not independent. "
            f"Intervals cover the mean over all such objects in {LEVEL:.0%} of all cases (Student's t); a method is "
            "told apart from another where the interval of their difference, taken on the same examples, does not "
            "contain 0. `table.csv` has every example.")


def example_rows(rows: Sequence[ScoreRow], contenders: Sequence[Contender], dataset: LightingDataset) -> list[SheetRow]:
    """A row of pictures for each chosen example and contender; the predictions are made again."""
    measured = {(row.method, row.key): row for row in rows}
    sheet = []
    for place, row in chosen(rows, contenders[0].name).items():
        for batch in whole_images(dataset, [dataset.keys.index(row.key)]):
            for one in contenders:
                moved = batch.to(one.device)
                shown = {**given(moved), **found(moved, one.find(moved))}
                sheet.append(SheetRow(lines=_example_lines(place, measured[one.name, row.key]),
                                      panels=cropped(shown, moved.inputs.inside[0])))
    return sheet


def _example_lines(place: str, row: ScoreRow) -> list[str]:
    figures = [f"{metric.symbol} {rounded(getattr(row.metrics, metric.name), metric.name)} {metric.unit}"
               for metric in METRICS]
    return [f"{place}: {row.key}", row.method, row.object, row.room, *figures]
