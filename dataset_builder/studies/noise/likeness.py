"""Which noise reconstructed meshes are like: by what was measured on them, and by what helps to train with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

import numpy as np

from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.studies.comma_separated import write_csv
from dataset_builder.studies.noise.axes import NORMALS, SHADING
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import TRIVIAL, Level, fields_of, noise_of
from dataset_builder.studies.noise.noise_study import level_name

COST = "cost"
YARDSTICKS: Mapping[str, str] = {
    NORMALS: "deviation of normals, median", "to_clean_rms": "distance to the clean mesh, rms",
    SHADING: "S' against S", COST: "PSNR of (D + R) S'",
}
"""What a reconstructed mesh is compared with noise by: figures of labels, and what its S' costs."""
EVERYTHING = "all"


@dataclass(frozen=True, kw_only=True)
class LikeSigma:
    """The noise that has the same figure as a reconstructed mesh."""

    sigma: float
    """In bounding radii, interpolated between levels; where none has that figure, the nearest level's."""
    beyond: int = 0
    """-1 where the mesh is smoother than all levels of noise, 1 where it is rougher than all, else 0."""

    def __str__(self) -> str:
        return f"{ {-1: '< ', 0: '', 1: '> '}[self.beyond]}{self.sigma:.2g}"


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """What one reconstructed level is like."""

    level: Level
    like: Mapping[str, Mapping[str, LikeSigma]]
    """By yardstick, then by object; `all` is of the means over all examples."""
    best: Level
    """The level of noise whose own training scores best on it."""
    score: ClusteredMean
    """PSNR of that training on it."""
    ahead: ClusteredMean
    """Less that of the training on the next best level of noise, case by case."""
    over_mixed: ClusteredMean
    """Less that of the training on all levels of noise."""


def likenesses(levels: Sequence[Level]) -> list[Likeness]:
    """Every reconstructed level against the levels of noise."""
    return [_likeness(level, noise_of(levels)) for level in fields_of(levels)]


def like_sigma(sigmas: Sequence[float], figures: Sequence[float], figure: float) -> LikeSigma:
    """Where a figure lies on the polyline of rising sigmas and their figures: at the smallest sigma that reaches it.

    Figures rise, or fall, on the whole; which of both, their ends say.

    >>> print(like_sigma((0.0, 0.002, 0.004), (1.0, 5.0, 7.0), 6.0), like_sigma((0.0, 0.002), (30.0, 25.0), 20.0))
    0.003 > 0.002
    """
    sign = 1 if figures[-1] >= figures[0] else -1
    curve = sign * np.asarray(figures, np.float64)
    wanted = sign * figure
    if wanted < curve[0]:
        return LikeSigma(sigma=sigmas[0], beyond=-1)
    if wanted > curve.max():
        return LikeSigma(sigma=sigmas[-1], beyond=1)
    after = int(np.argmax(curve >= wanted))
    if after == 0:
        return LikeSigma(sigma=sigmas[0])
    share = (wanted - curve[after - 1]) / (curve[after] - curve[after - 1])
    return LikeSigma(sigma=float(sigmas[after - 1] + share * (sigmas[after] - sigmas[after - 1])))


def write_likeness(found: Sequence[Likeness], path: Path) -> None:
    """The sigma that each reconstructed level is like, as CSV: by every yardstick, over all and object by object."""
    write_csv(path, ("level", "rough", "by", "object", "sigma", "beyond"), (
        (one.level.number, one.level.asked.title, yardstick, name, like.sigma, like.beyond)
        for one in found for yardstick, objects in one.like.items() for name, like in objects.items()))


def _likeness(level: Level, noise: Sequence[Level]) -> Likeness:
    trained = [(level_name(other.number), other) for other in noise]
    ranked = sorted(trained, key=lambda each: -level.mean(each[0], "psnr").mean)
    (best, other), (second, _) = ranked[:2]
    known = [name for name in YARDSTICKS if name == COST or all(name in each.figures for each in (level, *noise))]
    return Likeness(level=level, best=other, score=level.mean(best, "psnr"), ahead=level.less(best, second, "psnr"),
                    over_mixed=level.less(best, MIXED, "psnr"),
                    like={name: _by_object(name, level, noise) for name in known})


def _by_object(yardstick: str, level: Level, noise: Sequence[Level]) -> dict[str, LikeSigma]:
    sigmas = [other.asked.sigma for other in noise]
    means, curve = _means(yardstick, level), [_means(yardstick, other) for other in noise]
    return {name: like_sigma(sigmas, [other[name] for other in curve], mean) for name, mean in means.items()}


def _means(yardstick: str, level: Level) -> dict[str, float]:
    """Means over all examples, and over those of each object."""
    rows = level.rows(TRIVIAL)
    values = [row.metrics.psnr for row in rows] if yardstick == COST else level.figures[yardstick]
    names = [row.object for row in rows]
    objects = {name: fmean(value for value, own in zip(values, names, strict=True) if own == name)
               for name in dict.fromkeys(names)}
    return {EVERYTHING: fmean(values), **objects}
