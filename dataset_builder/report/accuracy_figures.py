"""Figures of the accuracy study: for every question error against what it costs, legible at full size."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from dataset_builder.report.page_parts import COLOURS, panels, png
from dataset_builder.studies.accuracy import precision
from dataset_builder.studies.accuracy.bounds import DEPTH, EDGE_LAYER, EDGES, TEXTURES
from dataset_builder.studies.accuracy.curves import Advice, Point, curve
from dataset_builder.studies.accuracy.rows import (
    ADAPTIVE,
    ADAPTIVE_DENOISED,
    DENOISED,
    UNIFORM,
    AccuracyRow,
    layers_in,
    of,
)

STYLES = {UNIFORM: (COLOURS[0], "o"), ADAPTIVE: (COLOURS[1], "s"), DENOISED: (COLOURS[2], "^"),
          ADAPTIVE_DENOISED: (COLOURS[3], "D")}
ERROR, SECONDS = "relative error, sqrt(relMSE)", "seconds per example, of all cores together"


def accuracy_figures(rows: Sequence[AccuracyRow], advice: Advice, bias: float) -> dict[str, bytes]:
    """PNG of every question that has rows, by its name. bias: `render.bias` of the dataset."""
    makers: dict[str, Callable[[], Figure]] = {
        ADAPTIVE: lambda: sampling_figure(rows, (UNIFORM, ADAPTIVE), "Adaptive sampling against uniform spp"),
        DENOISED: lambda: sampling_figure(rows, (UNIFORM, DENOISED, ADAPTIVE_DENOISED), "Denoised"),
        DEPTH: lambda: depth_figure(rows, bias),
        EDGES: lambda: edge_figure(rows, advice),
        TEXTURES: lambda: texture_figure(rows, advice),
        precision.CODECS: lambda: codec_figure(rows),
        precision.ACCUMULATION: lambda: accumulation_figure(rows),
    }
    return {question: png(make()) for question, make in makers.items() if of(rows, question)}


def sampling_figure(rows: Sequence[AccuracyRow], questions: Sequence[str], title: str) -> Figure:
    """Error against seconds of every layer, with the -1/2 slope."""
    layers = layers_in(rows, questions[-1]) or layers_in(rows, questions[0])
    figure, axes = panels(len(layers), f"{title}: error against seconds, geometric mean over examples")
    for layer, one in zip(layers, axes, strict=True):
        for question in questions:
            _curve(one, rows, question, layer, pale=question == UNIFORM)
        _slope(one, curve(rows, UNIFORM, layer))
        dressed(one, layer, SECONDS, ERROR)
    return figure


def _curve(axes: Axes, rows: Sequence[AccuracyRow], question: str, layer: str, *, pale: bool) -> None:
    colour, marker = STYLES[question]
    points = curve(rows, question, layer)
    for example in dict.fromkeys(row.example for row in of(rows, question, layer)):
        own = curve([row for row in rows if row.example == example], question, layer)
        axes.plot([point.seconds for point in own], [point.error for point in own], color=colour, alpha=0.18,
                  linewidth=1)
    axes.plot([point.seconds for point in points], [point.error for point in points], color=colour, marker=marker,
              alpha=0.6 if pale else 1, linewidth=1.8, markersize=5, label=question.replace("-", ", "))
    floored = [point for point in points if point.at_floor]
    axes.plot([point.seconds for point in floored], [point.error for point in floored], linestyle="none",
              marker=marker, markersize=5, markerfacecolor="white", color=colour,
              label="at the reference's noise" if floored else None)
    for point in points:
        axes.annotate(f"{point.value:g}", (point.seconds, point.error), xytext=(4, 5), textcoords="offset points",
                      fontsize=7, color=colour, alpha=0.6 if pale else 1)


def _mark(axes: Axes, point: Point | None) -> None:
    if point:
        axes.plot([point.seconds], [point.error], marker="*", markersize=17, color="black", markerfacecolor="#F0E442",
                  linestyle="none", zorder=5, label=f"recommended: {point.setting}")


def _slope(axes: Axes, points: Sequence[Point]) -> None:
    """Monte Carlo's law, through the middle of a curve."""
    if len(points) < 2:
        return
    middle = points[len(points) // 2]
    seconds = np.array([points[0].seconds, points[-1].seconds])
    axes.plot(seconds, middle.error * (seconds / middle.seconds) ** -0.5, color="black", linestyle=":", linewidth=1.2,
              label="slope -1/2")


def dressed(axes: Axes, title: str, across: str, up: str) -> None:
    """Titles, logarithmic axes, and a legend of what was drawn."""
    axes.set(title=title, xlabel=across, ylabel=up, xscale="log", yscale="log")
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_major_locator(LogLocator(subs=_steps(np.log10(limits[1] / limits[0]))))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.legend(fontsize=8)


def _steps(decades: float) -> tuple[float, ...]:
    """Multiples of powers of ten that get a number, so that there are some and they do not run into each other."""
    if decades > 2.5:
        return (1.0,)
    return (1.0, 2.0, 5.0) if decades > 0.8 else (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)


def depth_figure(rows: Sequence[AccuracyRow], bias: float) -> Figure:
    """Light that short paths miss, and their seconds, of every layer."""
    layers = layers_in(rows, DEPTH)
    figure, axes = panels(len(layers), "Path depth: light missed against seconds; numbers are edges, bars two "
                                       "standard errors")
    for layer, one in zip(layers, axes, strict=True):
        for number, example in enumerate(dict.fromkeys(row.example for row in of(rows, DEPTH, layer))):
            own = [row for row in of(rows, DEPTH, layer) if row.example == example]
            values = np.abs([row.bias for row in own])
            errors = 2 * np.array([row.bias_se for row in own])
            # Logarithmic axes have no zero: bars end at a tenth of their point
            below = np.minimum(errors, 0.9 * values)
            colour = COLOURS[number % len(COLOURS)]
            one.errorbar([row.seconds for row in own], values, yerr=[below, errors], color=colour, marker="o",
                         markersize=4, linewidth=1.4, capsize=2, label=example)
            for row, value in zip(own, values, strict=True):
                one.annotate(f"{row.value:g}", (row.seconds, value), xytext=(4, 4), textcoords="offset points",
                             fontsize=7, color=colour)
        one.axhline(bias, color="black", linestyle="--", linewidth=1, label=f"allowed: {bias:g}")
        dressed(one, layer, SECONDS, "|mean of the difference| / mean")
    return figure


def edge_figure(rows: Sequence[AccuracyRow], advice: Advice) -> Figure:
    """Error of S' against seconds, and triangles against error."""
    figure, (left, right) = panels(2, "Edge length of the rough mesh: S' against the finest, sigma 0")
    points = curve(rows, EDGES, EDGE_LAYER)
    _plain(left, points, [point.seconds for point in points], EDGE_LAYER, COLOURS[0])
    _mark(left, advice.marked.get((EDGES, EDGE_LAYER)))
    dressed(left, "error", "seconds per example, mesh and pass", ERROR)
    for number, example in enumerate(dict.fromkeys(row.example for row in of(rows, EDGES))):
        own = [row for row in of(rows, EDGES) if row.example == example and np.isfinite(row.triangles)]
        right.plot([row.value for row in own], [row.triangles for row in own], marker="o", markersize=4,
                   color=COLOURS[number % len(COLOURS)], label=example)
    dressed(right, "triangles", "edge length, metres", "triangles of the object")
    return figure


def _plain(axes: Axes, points: Sequence[Point], across: Sequence[float], label: str, colour: str) -> None:
    axes.plot(across, [point.error for point in points], marker="o", color=colour, label=label)
    floored = [(x, point.error) for x, point in zip(across, points, strict=True) if point.at_floor]
    if floored:
        axes.plot(*zip(*floored, strict=True), linestyle="none", marker="o", markerfacecolor="white", color=colour,
                  label="within the noise of both")
    for x, point in zip(across, points, strict=True):
        axes.annotate(point.setting, (x, point.error), xytext=(5, 5), textcoords="offset points", fontsize=7)


def texture_figure(rows: Sequence[AccuracyRow], advice: Advice) -> Figure:
    """Error against texels, and what it does to the time."""
    figure, (left, right) = panels(2, "Texture size: error against the dataset's own")
    for number, layer in enumerate(layers_in(rows, TEXTURES)):
        points = [point for point in curve(rows, TEXTURES, layer) if point.error > 0]
        errors = [point.error for point in points]
        left.plot([point.value for point in points], errors, marker="o", color=COLOURS[number], label=layer)
        right.plot([point.seconds for point in points], errors, marker="o", color=COLOURS[number], label=layer)
        if best := advice.marked.get((TEXTURES, layer)):
            left.plot([best.value], [best.error], marker="*", markersize=17, color="black", markerfacecolor="#F0E442",
                      linestyle="none", label=f"recommended for {layer}: {best.value:.0f}")
    dressed(left, "error", "texels per side", ERROR)
    dressed(right, "error against seconds", SECONDS, ERROR)
    return figure


def codec_figure(rows: Sequence[AccuracyRow]) -> Figure:
    """Bytes against time of every codec and type, and what half loses."""
    figure, (left, right) = panels(2, "Storage: lossless codecs of OpenEXR, and half against float")
    for number, dtype in enumerate(("float32", "float16")):
        own = {name: mean for name, mean in precision.codec_means(rows).items() if name.startswith(dtype)}
        for place, (across, marker) in enumerate((("encode_seconds", "o"), ("decode_seconds", "^"))):
            left.plot([1e3 * mean[across] for mean in own.values()], [mean["bytes"] / 1e3 for mean in own.values()],
                      linestyle="none", marker=marker, color=COLOURS[number],
                      label=f"{dtype}, {across.split('_')[0]}")
            for name, mean in own.items() if not place else ():
                left.annotate(name.split()[1], (1e3 * mean[across], mean["bytes"] / 1e3), xytext=(5, 4),
                              textcoords="offset points", fontsize=7)
    dressed(left, "bytes against time", "milliseconds per example", "kB per example")
    errors = precision.half_errors(rows)
    right.barh(list(errors), [1e4 * error for error in errors.values()], color=COLOURS[1])
    right.set(title="error of half", xlabel=f"1e-4 {ERROR}, worst example")
    right.invert_yaxis()
    return figure


def accumulation_figure(rows: Sequence[AccuracyRow]) -> Figure:
    """Drift of both kinds of sum, and the noise of the mean, against the number of samples."""
    figure, (axes,) = panels(1, "Sums of real samples")
    kinds = ((precision.RUNNING, "-"), (precision.BATCHED, "-"), (precision.NOISE, ":"))
    for number, (name, style) in enumerate(kinds):
        found = precision.drift_means(rows, name)
        axes.plot(list(found), list(found.values()), marker="o", linestyle=style, color=COLOURS[number], label=name)
    dressed(axes, "", "samples", "relative difference from float64")
    return figure
