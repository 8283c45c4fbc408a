"""Curves through the rows: means over examples, the knee, and what equal error costs; and the study's conclusions."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dataset_builder.studies.accuracy.rows import ADAPTIVE, UNIFORM, AccuracyRow, of
from dataset_builder.studies.image_errors import geometric_mean

TOLERABLE = 0.1
"""Error above which no setting is recommended, however well it pays to be that cheap."""

PRICE = 3.5
"""Times the seconds that halving the error costs beyond the knee; 4 where error falls as seconds to the -1/2."""

REACH = 2.0
"""Factor in error by which a curve may be continued by its law, relMSE ~ 1/time, to be compared."""


@dataclass(frozen=True, kw_only=True)
class Point:
    """One setting on a curve: geometric means over examples, unless a field says otherwise."""

    setting: str
    value: float
    """Median."""
    seconds: float
    error: float
    psnr: float
    """Mean, in dB."""
    flip: float
    spp: float
    at_floor: bool
    """In some example noise hides the error, which is an upper bound there."""


def curve(rows: Sequence[AccuracyRow], question: str, layer: str) -> list[Point]:
    """Points of a layer in one question, in the order of the rows: settings that are meant to be cheaper come first."""
    own = of(rows, question, layer)
    settings = dict.fromkeys(row.setting for row in own if math.isfinite(row.relmse))
    return [_point([row for row in own if row.setting == setting]) for setting in settings]


def _point(rows: Sequence[AccuracyRow]) -> Point:
    at_floor = any(row.at_floor for row in rows)
    squares = [row.relmse + (row.floor if row.at_floor else 0.0) for row in rows]
    mean = geometric_mean(squares)
    return Point(setting=rows[0].setting, value=float(np.median([row.value for row in rows])),
                 seconds=geometric_mean(row.seconds for row in rows), error=math.sqrt(mean) if mean > 0 else 0.0,
                 psnr=float(np.mean([row.psnr for row in rows])), flip=geometric_mean(row.flip for row in rows),
                 spp=geometric_mean(row.spp for row in rows), at_floor=at_floor)


def knee(points: Sequence[Point]) -> Point | None:
    """The cheapest point with a `TOLERABLE` error from which on halving it costs `PRICE` times the time or more; the
    most accurate where none is tolerable, None without points.

    Before it, fixed costs of a pass dominate and accuracy is cheap; beyond it, Monte Carlo's law holds, or less than
    that. The price is taken over the next two steps, one where there is only one, as times are noisy.
    """
    usable = [point for point in points if not point.at_floor and point.error > 0]
    usable = [point for point in usable if point.error <= TOLERABLE] or usable[-1:]
    for index, point in enumerate(usable):
        later = usable[min(index + 2, len(usable) - 1)]
        if later is point or price(point, later) >= PRICE:
            return point
    return points[0] if points else None


def price(point: Point, later: Point) -> float:
    """Factor in time by which the error halves between two points; inf where it does not fall."""
    fall, rise = math.log(point.error / later.error), math.log(later.seconds / point.seconds)
    return 2 ** (rise / fall) if fall > 0 else math.inf


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """Cost of one setting over that of uniform spp with the same error, in one example and layer."""

    seconds: float
    paths: float


def equal_error(rows: Sequence[AccuracyRow], question: str = ADAPTIVE) -> list[Ratio]:
    """Ratios of every row of a question whose error uniform spp reaches, too, or nearly.

    Uniform costs are interpolated in log-log over relMSE. Rows at the floor of their reference are left out, and so is
    adaptive sampling that ended with its first round, which is uniform.
    """
    found = []
    for row in of(rows, question):
        uniform = [other for other in of(rows, UNIFORM, row.layer) if other.example == row.example]
        seconds, paths = (_cost_at(row.relmse, uniform, name) for name in ("seconds", "paths"))
        ended_at_once = question == ADAPTIVE and row.spp_min == row.spp_max
        if not row.at_floor and not ended_at_once and math.isfinite(seconds):
            found.append(Ratio(paths=row.paths / paths, seconds=row.seconds / seconds))
    return found


def _cost_at(relmse: float, uniform: Sequence[AccuracyRow], cost: str) -> float:
    """Seconds or paths at which uniform spp has this relMSE; NaN beyond `REACH`."""
    usable = sorted((row for row in uniform if not row.at_floor and row.relmse > 0), key=lambda row: row.relmse)
    if not usable or relmse <= 0:
        return math.nan
    errors = np.log([row.relmse for row in usable])
    costs = np.log([getattr(row, cost) for row in usable])
    wanted = math.log(relmse)
    inside = float(np.clip(wanted, errors[0], errors[-1]))
    if abs(wanted - inside) > 2 * math.log(REACH):
        return math.nan
    return math.exp(float(np.interp(inside, errors, costs)) - (wanted - inside))


@dataclass(kw_only=True)
class Advice:
    """The study's conclusions: one sentence for each question with its numbers, and recommended settings."""

    sentences: dict[str, str] = field(default_factory=dict)
    """By question."""
    overrides: list[str] = field(default_factory=list)
    """As `--set` takes them."""
    marked: dict[tuple[str, str], Point] = field(default_factory=dict)
    """Recommended point by question and layer."""
    noise: dict[str, float] = field(default_factory=dict)
    """Relative error of each layer at its recommended point."""

    def lines(self) -> str:
        """One option of the command line for every override."""
        return "".join(f"--set '{override}'\n" for override in self.overrides)

    def marks(self, question: str) -> Mapping[str, Point]:
        """Recommended points of a question by layer."""
        return {layer: point for (name, layer), point in self.marked.items() if name == question}
