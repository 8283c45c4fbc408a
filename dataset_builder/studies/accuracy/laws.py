"""What accuracy costs, as laws: error^2 = a / n + b and seconds = c + d n, for every layer of every example.

n is samples per pixel; for goals, error^2 = a g^2 in the goal g, from goals that took more than one round.
b is what more samples do not remove: the bias of denoising, paths that are cut, half precision. The reference's own
noise is taken out beforehand, but only so well as it is known, `KNOWN`: that share of it widens the interval of b,
which all points of an example share.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from statistics import fmean, median

import numpy as np

from dataset_builder.studies.accuracy.rows import ADAPTIVE, ADAPTIVE_DENOISED, QUESTIONS, UNIFORM, AccuracyRow, of
from dataset_builder.studies.accuracy.straight_line import Line, straight_line
from dataset_builder.studies.image_errors import geometric_mean

KNOWN = 0.2
"""Share of the noise of a picture that taking it out may leave: it is known from a few batches per pixel."""
GOALS = (ADAPTIVE, ADAPTIVE_DENOISED)
LEAST = 16
"""Samples per pixel from which a law is fitted: fewer are one or none to a batch, which cannot be stratified."""
REACH = 4.0
"""Factor beyond the measured samples up to which a law is compared with others."""


@dataclass(frozen=True, kw_only=True)
class Law:
    """Of one layer of one example under one way to sample."""

    question: str
    layer: str
    example: str
    error: Line
    """relMSE over 1 / n, or over the squared goal."""
    time: Line
    """Seconds over n."""
    least: float
    """n of the fewest samples that were measured."""
    most: float


def laws(rows: Sequence[AccuracyRow], clock: str) -> list[Law]:
    """The law of every question, layer and example that at least two settings measure. clock: `seconds` or
    `cpu_seconds`, the time that counts."""
    found = []
    for question in QUESTIONS:
        own = [row for row in of(rows, question) if isfinite(row.relmse_measured) and row.spp > 0]
        for layer, example in dict.fromkeys((row.layer, row.example) for row in own):
            points = _fitted([row for row in own if (row.layer, row.example) == (layer, example)])
            if len(points) > 1 and (question in GOALS or len({row.value for row in points}) > 1):
                found.append(_law(points, clock))
    return found


def _fitted(points: Sequence[AccuracyRow]) -> Sequence[AccuracyRow]:
    """Those that a law is fitted to; all of them where too few would be left."""
    if points[0].question in GOALS:
        return [row for row in points if row.spp_max > row.spp_min]
    many = [row for row in points if row.spp >= LEAST]
    return many if len({row.value for row in many}) > 1 else points


def _law(rows: Sequence[AccuracyRow], clock: str) -> Law:
    first, spp = rows[0], np.array([row.spp for row in rows])
    across = np.array([row.value for row in rows]) ** 2 if first.question in GOALS else 1 / spp
    noise = KNOWN * np.array([row.relmse_reference for row in rows])
    left = np.array([row.relmse_measured - row.relmse_reference for row in rows])
    return Law(question=first.question, layer=first.layer, example=first.example,
               error=straight_line(across, left, noise, float(noise.max()), through_zero=first.question in GOALS),
               time=straight_line(spp, np.array([getattr(row, clock) for row in rows])),
               least=float(spp.min()), most=float(spp.max()))


def of_layer(found: Sequence[Law], question: str, layer: str) -> list[Law]:
    """The laws of a layer under one way to sample, one for every example."""
    return [law for law in found if (law.question, law.layer) == (question, layer)]


@dataclass(frozen=True, kw_only=True)
class Ratio:
    """Cost of one setting over that of uniform spp with the same error, in one example and layer."""

    seconds: float
    paths: float


def equal_error(rows: Sequence[AccuracyRow], found: Sequence[Law], question: str, clock: str) -> list[Ratio]:
    """Ratios of every setting of a question whose error uniform spp reaches by its law, near what was measured.

    Points at the floor of their reference are left out, and so is adaptive sampling that ended with its first round,
    which is uniform.
    """
    ratios = []
    for law in (law for law in found if law.question == UNIFORM):
        own = [row for row in of(rows, question, law.layer) if row.example == law.example]
        for value in dict.fromkeys(row.value for row in own):
            points = [row for row in own if row.value == value]
            ended_at_once = question in GOALS and all(row.spp_min == row.spp_max for row in points)
            beyond = fmean(row.relmse for row in points) - law.error.rest
            spp = law.error.slope / beyond if beyond > 0 else float("inf")
            if not (ended_at_once or any(row.at_floor for row in points)) \
                    and law.least / REACH <= spp <= REACH * law.most:
                ratios.append(Ratio(paths=fmean(row.spp for row in points) / spp,
                                    seconds=median(getattr(row, clock) for row in points) / law.time.at(spp)))
    return ratios


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Geometric mean of values above 0 and the 95% interval of it; no interval, from 0 to inf, from fewer than two."""
    from scipy.special import stdtrit

    logs = np.log([value for value in values if value > 0])
    if len(logs) < 2:
        return geometric_mean(values), 0.0, float("inf")
    half = float(stdtrit(len(logs) - 1, 0.975)) * float(logs.std(ddof=1)) / sqrt(len(logs))
    middle = float(logs.mean())
    return float(np.exp(middle)), float(np.exp(middle - half)), float(np.exp(middle + half))


def scatter(rows: Sequence[AccuracyRow], clock: str) -> float:
    """Relative standard deviation of a time between runs of one setting, the median over settings: what a machine that
    does other things adds. NaN where nothing ran twice."""
    runs: dict[tuple[str, str, str, str], list[float]] = {}
    for row in rows:
        if row.question in QUESTIONS and isfinite(time := getattr(row, clock)):
            runs.setdefault((row.question, row.setting, row.example, row.layer), []).append(time)
    return median([float(np.std(times, ddof=1) / np.mean(times)) for times in runs.values()
                   if len(times) > 1 and np.mean(times) > 0] or [float("nan")])
