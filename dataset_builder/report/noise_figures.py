"""Figures of the study of noise: curves over noise, and marks for meshes that were reconstructed, on one axis."""

from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.report.example_sheet import SheetRow, sheet
from dataset_builder.report.noise_lines import CEILING
from dataset_builder.report.page_parts import COLOURS, PALE, heading, panels
from dataset_builder.studies.noise.axes import NoiseAxis
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import OWN, TRIVIAL, Crop, Level, fields_of, noise_of

LINES = {
    MIXED: ("LighTNet, trained on all levels of noise", COLOURS[0], "o", "-"),
    OWN: ("LighTNet, trained on that level alone", COLOURS[1], "s", "-"),
    TRIVIAL: ("(D + R) S' with true D and R", COLOURS[2], "^", "--"),
    "copy_i_s": ("I_s as it is", PALE, "v", ":"),
}
"""Methods that are shown: what they are called and how they are drawn."""
MARKS = {"density": ("D", "mesh from a density"), "sdf": ("P", "mesh from a signed distance")}
"""How reconstructed levels are drawn, by kind, and what that is called."""
PSNR = "psnr"
Found = Callable[[Level], ClusteredMean]


def quality_figure(levels: Sequence[Level], settings: str, axis: NoiseAxis) -> Figure:
    """A panel per metric: means at every level with standard errors, over measured roughness."""
    figure, axes = panels(len(METRICS), f"Quality against the roughness of the mesh that S' is rendered on\n{settings}")
    for metric, one in zip(METRICS, axes, strict=True):
        for method in LINES:
            _draw(one, levels, axis, method, lambda level, method=method, metric=metric: level.mean(
                method, metric.name))  # type: ignore[misc]
        if levels[0].noise_known:
            _points(one, noise_of(levels), axis, lambda level, metric=metric: level.ceiling[  # type: ignore[misc]
                metric.name], color="black", marker="", linestyle=":", label=CEILING)
        one.set(title=heading(metric))
        _over_roughness(one, levels, axis)
    _legend(figure, axes[0], levels)
    return figure


def changes_figure(levels: Sequence[Level], settings: str, axis: NoiseAxis) -> Figure:
    """What noise takes, and what LighTNet brings, in dB of the same cases, so that easy and hard ones cancel."""
    figure, (falls, gains) = panels(2, f"PSNR in dB, differences of the same cases\n{settings}")
    first = levels[0]
    for method in LINES:
        _draw(falls, levels, axis, method, lambda level, method=method: level.less(
            method, method, PSNR, at=first))  # type: ignore[misc]
        if method != TRIVIAL:
            _draw(gains, levels, axis, method, lambda level, method=method: level.less(
                method, TRIVIAL, PSNR))  # type: ignore[misc]
    falls.set(title=f"less the same method's at {first.asked.title}")
    gains.set(title=f"less that of {LINES[TRIVIAL][0]}")
    for one in (falls, gains):
        one.axhline(0, color="black", linewidth=0.8)
        _over_roughness(one, levels, axis)
    _legend(figure, falls, levels)
    return figure


def _draw(axes: Axes, levels: Sequence[Level], axis: NoiseAxis, method: str, found: Found) -> None:
    """The curve of a method over levels of noise, and its marks at reconstructed ones."""
    label, colour, marker, style = LINES[method]
    _points(axes, noise_of(levels), axis, found, color=colour, marker=marker, linestyle=style, label=label)
    for kind, (mark, _) in MARKS.items():
        own = [level for level in fields_of(levels) if level.asked.kind == kind and method in level.methods]
        _points(axes, own, axis, found, color=colour, marker=mark, linestyle="none", markerfacecolor="white")


def _points(axes: Axes, levels: Sequence[Level], axis: NoiseAxis, found: Found, **look: object) -> None:
    if not levels:
        return
    means = [found(level) for level in levels]
    size = 8 if look["linestyle"] == "none" else 5
    axes.errorbar([axis.factor * level.measured for level in levels], [mean.mean for mean in means],
                  yerr=[mean.error if isfinite(mean.error) else 0.0 for mean in means], markersize=size, linewidth=1.6,
                  capsize=3, **look)  # type: ignore[arg-type]


def _over_roughness(axes: Axes, levels: Sequence[Level], axis: NoiseAxis) -> None:
    """What was measured along the bottom, every level along the top: sigmas of noise, numbers of reconstructed ones."""
    axes.set_xlabel(axis.text)
    top = axes.secondary_xaxis("top")
    noise, fields = noise_of(levels), fields_of(levels)
    top.set_xticks([axis.factor * level.measured for level in noise], [f"{level.asked.sigma:g}" for level in noise],
                   fontsize=7, rotation=45)
    top.set_xlabel("requested sigma", fontsize=7)
    for level in fields:
        place = axis.factor * level.measured
        axes.axvline(place, color="#d0d0d0", linewidth=0.8, linestyle="--", zorder=0)
        axes.annotate(str(level.number), (place, 0), xycoords=("data", "axes fraction"), xytext=(2, 3),
                      textcoords="offset points", fontsize=7, color="#606060")


def _legend(figure: Figure, axes: Axes, levels: Sequence[Level]) -> None:
    handles, labels = axes.get_legend_handles_labels()
    for kind, (mark, text) in MARKS.items():
        if own := [level for level in fields_of(levels) if level.asked.kind == kind]:
            handles.append(Line2D([], [], color="#606060", marker=mark, linestyle="none", markersize=8,
                                  markerfacecolor="white"))
            labels.append(f"{text}: {'; '.join(f'{level.number}: {level.asked.title}' for level in own)}")
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8)


def crop_pictures(crops: Sequence[Crop], axis: NoiseAxis) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by what they show: a row for each level, with the PSNR of each prediction."""
    kinds = dict.fromkeys(crop.what for crop in crops)
    return {what: np.asarray(sheet([_crop_row(crop, axis) for crop in crops if crop.what == what])) for what in kinds}


def _crop_row(crop: Crop, axis: NoiseAxis) -> SheetRow:
    figures = [f"{psnr:.2f} dB {heading}" for heading, psnr in crop.psnr.items()]
    lines = [f"level {crop.level.number}: {crop.level.asked.title}",
             f"{axis.heading} {axis.shown(crop.level.measured)}", f"example {crop.key}", *figures]
    return SheetRow(lines=lines, panels=crop.panels)
