"""A release gate for people and programs: lines of the terminal, figures, and its checks as JSON and Markdown."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.methods.method import TRIVIAL
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.release.cells import Cells
from dataset_builder.release.consistency import Facts
from dataset_builder.release.dataset_check import Check
from dataset_builder.release.gate import Begun, Done, Gate, LeftOut, News
from dataset_builder.release.shape_checks import SEARCH
from dataset_builder.report.page_parts import COLOURS, PALE, markdown_table, panels, png
from dataset_builder.report.training_lines import lines_of

JSON, MARKDOWN, FIGURES = "report.json", "report.md", "figures"
CAPTIONS = {
    "light": "Every point is a cell of an object. Left: the light that reaches it and is diffusely reflected, D S', "
             "against I_t. Right: D + R against I_s. Points of a sound dataset lie along the line; a gamma changes "
             "the slope, S' of another example widens the cloud.",
    "mask": "Steepness of I_s under the outline of the mask when the mask is shifted: brightest where most edges are. "
            "The brightest point should be in the middle.",
    "training": "PSNR on the held-out split, example by example: LighTNet against each baseline; above the line it is "
                "better.",
}
MARKS = {"yes": "yes", "no": "NO ", "not judged": " - "}
NAME = 20
"""Columns of a check's name."""
MAX_POINTS = 6000
"""Points of a panel."""
MIN_VALUE = 1e-4


@dataclass(frozen=True, kw_only=True)
class Report:
    """What happened."""

    dataset: str
    gate: Gate
    done: tuple[Done, ...]
    left_out: tuple[str, ...] = ()
    """Parts that were asked for and not run."""

    @property
    def holds(self) -> bool:
        """Whether every check of every part that ran holds."""
        return all(done.holds for done in self.done)

    @property
    def refused(self) -> list[Check]:
        """Checks that failed, in the order they were made."""
        return [check for done in self.done for check in done.found.checks if not check.holds]

    @property
    def verdict(self) -> str:
        """One sentence."""
        ran, seconds = ", ".join(done.part for done in self.done), sum(done.seconds for done in self.done)
        unjudged = sum(not check.judged for done in self.done for check in done.found.checks)
        count = sum(len(done.found.checks) for done in self.done)
        tail = f"{ran}: {count - unjudged} checks judged, {unjudged} not judged, in {seconds:.0f} s"
        return f"passed: {tail}" if self.holds else f"FAILED: {', '.join(check.name for check in self.refused)}; {tail}"


def refusals(report: Report) -> list[str]:
    """A sentence for every check that failed: rule, value, bounds, where the bounds come from."""
    return [f"failed: {check.name}: {check.rule.statement}: expected {check.rule.bounds}, got {_value(check)} "
            f"({check.rule.why})" + (f": {check.detail}" if check.detail else "") for check in report.refused]


def write_report(report: Report) -> None:
    """Write `report.json`, `report.md` and figures of what ran into the gate's folder. Raises OutputError."""
    out = report.gate.out
    made = gate_figures(report.done)
    for name, data in made.items():
        write_atomic(out / FIGURES / f"{name}.png", data)
    write_atomic(out / JSON, (json.dumps(as_data(report), indent=2, allow_nan=False) + "\n").encode())
    write_atomic(out / MARKDOWN, markdown(report, list(made)).encode())


def as_data(report: Report) -> dict[str, Any]:
    """Plain data; a value that is not judged or no number is null, and `verdict` says which."""
    return {
        "dataset": report.dataset, "holds": report.holds, "verdict": report.verdict,
        "not_run": list(report.left_out), "training": report.gate.spec.model_dump(mode="json"),
        "parts": [{"part": done.part, "holds": done.holds, "seconds": round(done.seconds, 2),
                   "problems": list(done.found.problems), "checks": [_check_data(check) for check in done.found.checks]}
                  for done in report.done],
    }


def markdown(report: Report, made: list[str]) -> str:
    """The page."""
    parts = [f"# Release gate of {Path(report.dataset).name}", f"**{report.verdict}.**",
             *([f"Not run, because an earlier part failed: {', '.join(report.left_out)}."] * bool(report.left_out)),
             *(f"- {line}" for line in refusals(report))]
    for done in report.done:
        parts += [f"## {done.part}, {done.seconds:.1f} s", _table(done)]
        if done.found.problems:
            parts.append("\n".join(f"- {problem}" for problem in done.found.problems))
    for name in made:
        parts += [f"![{name}]({FIGURES}/{name}.png)", CAPTIONS[name]]
    return "\n\n".join(parts) + "\n"


def _table(done: Done) -> str:
    rows = [(check.name, check.rule.statement, _value(check), check.rule.bounds, check.verdict, check.rule.why,
             check.detail) for check in done.found.checks]
    head = ("check", "what", "value", "bounds", "holds", "why these bounds", "more")
    return markdown_table(head, rows)


def _value(check: Check) -> str:
    """Whole numbers whole, others with three significant digits."""
    if check.value is None:
        return "not judged"
    return f"{check.value:.0f}" if check.value.is_integer() else f"{check.value:.3g}"


