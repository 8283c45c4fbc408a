"""The study of noise as one page: how quality falls with roughness, what training on every level gains, the passes."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.report.example_sheet import SheetRow, png_of, sheet
from dataset_builder.report.page_parts import COLOURS, PALE, Section, heading, panels, plus_minus, png, write_study
from dataset_builder.studies.noise.axes import NoiseAxis, axis_of
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import OWN, TRIVIAL, Crop, Level
from dataset_builder.studies.noise.noise_study import NoiseStudy, PassCount, level_name, shared_passes

LINES = {
    MIXED: ("LighTNet, trained on all levels", COLOURS[0], "o", "-"),
    OWN: ("LighTNet, trained on that level alone", COLOURS[1], "s", "-"),
    TRIVIAL: ("(D + R) S' with true D and R", COLOURS[2], "^", "--"),
    "copy_i_s": ("I_s as it is", PALE, "v", ":"),
}
"""Methods that are shown: what they are called and how they are drawn."""
PSNR = "psnr"


@dataclass(frozen=True, kw_only=True)
class NoiseResults:
    """Everything that the page shows."""

    study: NoiseStudy
    levels: Sequence[Level]
    passes: Sequence[PassCount]
    crops: Sequence[Crop]
    left_out: int
    """Held-out cases that not every level kept."""
    rejected: Sequence[int]
    """Examples by level."""
    learnt: dict[str, int]
    """Examples of each training."""


def write_page(found: NoiseResults) -> None:
    """Write `report.html` and its figures. Raises OutputError."""
    axis, sentence = axis_of(found.study.x), found.study.sentence
    pictures = crop_pictures(found.crops, axis)
    figures = {"quality": png(quality_figure(found.levels, sentence, axis)),
               "changes": png(changes_figure(found.levels, sentence, axis)),
               **{f"crops-{what}": png_of(pixels) for what, pixels in pictures.items()}}
    sections = [_quality(found, figures["quality"]), _mending(found, figures["changes"]),
                *(_crops(what, figures[f"crops-{what}"]) for what in pictures), _cross(found), _passes(found)]
    write_study(found.study.out, f"How smooth rough meshes must be: {found.study.loaded.dataset.name}", _lead(found),
                sections, figures=figures)


def sentences(levels: Sequence[Level]) -> list[str]:
    """What the study says in words: the smoothest level against the roughest, and the trainings against each other."""
    first, last = levels[0], levels[-1]
    falls = {name: last.less(name, name, PSNR, at=first) for name in (TRIVIAL, MIXED, OWN)}
    gain, best = last.less(MIXED, TRIVIAL, PSNR), last.less(OWN, MIXED, PSNR)
    span = f"from sigma {first.sigma:g} to {last.sigma:g}"
    return [
        f"Noise alone: {span} PSNR of (D + R) S' with true D and R changes by {_signed(falls[TRIVIAL])} dB.",
        f"LighTNet: over the same span it changes by {_signed(falls[MIXED])} dB where trained on all levels, and by "
        f"{_signed(falls[OWN])} dB where each level has its own training.",
        f"At sigma {last.sigma:g}, LighTNet trained on all levels has {_signed(gain)} dB against (D + R) S' "
        f"({_told(gain)}), and the training on that level alone {_signed(best)} dB against the former ({_told(best)}).",
    ]


def _lead(found: NoiseResults) -> list[str]:
    first = found.levels[0].mean(MIXED, PSNR)
    learnt = ", ".join(f"{name} {count}" for name, count in found.learnt.items())
    rejected = ", ".join(f"{level.sigma:g}: {count}" for level, count in zip(found.levels, found.rejected, strict=True))
    study = found.study
    return [
        f"LighTNet: {study.sentence}. Small settings show the sign of large effects, but not what a full training "
        "would reach.",
        f"Measured on the {first.examples} held-out examples per level, of {first.objects} objects, whose view and "
        f"light passed the gates at every level; {found.left_out} more were left out. Examples that a gate rejected, "
        f"by sigma: {rejected}. Training examples: {learnt}.",
        f"Roughness is measured, mean over the held-out examples: {axis_of(study.x).text} (`{study.x}` of the labels). "
        "A rough mesh is not quite the clean one at sigma 0, where subdivision rounds it.",
        "The exposure of an example follows the mean of its S', so that the truth is exposed a little differently at "
        "each level; the curve of I_s, which no noise reaches, shows the effect of that alone.",
        "Standard errors are clustered by object. All curves share their examples, so that differences along a curve "
        "and between curves are known better than the bars suggest; the tables below have them.",
    ]


def _quality(found: NoiseResults, figure: bytes) -> Section:
    axis = axis_of(found.study.x)
    rows = [[f"{level.sigma:g}", axis.shown(level.measured), LINES[method][0],
             *(plus_minus(level.mean(method, metric.name), metric.name) for metric in METRICS)]
            for level in found.levels for method in LINES]
    return Section(question="How much does the roughness of the mesh cost?", answer=" ".join(sentences(found.levels)),
                   figure=figure, head=("sigma", axis.heading, "by", *(metric.symbol for metric in METRICS)), rows=rows)


def _mending(found: NoiseResults, figure: bytes) -> Section:
    pairs = ((MIXED, TRIVIAL), (OWN, TRIVIAL), (OWN, MIXED))
    rows = [[f"{level.sigma:g}", *(f"{_signed(less)}, {_told(less)}"
                                   for less in (level.less(one, two, PSNR) for one, two in pairs))]
            for level in found.levels]
    return Section(question="What does LighTNet correct, and does it help to know the level?", figure=figure,
                   answer="PSNR in dB, difference of the same examples with its standard error; told apart where the "
                   "interval of 95% confidence does not contain 0. One training of each kind: these errors do not "
                   "include the spread between seeds.",
                   rows=rows, head=("sigma", "all levels less (D + R) S'", "own level less (D + R) S'",
                                    "own level less all levels"))


def _crops(what: str, figure: bytes) -> Section:
    return Section(question=f"What does the {what} case look like?", figure=figure,
                   answer=f"The {what} case by PSNR of the training on all levels at the largest sigma; tone-mapped as "
                   "networks and metrics see it.")


def _cross(found: NoiseResults) -> Section:
    names = (*map(level_name, range(len(found.study.levels))), MIXED)
    rows = [[f"trained on {name}", *(f"{level.mean(name, PSNR).mean:.2f}" for level in found.levels)] for name in names]
    return Section(question="What does a training on one level do at another?", answer="PSNR in dB.", rows=rows,
                   head=("", *(f"at sigma {level.sigma:g}" for level in found.levels)))


def _passes(found: NoiseResults) -> Section:
    rows = [[one.name, one.meaning, f"{one.ran}", f"{one.examples}", one.per, f"{one.seconds:.1f}"]
            for one in found.passes]
    return Section(question="What was rendered for this study?", answer=f"Counted from the seconds of every example: "
                   f"{shared_passes(found.passes)}.",
                   head=("pass", "makes", "ran", "for examples", "", "seconds"), rows=rows)


def _told(found: ClusteredMean) -> str:
    return "told apart" if found.told_apart else "not told apart"


def _signed(found: ClusteredMean) -> str:
    return plus_minus(found, PSNR, "+")


def quality_figure(levels: Sequence[Level], settings: str, axis: NoiseAxis) -> Figure:
    """A panel per metric: means at every level with standard errors, over measured roughness."""
    figure, axes = panels(len(METRICS), f"Quality against the roughness of the mesh that S' is rendered on\n{settings}")
    for metric, one in zip(METRICS, axes, strict=True):
        for method in LINES:
            _line(one, levels, axis, method, [level.mean(method, metric.name) for level in levels])
        one.set(title=heading(metric))
        _over_roughness(one, levels, axis)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(LINES), fontsize=8)
    return figure


def changes_figure(levels: Sequence[Level], settings: str, axis: NoiseAxis) -> Figure:
    """What noise takes, and what LighTNet brings, in dB of the same cases, so that easy and hard ones cancel."""
    figure, (falls, gains) = panels(2, f"PSNR in dB, differences of the same cases\n{settings}")
    for method in LINES:
        _line(falls, levels, axis, method, [level.less(method, method, PSNR, at=levels[0]) for level in levels])
        if method != TRIVIAL:
            _line(gains, levels, axis, method, [level.less(method, TRIVIAL, PSNR) for level in levels])
    falls.set(title=f"less the same method's at sigma {levels[0].sigma:g}")
    gains.set(title=f"less that of {LINES[TRIVIAL][0]}")
    for one in (falls, gains):
        one.axhline(0, color="black", linewidth=0.8)
        _over_roughness(one, levels, axis)
    figure.legend(*falls.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    return figure


def _line(axes: Axes, levels: Sequence[Level], axis: NoiseAxis, method: str, means: Sequence[ClusteredMean]) -> None:
    label, colour, marker, style = LINES[method]
    axes.errorbar([axis.factor * level.measured for level in levels], [found.mean for found in means],
                  yerr=[found.error if isfinite(found.error) else 0.0 for found in means], color=colour, marker=marker,
                  linestyle=style, markersize=5, linewidth=1.6, capsize=3, label=label)


def _over_roughness(axes: Axes, levels: Sequence[Level], axis: NoiseAxis) -> None:
    """What was measured along the bottom, the sigma of every level along the top."""
    axes.set_xlabel(axis.text)
    top = axes.secondary_xaxis("top")
    top.set_xticks([axis.factor * level.measured for level in levels], [f"{level.sigma:g}" for level in levels],
                   fontsize=7, rotation=45)
    top.set_xlabel("requested sigma", fontsize=7)


def crop_pictures(crops: Sequence[Crop], axis: NoiseAxis) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by what they show: a row for each level, with the PSNR of each prediction."""
    kinds = dict.fromkeys(crop.what for crop in crops)
    return {what: np.asarray(sheet([_crop_row(crop, axis) for crop in crops if crop.what == what])) for what in kinds}


def _crop_row(crop: Crop, axis: NoiseAxis) -> SheetRow:
    figures = [f"{psnr:.2f} dB {heading}" for heading, psnr in crop.psnr.items()]
    lines = [f"level {crop.level.number}: sigma {crop.level.sigma:g}",
             f"{axis.heading} {axis.shown(crop.level.measured)}", f"example {crop.key}", *figures]
    return SheetRow(lines=lines, panels=crop.panels)
