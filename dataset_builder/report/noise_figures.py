"""Figures of the study of noise: quality against measured roughness, and one case at every level in pictures."""

from collections.abc import Sequence
from math import isfinite

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.report.estimates import heading
from dataset_builder.report.example_sheet import SheetRow, sheet
from dataset_builder.report.study_figures import COLOURS, PALE, panels
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import OWN, TRIVIAL, Crop, Level

LINES = {
    MIXED: ("LighTNet, trained on all levels", COLOURS[0], "o", "-"),
    OWN: ("LighTNet, trained on that level alone", COLOURS[1], "s", "-"),
    TRIVIAL: ("(D + R) S' with true D and R", COLOURS[2], "^", "--"),
    "copy_i_s": ("I_s as it is", PALE, "v", ":"),
}
"""Methods that are shown: what they are called and how they are drawn."""
PER_CENT, PSNR = 100.0, "psnr"


def quality_figure(levels: Sequence[Level], settings: str) -> Figure:
    """A panel per metric: means at every level with standard errors, over measured roughness."""
    figure, axes = panels(len(METRICS), f"Quality against the roughness of the mesh that S' is rendered on\n{settings}")
    for metric, one in zip(METRICS, axes, strict=True):
        for method in LINES:
            _line(one, levels, method, [level.mean(method, metric.name) for level in levels])
        one.set(title=heading(metric))
        _over_roughness(one, levels)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(LINES), fontsize=8)
    return figure


def changes_figure(levels: Sequence[Level], settings: str) -> Figure:
    """What noise takes, and what LighTNet brings, in dB of the same cases, so that easy and hard ones cancel."""
    figure, (falls, gains) = panels(2, f"PSNR in dB, differences of the same cases\n{settings}")
    for method in LINES:
        _line(falls, levels, method, [level.less(method, method, PSNR, at=levels[0]) for level in levels])
        if method != TRIVIAL:
            _line(gains, levels, method, [level.less(method, TRIVIAL, PSNR) for level in levels])
    falls.set(title=f"less the same method's at sigma {levels[0].sigma:g}")
    gains.set(title=f"less that of {LINES[TRIVIAL][0]}")
    for one in (falls, gains):
        one.axhline(0, color="black", linewidth=0.8)
        _over_roughness(one, levels)
    figure.legend(*falls.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    return figure


def _line(axes: Axes, levels: Sequence[Level], method: str, means: Sequence[ClusteredMean]) -> None:
    label, colour, marker, style = LINES[method]
    axes.errorbar([PER_CENT * level.roughness for level in levels], [found.mean for found in means],
                  yerr=[found.error if isfinite(found.error) else 0.0 for found in means], color=colour, marker=marker,
                  linestyle=style, markersize=5, linewidth=1.6, capsize=3, label=label)


def _over_roughness(axes: Axes, levels: Sequence[Level]) -> None:
    """Measured roughness along the bottom, the sigma of every level along the top."""
    axes.set_xlabel("measured roughness, rms, % of the bounding radius")
    top = axes.secondary_xaxis("top")
    top.set_xticks([PER_CENT * level.roughness for level in levels], [f"{level.sigma:g}" for level in levels],
                   fontsize=7, rotation=45)
    top.set_xlabel("requested sigma", fontsize=7)


def crop_pictures(crops: Sequence[Crop]) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by what they show: a row for each level, with the PSNR of each prediction."""
    kinds = dict.fromkeys(crop.what for crop in crops)
    return {what: np.asarray(sheet([_row(crop) for crop in crops if crop.what == what])) for what in kinds}


def _row(crop: Crop) -> SheetRow:
    figures = [f"{psnr:.2f} dB {heading}" for heading, psnr in crop.psnr.items()]
    lines = [f"level {crop.level.number}: sigma {crop.level.sigma:g}",
             f"roughness {PER_CENT * crop.level.roughness:.3g} %", f"example {crop.key}", *figures]
    return SheetRow(lines=lines, panels=crop.panels)