def _check_data(check: Check) -> dict[str, Any]:
    low, high, value = (None if number is None or not isfinite(number) else number
                        for number in (check.rule.low, check.rule.high, check.value))
    return {"name": check.name, "rule": check.rule.statement, "value": value, "low": low, "high": high,
            "verdict": check.verdict, "why": check.rule.why, "detail": check.detail}


def lines(news: News) -> list[str]:
    """Lines that stay."""
    if isinstance(news, Begun):
        return [f"{news.part}:"]
    if isinstance(news, Done):
        checks = [check_line(check) for check in news.found.checks]
        return [*checks, f"  {news.part} took {news.seconds:.1f} s"]
    if isinstance(news, LeftOut):
        return [f"not run, because an earlier part failed: {', '.join(news.parts)} (use --all to run every part)"]
    return [f"  {line}" for line in lines_of(news)]


def check_line(check: Check) -> str:
    """Verdict, name, value, bounds, and what helps."""
    detail = f"  {check.detail}" if check.detail else ""
    return f"  {MARKS[check.verdict]} {check.name:<{NAME}} {_value(check):>10}  ({check.rule.bounds}){detail}"


def gate_figures(done: Sequence[Done]) -> dict[str, bytes]:
    """PNG by name, of every part that has something to show."""
    made = dict[str, bytes]()
    for one in done:
        if facts := one.found.facts:
            made |= {"light": png(light_figure(facts)), "mask": png(mask_figure(facts))}
        if rows := one.found.rows:
            made["training"] = png(training_figure(rows))
    return made


def light_figure(facts: Sequence[Facts]) -> Figure:
    """Cells of all objects: D S' against I_t, and D + R against I_s, luminance as the mean of channels."""
    figure, (left, right) = panels(2, "Light over cells of the objects")
    for axes, title, across, up, kind in (
            (left, "target light", "D S'", "I_t", "target"), (right, "source light", "D + R", "I_s", "source")):
        points = [_points(one.cells, kind) for one in facts if len(one.cells)]
        if points:
            x, y, diffuse = np.concatenate(points, axis=1)
            _cloud(axes, x, y, diffuse > 0)
        axes.set(title=title, xlabel=across, ylabel=up)
    left.legend(fontsize=8)
    return figure


def mask_figure(facts: Sequence[Facts]) -> Figure:
    """Mean steepness of I_s under shifted outlines."""
    figure, (axes,) = panels(1, "Where the mask's outline meets edges")
    scores = np.mean([one.outline.edges for one in facts], axis=0)
    shown = axes.imshow(scores, extent=(-SEARCH - 0.5, SEARCH + 0.5, SEARCH + 0.5, -SEARCH - 0.5), cmap="cividis")
    axes.grid(visible=False)
    row, column = np.unravel_index(scores.argmax(), scores.shape)
    axes.plot([column - SEARCH], [row - SEARCH], marker="+", markersize=14, color=COLOURS[1], linestyle="none")
    axes.set(xlabel="shift of the mask, columns", ylabel="rows", title="mean over examples, in units of the frame's")
    figure.colorbar(shown, ax=axes)
    return figure


def training_figure(rows: Sequence[ScoreRow]) -> Figure:
    """A panel per rival: PSNR of the trained method over that of the rival."""
    rivals = [name for name in TRIVIAL if any(row.method == name for row in rows)]
    method = next(row.method for row in rows if row.method not in TRIVIAL)
    psnr = {(row.method, row.key): row.metrics.psnr for row in rows}
    keys = list(dict.fromkeys(row.key for row in rows))
    figure, axes = panels(len(rivals), f"PSNR on {len(keys)} held-out examples, dB")
    for name, one in zip(rivals, axes, strict=True):
        x, y = (np.array([psnr[which, key] for key in keys]) for which in (name, method))
        one.scatter(x, y, s=14, color=COLOURS[0])
        _diagonal(one, float(min(x.min(), y.min())), float(max(x.max(), y.max())))
        one.set(title=f"ahead by {np.mean(y - x):+.2f} dB, in {np.sum(y > x)} of {len(keys)}", xlabel=name,
                ylabel=method)
    return figure


def _points(cells: Cells, kind: str) -> np.ndarray:
    """(3, C) across, up, and whether the cell is diffuse."""
    across, up = (cells.d_s, cells.i_t) if kind == "target" else (cells.d + cells.r, cells.i_s)
    return np.stack([across.mean(axis=1), up.mean(axis=1), cells.is_diffuse])


def _cloud(axes: Axes, x: np.ndarray, y: np.ndarray, diffuse: np.ndarray) -> None:
    step = -(-len(x) // MAX_POINTS)
    x, y, diffuse = (np.maximum(values[::step], MIN_VALUE) if values.dtype != bool else values[::step]
                     for values in (x, y, diffuse))
    for where, colour, label in ((~diffuse, PALE, "mostly specular"), (diffuse, COLOURS[0], "diffuse")):
        axes.scatter(x[where], y[where], s=4, color=colour, label=label, linewidths=0)
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    _diagonal(axes, float(min(x.min(), y.min())), float(max(x.max(), y.max())))


def _diagonal(axes: Axes, low: float, high: float) -> None:
    axes.plot([low, high], [low, high], color="black", linewidth=1, zorder=3)
