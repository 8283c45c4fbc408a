"""Quality at every level, by trainings on all levels and on one and by untrained baselines; and cases in pictures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from pathlib import Path
from statistics import fmean

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.loader import whole_images
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate, methods
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow
from dataset_builder.lightnet.results.pictures import cropped, light
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.noise.axes import AXES, NoiseAxis
from dataset_builder.studies.noise.level_trainings import MIXED, HeldOut, contenders
from dataset_builder.studies.noise.noise_study import NoiseStudy, level_name
from dataset_builder.studies.noise.study_levels import StudyLevel
from dataset_builder.studies.trainings import PARTS

OWN = "own level"
"""Whoever was trained on the level at hand."""
TRIVIAL = "dr_s_prime"
HEADINGS = {TRIVIAL: "(D + R) S', true D, R", MIXED: "trained on all noise", OWN: "trained on this level"}
COLUMNS = ("examples", "objects", "by", "trained_on",
           *(f"{metric.name}{part}{end}" for part in PARTS.values() for metric in METRICS for end in ("", "_error")))


@dataclass(frozen=True, kw_only=True)
class Level:
    """One level of noise, or one kind of field, and the scores on its held-out examples."""

    number: int
    asked: StudyLevel
    measured: float
    """On the study's axis, mean over the held-out examples, in the label's unit."""
    figures: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """All that was measured of every rough mesh, by names of `AXES`; examples as in `scores`."""
    scores: Mapping[str, tuple[ScoreRow, ...]]
    """Rows of every method by its name, examples in the same order everywhere."""

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of those that have scores on it, with `OWN` where it has a training of its own."""
        return (*self.scores, *((OWN,) if level_name(self.number) in self.scores else ()))

    def rows(self, method: str) -> tuple[ScoreRow, ...]:
        """Rows of one method; `OWN` is the one that was trained on this level."""
        return self.scores[level_name(self.number) if method == OWN else method]

    def mean(self, method: str, metric: str, part: str = "metrics") -> ClusteredMean:
        """Mean of a metric over the level's examples. part: a key of `PARTS`; NaN of others than `metrics` where nobody
        knows the truth's noise."""
        rows = self.rows(method)
        return estimate([getattr(getattr(row, part), metric) for row in rows], [row.object for row in rows])

    @property
    def ceiling(self) -> dict[str, ClusteredMean]:
        """What a perfect prediction would get against the truth as it is, by metric."""
        return {metric.name: self.mean(next(iter(self.scores)), metric.name, "ceiling") for metric in METRICS}

    @property
    def noise_known(self) -> bool:
        """Whether the noise of the truth is known."""
        return isfinite(self.ceiling["psnr"].mean)

    def less(self, method: str, other: str, metric: str, at: "Level | None" = None) -> ClusteredMean:
        """A method less another one, or less the other one at another level, case by case."""
        pairs = list(zip(self.rows(method), (at or self).rows(other), strict=True))
        return estimate([getattr(one.metrics, metric) - getattr(two.metrics, metric) for one, two in pairs],
                        [one.object for one, _ in pairs])


def levels_of(study: NoiseStudy, split: HeldOut, scores: Sequence[ScoreRow]) -> list[Level]:
    """Scores by level. Raises UserError where no case has all levels."""
    if not split.cases:
        raise UserError(f"expected a held-out view that passes the gates at all {len(study.levels)} levels, got none: "
                        "lower the largest level, or widen gates.mask_overlap"
                        + ("" if len(study.noise) == len(study.levels) else ", or gates of fields"))
    by_key = {(row.method, row.key): row for row in scores}
    found = []
    for number, asked in enumerate(study.levels):
        own = split.of(number)
        figures = {name: [example.figures[name] for example in own] for name in AXES
                   if all(name in example.figures for example in own)}
        found.append(Level(number=number, asked=asked, measured=fmean(figures[study.axis]), figures=figures,
                           scores={method: tuple(by_key[method, example.key] for example in own)
                                   for method in methods(scores)}))
    return found


def noise_of(levels: Sequence[Level]) -> list[Level]:
    """Those that are noise on the clean mesh, sigma rising."""
    return [level for level in levels if level.asked.noise]


def fields_of(levels: Sequence[Level]) -> list[Level]:
    """Those whose meshes are taken from fields."""
    return [level for level in levels if not level.asked.noise]


def write_table(levels: Sequence[Level], path: Path, axis: NoiseAxis) -> None:
    """Every method at every level as CSV, whole or not at all; what was measured is named as the axis is. Raises
    OutputError."""
    write_csv(path, ("level", "rough", "sigma", axis.short or axis.name, *COLUMNS),
              (_line(level, method) for level in levels for method in level.scores))


def trained_on(method: str) -> str:
    """What a method learnt from: `all` levels of noise, the number of one level, or nothing."""
    if method == MIXED:
        return "all"
    return method.removeprefix("level ") if method.startswith("level ") else "nothing"


def _line(level: Level, method: str) -> list[object]:
    sigma = level.asked.sigma if level.asked.noise else nan
    cells: list[object] = [level.number, level.asked.title, sigma, level.measured, level.mean(method, "psnr").examples,
                           level.mean(method, "psnr").objects, method, trained_on(method)]
    for part in PARTS:
        for metric in METRICS:
            found = level.mean(method, metric.name, part)
            cells += [found.mean, found.error]
    return cells


@dataclass(frozen=True, kw_only=True, eq=False)
class Crop:
    """One case at one level."""

    what: str
    """Why it is shown."""
    key: str
    level: Level
    psnr: dict[str, float]
    """Of every prediction, by its heading."""
    panels: dict[str, np.ndarray]
    """(H, W, 3) uint8 pictures by heading, tone-mapped as metrics see them and cut to the object."""


def crops(study: NoiseStudy, split: HeldOut, levels: Sequence[Level]) -> Iterator[Crop]:
    """The median and the worst case at every level, by PSNR of the mixed training at the largest sigma."""
    by_name = {one.name: one for one in contenders(study)}
    for what, case in chosen(split, levels).items():
        for level in levels:
            yield _crop(what, case, split, level, by_name)


def chosen(split: HeldOut, levels: Sequence[Level]) -> dict[str, int]:
    """Positions of the cases to show, by what they are; the worst one only where it is another."""
    ranked = sorted(range(len(split.cases)), key=lambda case: noise_of(levels)[-1].rows(MIXED)[case].metrics.psnr)
    middle, worst = ranked[len(ranked) // 2], ranked[0]
    return {"median": middle} | ({"worst": worst} if worst != middle else {})


def _crop(what: str, case: int, split: HeldOut, level: Level, by_name: dict[str, Contender]) -> Crop:
    example = split.of(level.number)[case]
    batch, = whole_images(split.dataset, [example.index])
    names = {method: level_name(level.number) if method == OWN else method for method in HEADINGS
             if method in level.methods}
    panels = {"I_s": light(batch.inputs.i_s[0]), "S'": light(batch.inputs.s_prime[0])}
    for shown, name in names.items():
        one = by_name[name]
        panels[HEADINGS[shown]] = light(one.find(batch.to(one.device)).i_t[0])
    panels["truth"] = light((batch.truth.i_t * batch.inputs.inside)[0])
    return Crop(what=what, key=example.key, level=level, panels=cropped(panels, batch.inputs.inside[0]),
                psnr={HEADINGS[shown]: level.rows(name)[case].metrics.psnr for shown, name in names.items()})
