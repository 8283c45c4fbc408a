"""The study of noise as one page: how quality falls with roughness, what training on every level gains, which noise
reconstructed meshes are like, the passes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dataset_builder.errors import count_of
from dataset_builder.lightnet.data.truth import noise_unknown
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ONE_OBJECT, ClusteredMean
from dataset_builder.report.example_sheet import png_of
from dataset_builder.report.noise_figures import LINES, PSNR, changes_figure, crop_pictures, quality_figure
from dataset_builder.report.noise_lines import CEILING, NOISE, ceiling_line, with_interval
from dataset_builder.report.page_parts import Section, plus_minus, png, write_study
from dataset_builder.shards.reader import load_manifest
from dataset_builder.studies.noise.axes import axis_of
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import OWN, TRIVIAL, Crop, Level, noise_of
from dataset_builder.studies.noise.likeness import EVERYTHING, YARDSTICKS, Likeness, LikeSigma
from dataset_builder.studies.noise.noise_study import NoiseStudy, PassCount, level_name, shared_passes


@dataclass(frozen=True, kw_only=True)
class NoiseResults:
    """Everything that the page shows."""

    study: NoiseStudy
    levels: Sequence[Level]
    likenesses: Sequence[Likeness]
    """Of reconstructed levels, where there are some."""
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
    axis, sentence = axis_of(found.study.axis), found.study.sentence
    pictures = crop_pictures(found.crops, axis)
    figures = {"quality": png(quality_figure(found.levels, sentence, axis)),
               "changes": png(changes_figure(found.levels, sentence, axis)),
               **{f"crops-{what}": png_of(pixels) for what, pixels in pictures.items()}}
    sections = [_quality(found, figures["quality"]), *_without_noise(found), *_likeness(found),
                _mending(found, figures["changes"]), *(_crops(what, figures[f"crops-{what}"]) for what in pictures),
                _cross(found), _passes(found)]
    write_study(found.study.out, f"How smooth rough meshes must be: {found.study.loaded.dataset.name}", _lead(found),
                sections, figures=figures)


def noise_sentence(study: NoiseStudy, levels: Sequence[Level]) -> str:
    """What a perfect prediction would get at the first level. I_t is the same at all; its exposure differs a little."""
    return ceiling_line(levels[0].ceiling, noise_unknown(load_manifest(study.dataset)))


def sentences(levels: Sequence[Level], found: Sequence[Likeness] = ()) -> list[str]:
    """What the study says in words: the smoothest noise against the roughest, the trainings against each other, and
    what reconstructed levels are like."""
    first, last = noise_of(levels)[0], noise_of(levels)[-1]
    falls = {name: last.less(name, name, PSNR, at=first) for name in (TRIVIAL, MIXED, OWN)}
    gain, best = last.less(MIXED, TRIVIAL, PSNR), last.less(OWN, MIXED, PSNR)
    span = f"from {first.asked.title} to {last.asked.title}"
    return [
        f"Noise alone: {span} PSNR of (D + R) S' with true D and R changes by {_signed(falls[TRIVIAL])} dB.",
        f"LighTNet: over the same span it changes by {_signed(falls[MIXED])} dB where trained on all levels, and by "
        f"{_signed(falls[OWN])} dB where each level has its own training.",
        f"At {last.asked.title}, LighTNet trained on all levels has {_signed(gain)} dB against (D + R) S' "
        f"({_told(gain)}), and the training on that level alone {_signed(best)} dB against the former ({_told(best)}).",
        *map(_like_sentence, found),
    ]


def _like_sentence(found: Likeness) -> str:
    """By figures, then by what helps to train with; the choice of the best is part of the luck."""
    like = ", ".join(f"{_like(objects)} by {YARDSTICKS[name]}" for name, objects in found.like.items())
    return (f"{found.level.asked.title}: like sigma {like}. Of the trainings on one level of noise, that on "
            f"{found.best.asked.title} is best on it: {plus_minus(found.score, PSNR)} dB, {_signed(found.ahead)} dB "
            f"against the next ({_told(found.ahead)}), {_signed(found.over_mixed)} dB against that on all levels of "
            f"noise ({_told(found.over_mixed)}).")


def _like(objects: Mapping[str, LikeSigma]) -> str:
    """The sigma of all examples, and the range over objects."""
    own = sorted((like for name, like in objects.items() if name != EVERYTHING),
                 key=lambda like: (like.beyond, like.sigma))
    span = f" (objects: {own[0]} to {own[-1]})" if len(own) > 1 else ""
    return f"{objects[EVERYTHING]}{span}"


def _lead(found: NoiseResults) -> list[str]:
    first = found.levels[0].mean(MIXED, PSNR)
    learnt = ", ".join(f"{name} {count}" for name, count in found.learnt.items())
    counts = zip(found.levels, found.rejected, strict=True)
    rejected = "; ".join(f"{level.asked.title}: {count}" for level, count in counts)
    study = found.study
    return [
        f"LighTNet: {study.sentence}. Small settings show the sign of large effects, but not what a full training "
        "would reach.",
        f"Measured on the {first.examples} held-out examples per level, of {count_of(first.objects, 'object')}, whose "
        f"view and light passed the gates at every level; {found.left_out} more were left out. Examples that a gate "
        f"rejected, by level: {rejected}. Training examples: {learnt}.",
        f"Roughness is measured, mean over the held-out examples: {axis_of(study.axis).text} (`{study.axis}` of the "
        "labels). A rough mesh is not quite the clean one at sigma 0, where subdivision rounds it.",
        "The exposure of an example follows the mean of its S', so that the truth is exposed a little differently at "
        "each level; the curve of I_s, which no noise reaches, shows the effect of that alone.",
        *([] if found.levels[0].noise_known else [noise_sentence(study, found.levels)]),
        *[f"{ONE_OBJECT}."] * (first.objects == 1),
        "Standard errors are clustered by object. All curves share their examples, so that differences along a curve "
        "and between curves are known better than the bars suggest; the tables below have them.",
    ]


def _quality(found: NoiseResults, figure: bytes) -> Section:
    axis = axis_of(found.study.axis)
    rows = [[level.asked.title, axis.shown(level.measured), LINES[method][0],
             *(plus_minus(level.mean(method, metric.name), metric.name) for metric in METRICS)]
            for level in found.levels for method in LINES if method in level.methods]
    return Section(question="How much does the roughness of the mesh cost?", answer=" ".join(sentences(found.levels)),
                   figure=figure, head=("level", axis.heading, "by", *(metric.symbol for metric in METRICS)), rows=rows)


def _without_noise(found: NoiseResults) -> list[Section]:
    """The same figures without the truth's noise, and what a perfect prediction would get, where that is known."""
    if not found.levels[0].noise_known:
        return []
    rows = []
    for level in found.levels:
        title = level.asked.title
        rows += [[title, LINES[method][0], *(with_interval(level.mean(method, metric.name, "corrected"), metric.name)
                                             for metric in METRICS)] for method in LINES if method in level.methods]
        rows.append([title, CEILING, *(plus_minus(one, name) for name, one in level.ceiling.items())])
    return [Section(question="How much of it is noise of the truth?", answer=" ".join(NOISE.replace("*", "").split()),
                    head=("level", "by, without noise", *(metric.symbol for metric in METRICS)), rows=rows)]


