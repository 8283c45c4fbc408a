"""Quality at every level: by the training on all levels, by those on one, and by untrained baselines."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from dataset_builder.errors import UserError
from dataset_builder.files import write_atomic
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import ClusteredMean, estimate, methods
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.noise.level_trainings import MIXED, HeldOut
from dataset_builder.studies.noise.noise_study import NoiseStudy, level_name

OWN = "own level"
"""Whoever was trained on the level at hand."""
COLUMNS = ("level", "sigma", "roughness", "examples", "objects", "by", "trained_on",
           *(f"{metric.name}{end}" for metric in METRICS for end in ("", "_error")))


@dataclass(frozen=True, kw_only=True)
class Level:
    """One level. sigma: as asked for; roughness: as measured, mean over the held-out examples, root mean square of each
    in bounding radii; scores: rows of every method by its name, examples in the same order everywhere."""

    number: int
    sigma: float
    roughness: float
    scores: dict[str, tuple[ScoreRow, ...]]

    def rows(self, method: str) -> tuple[ScoreRow, ...]:
        """Rows of one method; `OWN` is the one that was trained on this level."""
        return self.scores[level_name(self.number) if method == OWN else method]

    def mean(self, method: str, metric: str) -> ClusteredMean:
        """Mean of a metric over the level's examples."""
        rows = self.rows(method)
        return estimate([getattr(row.metrics, metric) for row in rows], [row.object for row in rows])

    def less(self, method: str, other: str, metric: str, at: "Level | None" = None) -> ClusteredMean:
        """A method less another one, or less the other one at another level, case by case."""
        pairs = list(zip(self.rows(method), (at or self).rows(other), strict=True))
        return estimate([getattr(one.metrics, metric) - getattr(two.metrics, metric) for one, two in pairs],
                        [one.object for one, _ in pairs])


def levels_of(study: NoiseStudy, split: HeldOut, scores: Sequence[ScoreRow]) -> list[Level]:
    """Scores by level. Raises UserError where no case has all levels."""
    if not split.cases:
        raise UserError(f"expected a held-out view that passes the gates at all {len(study.levels)} levels, got none: "
                        "lower the largest level, or widen gates.mask_overlap")
    by_key = {(row.method, row.key): row for row in scores}
    found = []
    for number, sigma in enumerate(study.levels):
        own = split.of(number)
        found.append(Level(number=number, sigma=sigma, roughness=fmean(example.roughness for example in own),
                           scores={method: tuple(by_key[method, example.key] for example in own)
                                   for method in methods(scores)}))
    return found


def write_table(levels: Sequence[Level], path: Path) -> None:
    """Every method at every level as CSV, whole or not at all. Raises OutputError."""
    write_atomic(path, comma_separated(COLUMNS, (_line(level, method) for level in levels for method in level.scores)))


def trained_on(method: str) -> str:
    """What a method learnt from: `all` levels, the number of one, or nothing."""
    if method == MIXED:
        return "all"
    return method.removeprefix("level ") if method.startswith("level ") else "nothing"


def _line(level: Level, method: str) -> list[object]:
    cells: list[object] = [level.number, level.sigma, level.roughness, level.mean(method, "psnr").examples,
                           level.mean(method, "psnr").objects, method, trained_on(method)]
    for metric in METRICS:
        found = level.mean(method, metric.name)
        cells += [found.mean, found.error]
    return cells
