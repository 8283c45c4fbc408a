"""What pages share: the page of a study, panels of figures, estimates in words, Markdown tables."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.files import write_atomic
from dataset_builder.report.front.fill_page import fill

if TYPE_CHECKING:
    from dataset_builder.lightnet.measures.metrics import Metric
    from dataset_builder.lightnet.results.clustered_means import ClusteredMean

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
"""Okabe and Ito's, told apart by colour-blind readers, too."""

STYLES = ("styles/page.css", "styles/study.css")
PALE, DPI, PANEL = "#b8b8b8", 110, (5.2, 4.6)
DIGITS = {"psnr": 2}
"""After the point by metric, `OTHERWISE` where not stated."""
OTHERWISE = 4


@dataclass(frozen=True, kw_only=True)
class Section:
    """One question."""

    question: str
    answer: str
    figure: bytes = b""
    """Bytes of a PNG, or none."""
    head: Sequence[str] = ()
    """Of a table, or none."""
    rows: Sequence[Sequence[str]] = ()


def write_study(folder: Path, title: str, lead: Sequence[str], sections: Sequence[Section], *,
                figures: Mapping[str, bytes], settings: str = "") -> None:
    """Write `report.html` into a study's folder, and the PNG `figures` by name, also beside it. Raises OutputError."""
    for name, figure in figures.items():
        write_atomic(folder / "figures" / f"{name}.png", figure)
    write_atomic(folder / "report.html", page(title, lead, sections, settings).encode())


def page(title: str, lead: Sequence[str], sections: Sequence[Section], settings: str = "") -> str:
    """The page of `report.front`. lead: paragraphs on top; settings: lines to be copied, at the end."""
    shown = [{"question": section.question, "answer": section.answer, "figure": b64encode(section.figure).decode(),
              "head": section.head, "rows": section.rows} for section in sections]
    return fill("study.html", styles=STYLES, title=title, lead=lead, sections=shown, settings=settings)


def rounded(value: float, metric: str, sign: str = "") -> str:
    """A value of a metric. sign: "+" to show it where it is above 0, too."""
    return f"{value:{sign}.{DIGITS.get(metric, OTHERWISE)}f}"


def plus_minus(found: "ClusteredMean", metric: str, sign: str = "") -> str:
    """A mean and its standard error, which one object does not have."""
    error = f" ± {rounded(found.error, metric)}" if isfinite(found.error) else ""
    return rounded(found.mean, metric, sign) + error


def heading(metric: "Metric") -> str:
    """Symbol and unit of a metric, and which way is better."""
    return f"{metric.symbol}{f', {metric.unit}' if metric.unit else ''} ({metric.better} is better)"


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """The lines of a table."""
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
                     for cells in (head, ["---"] * len(head), *rows))


def png(figure: Figure) -> bytes:
    """The figure as the bytes of a PNG file."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=DPI)
    return stream.getvalue()


def panels(count: int, title: str) -> tuple[Figure, list[Axes]]:
    """A figure of `count` panels side by side."""
    figure = Figure(figsize=(PANEL[0] * count, PANEL[1]), layout="constrained")
    figure.suptitle(title)
    axes = np.atleast_1d(figure.subplots(1, count, squeeze=False)[0])
    for one in axes:
        one.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.8)
        one.set_axisbelow(True)
        one.spines[["top", "right"]].set_visible(False)
    return figure, list(axes)