def _likeness(found: NoiseResults) -> list[Section]:
    """What reconstructed levels are like, where there are some."""
    if not found.likenesses:
        return []
    names = list(found.likenesses[0].like)
    rows = [[one.level.asked.title, *(_like(one.like[name]) for name in names), one.best.asked.title,
             plus_minus(one.score, PSNR), _compared(one.ahead), _compared(one.over_mixed)] for one in found.likenesses]
    return [Section(question="Which noise is a reconstructed mesh like?", rows=rows,
                    answer="The sigma with the same figure, interpolated between levels, by each figure; below or "
                    "above all levels where it says so. Then the training on one level of noise that is best on it, "
                    "PSNR in dB, and how far it is ahead of the next best and of the training on all levels of noise.",
                    head=("level", *(YARDSTICKS[name] for name in names), "best training", "its PSNR", "less the next",
                          "less all levels"))]


def _mending(found: NoiseResults, figure: bytes) -> Section:
    pairs = ((MIXED, TRIVIAL), (OWN, TRIVIAL), (OWN, MIXED))
    rows = [[level.asked.title, *(_compared(level.less(one, two, PSNR)) if one in level.methods else "-"
                                  for one, two in pairs)] for level in found.levels]
    return Section(question="What does LighTNet correct, and does it help to know the level?", figure=figure,
                   answer="PSNR in dB, difference of the same examples with its standard error; told apart where the "
                   "interval of 95% confidence does not contain 0. One training of each kind: these errors do not "
                   "include the spread between seeds.",
                   rows=rows, head=("level", "all levels less (D + R) S'", "own level less (D + R) S'",
                                    "own level less all levels"))


def _crops(what: str, figure: bytes) -> Section:
    return Section(question=f"What does the {what} case look like?", figure=figure,
                   answer=f"The {what} case by PSNR of the training on all levels at the largest sigma; tone-mapped as "
                   "networks and metrics see it.")


def _cross(found: NoiseResults) -> Section:
    study = found.study
    names = {**{level_name(number): study.levels[number].title for number in study.alone}, MIXED: "all levels of noise"}
    rows = [[f"trained on {title}", *(f"{level.mean(name, PSNR).mean:.2f}" for level in found.levels)]
            for name, title in names.items()]
    return Section(question="What does a training on one level do at another?", answer="PSNR in dB.", rows=rows,
                   head=("", *(f"at {level.asked.title}" for level in found.levels)))


def _passes(found: NoiseResults) -> Section:
    rows = [[one.name, one.meaning, f"{one.ran}", f"{one.examples}", one.per, f"{one.seconds:.1f}"]
            for one in found.passes]
    return Section(question="What was rendered for this study?", answer=f"Counted from the seconds of every example: "
                   f"{shared_passes(found.passes)}.",
                   head=("pass", "makes", "ran", "for examples", "", "seconds"), rows=rows)


def _told(found: ClusteredMean) -> str:
    return "told apart" if found.told_apart else "not told apart"


def _compared(found: ClusteredMean) -> str:
    return f"{_signed(found)}, {_told(found)}"


def _signed(found: ClusteredMean) -> str:
    return plus_minus(found, PSNR, "+")
