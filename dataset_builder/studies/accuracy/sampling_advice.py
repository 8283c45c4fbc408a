"""What questions 1 to 3 say about a dataset: the settings for what was asked, and how surely they are these."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dataset_builder.seeding import rng
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.answers import Answer, Answers, AskedAccuracy
from dataset_builder.studies.accuracy.curves import Advice, curve
from dataset_builder.studies.accuracy.laws import equal_error, interval
from dataset_builder.studies.accuracy.rows import (
    ADAPTIVE,
    ADAPTIVE_DENOISED,
    DENOISED,
    OTHERS,
    UNIFORM,
    AccuracyRow,
    layers_in,
    of,
)
from dataset_builder.studies.accuracy.sampling import goal_override
from dataset_builder.studies.accuracy.workbench import spp_override

JITTER, RESAMPLED = 0.05, 100
"""Standard deviation of the logarithm of made-up noise of timings, and how often it is drawn."""


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec, answers: Answers, answer: Answer | None,
           clock: str) -> None:
    """Sentences of the curves, and the overrides of the answer.

    Denoising is never among the overrides: it trades noise for bias, which is for users to choose.
    """
    for question in (ADAPTIVE, DENOISED, ADAPTIVE_DENOISED):
        ratios = equal_error(rows, answers.laws, question, clock)
        said = " and ".join(_ratio([getattr(one, name) for one in ratios], text)
                            for name, text in (("seconds", "time"), ("paths", "paths")))
        cost = (f"reaches the error of uniform spp at {said} (geometric means of {len(ratios)} comparisons, with 95% "
                "intervals)" if ratios else "has no point whose error uniform spp reaches near what was measured")
        if of(rows, question):
            advice.sentences[question] = f"{NAMES[question]} {cost}."
    for question in (DENOISED, ADAPTIVE_DENOISED):
        points = {layer: curve(rows, question, layer) for layer in layers_in(rows, question)}
        ends = ", ".join(f"{layer} from {own[0].error:.1%} to {own[-1].error:.1%}" for layer, own in points.items())
        if ends:
            advice.sentences[question] += f" Along the curve the error goes: {ends}. The rest is bias, so denoising " \
                                          "is never recommended."
    if not answer:
        return
    advice.noise.update({layer: limit for layer, (_, limit) in answer.errors.items()})
    first = {name: float(answers.first) for name in answer.spp} if answer.goals else answer.spp
    advice.overrides.append(spp_override(spec.render, first))
    advice.overrides.append(goal_override(answer.goals, answer.cap))


NAMES = {UNIFORM: "Uniform spp", ADAPTIVE: "Adaptive sampling", DENOISED: "Denoising",
         ADAPTIVE_DENOISED: "Denoising of adaptive sampling"}


def _ratio(values: Sequence[float], what: str) -> str:
    middle, low, high = interval(values)
    return f"{middle:.2f} times the {what}" + (f" ({low:.2f} to {high:.2f})" if math.isfinite(high) else "")


def answer_of(answers: Answers, asked: AskedAccuracy, workers: int) -> Answer | None:
    """The answer to what was asked; None where nothing measured gets there."""
    return answers.of_hours(asked, workers)[0] if asked.hours else answers.of_errors(asked)


def changed_share(rows: Sequence[AccuracyRow], again: Callable[[Sequence[AccuracyRow]], Answers], asked: AskedAccuracy,
                  workers: int, times: int = RESAMPLED) -> float:
    """Share of resamplings of all timings, each off by a factor exp(0.05 N(0, 1)), in which the settings change."""
    def settings(own: Sequence[AccuracyRow]) -> tuple[object, ...]:
        answer = answer_of(again(own), asked, workers)
        return (answer.way, *sorted(answer.spp.items()), *sorted(answer.goals.items())) if answer else ()

    timed = [row for row in rows if row.question in (UNIFORM, ADAPTIVE, OTHERS)]
    found, random = settings(timed), rng(0, "timings")
    changed = 0
    for _ in range(times):
        factors = np.exp(random.normal(0, JITTER, (len(timed), 2))).tolist()
        changed += found != settings([replace(row, seconds=row.seconds * wall, cpu_seconds=row.cpu_seconds * cpu)
                                      for row, (wall, cpu) in zip(timed, factors, strict=True)])
    return changed / times
