"""Figures of a release gate: light over cells, the best place of the mask, and PSNR against baselines."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from dataset_builder.lightnet.methods.baselines.trivial import TRIVIAL
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.release.cells import Cells
from dataset_builder.release.consistency import Facts
from dataset_builder.release.gate import Done
from dataset_builder.release.outline_checks import SEARCH
from dataset_builder.report.study_figures import COLOURS, PALE, panels, png

MAX_POINTS = 6000
"""Points of a panel."""
MIN_VALUE = 1e-4


def figures(done: Sequence[Done]) -> dict[str, bytes]:
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
