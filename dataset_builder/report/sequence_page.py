"""How steady methods are over the views of sequences, as files: tables, a page, and figures over the frames."""

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from statistics import fmean

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.sequences import TRUTH
from dataset_builder.lightnet.results.spreads import FLICKERS, SequenceScores, Spread, Steadiness
from dataset_builder.report.page_parts import COLOURS, heading, markdown_table, panels, png, rounded
from dataset_builder.studies.comma_separated import comma_separated

SEQUENCES, NEIGHBOURS, PAGE, FIGURE = "sequences.csv", "flicker.csv", "sequences.md", "sequences.png"
NAMES = (*(metric.name for metric in METRICS), *FLICKERS)
COLUMNS = ("method", "sequence", "views", "neighbours",
           *(f"{name}{end}" for name in NAMES for end in ("", "_sd", "_sd_within")), "overlap")
PAIR_COLUMNS = ("method", "sequence", "frame", "key", "flicker", "error_flicker", "overlap")
MEANING = """± is the standard deviation over the views of all sequences, or over all neighbours, and no standard error.
*Flicker*: mean absolute difference of two neighbouring pictures, in display values at one exposure for a whole
sequence, over the pixels whose surface both views see, the later picture warped into the earlier view by depth. Light
on a surface changes with the view, so that the truth flickers, too. *Flicker of the error*: the same of prediction less
truth, 0 for what changes as the truth does."""
WITHIN = "In brackets: the deviation within a sequence."


def write_sequence_page(report: SequenceScores, out: Path) -> list[Path]:
    """Write both tables, the page and its figure into a folder; their paths. Raises OutputError."""
    files = {SEQUENCES: sequence_table(report), NEIGHBOURS: comma_separated(PAIR_COLUMNS, (
        [getattr(row, name) for name in PAIR_COLUMNS] for row in report.flickers), digits=7),
        FIGURE: png(sequence_figure(report)), PAGE: markdown(report).encode()}
    for name, content in files.items():
        write_atomic(out / name, content)
    return [out / name for name in files]


def sequence_table(report: SequenceScores) -> bytes:
    """A line per method and sequence; those of all sequences together have an empty name."""
    return comma_separated(COLUMNS, map(_line, report.rows), digits=7)


def _line(row: Steadiness) -> list[object]:
    spreads = _spreads(row)
    views = row.metrics["psnr"].count if row.metrics else 0
    cells: list[object] = [row.method, row.sequence, views, row.flickers["flicker"].count]
    for name in NAMES:
        found = spreads.get(name)
        cells += [found.mean, found.deviation, found.within] if found else [""] * 3
    return [*cells, row.overlap]


def _spreads(row: Steadiness) -> Mapping[str, Spread]:
    return {**row.metrics, **row.flickers}


def markdown(report: SequenceScores) -> str:
    """Methods as columns, figures as rows, and what the words mean; then every sequence."""
    parts = [f"# Sequences of {report.dataset}, split {report.split}", f"{report.extent}.", figures_table(report.whole),
             " ".join([*MEANING.split(), WITHIN])]
    if len(report.sequences) > 1:
        parts += ["## By sequence", markdown_table(
            ("sequence", "method", *(metric.symbol for metric in METRICS), *FLICKERS.values()),
            [[row.sequence, row.method, *(_text(name, _spreads(row).get(name)) for name in NAMES)]
             for row in sorted(report.rows, key=lambda row: row.sequence) if row.sequence])]
    return "\n\n".join(parts) + "\n"


def figures_table(rows: Sequence[Steadiness]) -> str:
    """The lines of a table: methods as columns."""
    titles = {**{metric.name: heading(metric) for metric in METRICS},
              **{name: f"{title} (low is steady)" for name, title in FLICKERS.items()}}
    body = [[title, *(_text(name, _spreads(row).get(name), within=True) for row in rows)]
            for name, title in titles.items()]
    return markdown_table(("figure", *(row.method for row in rows)), body)


def _text(name: str, found: Spread | None, *, within: bool = False) -> str:
    if found is None or not found.count:
        return ""
    text = spread_text(found, name)
    return f"{text} ({rounded(found.within, name)})" if within and isfinite(found.within) else text


def spread_text(found: Spread, name: str) -> str:
    """Mean and standard deviation, which one value does not have."""
    return rounded(found.mean, name) + (f" ± {rounded(found.deviation, name)}" if isfinite(found.deviation) else "")


def steadiness_lines(report: SequenceScores) -> list[str]:
    """What the terminal shows: how much was looked at, and a line per method."""
    symbols = {metric.name: metric.symbol for metric in METRICS} | dict(FLICKERS)
    return [f"{report.extent}; mean ± standard deviation over views:"] + [
            f"{row.method}: " + ", ".join(f"{symbols[name]} {spread_text(found, name)}"
                                          for name, found in _spreads(row).items() if found.count)
            for row in report.whole]


def sequence_figure(report: SequenceScores) -> Figure:
    """PSNR, flicker and flicker of the error over the frames, each the mean of the sequences that have it."""
    figure, axes = panels(3, f"{report.dataset}, split {report.split}: {report.extent}")
    frames = {report.keys[index]: frame for one in report.sequences
              for index, frame in zip(one.indices, one.frames, strict=True)}
    names = [row.method for row in report.whole]
    for place, name in enumerate(names):
        style = {"color": "#404040", "linestyle": "--"} if name == TRUTH else {"color": COLOURS[place % len(COLOURS)]}
        scores = [(frames[row.key], row.metrics.psnr) for row in report.scores if row.method == name]
        _curve(axes[0], scores, name, style)
        own = [row for row in report.flickers if row.method == name]
        for one, figured in zip(axes[1:], FLICKERS, strict=True):
            _curve(one, [(row.frame, getattr(row, figured)) for row in own], name, style)
    axes[0].set(title="PSNR: high is better", xlabel="view", ylabel="dB")
    axes[1].set(title="flicker", xlabel="view", ylim=(0, None))
    axes[2].set(title="flicker of the error: low is steady", xlabel="view", ylim=(0, None))
    axes[1].legend(fontsize=8)
    return figure


def _curve(axes: Axes, points: Sequence[tuple[int, float]], name: str, style: Mapping[str, str]) -> None:
    by_frame: dict[int, list[float]] = {}
    for frame, value in points:
        by_frame.setdefault(frame, []).append(value)
    if by_frame:
        places = sorted(by_frame)
        axes.plot(places, [fmean(by_frame[frame]) for frame in places], label=name, linewidth=1.4,
                  color=style["color"], linestyle=style.get("linestyle", "-"))
