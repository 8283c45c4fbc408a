"""Questions 1 to 3: where the knees are, what adaptive sampling saves, and what denoising does."""

import math
from collections.abc import Mapping, Sequence

from dataset_builder.layers import LAYERS
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.curves import PRICE, Advice, curve, equal_error, knee
from dataset_builder.studies.accuracy.rows import AccuracyRow, layers_in
from dataset_builder.studies.accuracy.sampling import (
    ADAPTIVE,
    ADAPTIVE_DENOISED,
    DENOISED,
    QUESTIONS,
    UNIFORM,
    goal_override,
)
from dataset_builder.studies.accuracy.workbench import Budget
from dataset_builder.studies.image_errors import geometric_mean


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec, budget: Budget) -> None:
    """Knees of every curve; adaptive goals where they cost less than uniform spp, else spp.

    Denoising is never among the overrides: it trades noise for bias, which is for users to choose.
    """
    for question in QUESTIONS:
        for layer in layers_in(rows, question):
            if point := knee(curve(rows, question, layer)):
                advice.marked[question, layer] = point
    _uniform(advice)
    ratio = _adaptive(advice, rows)
    for question in (DENOISED, ADAPTIVE_DENOISED):
        _denoised(advice, rows, question)
    _choose(advice, spec, budget, adaptive=ratio < 1)


def _uniform(advice: Advice) -> None:
    knees = advice.marks(UNIFORM)
    if knees:
        points = ", ".join(f"{point.value:.0f} spp for {layer} (error {point.error:.1%}, {point.seconds:.2g} s)"
                           for layer, point in knees.items())
        advice.sentences[UNIFORM] = f"The knee is at {points}: beyond it, halving the error takes at least {PRICE} " \
                                    "times as long."


def _adaptive(advice: Advice, rows: Sequence[AccuracyRow]) -> float:
    """The sentence, and the time that adaptive sampling takes for uniform's error; inf where that is not known."""
    ratios = equal_error(rows)
    if not ratios:
        return math.inf
    seconds, paths = (geometric_mean(getattr(ratio, name) for ratio in ratios) for name in ("seconds", "paths"))
    advice.sentences[ADAPTIVE] = (
        f"For the same error, adaptive sampling takes {seconds:.2f} times the time and {paths:.2f} times the paths of "
        f"uniform spp (geometric means of {len(ratios)} comparisons).")
    return seconds


def _denoised(advice: Advice, rows: Sequence[AccuracyRow], question: str) -> None:
    points = {layer: curve(rows, question, layer) for layer in layers_in(rows, question)}
    if not points:
        return
    ratios = equal_error(rows, question)
    seconds = geometric_mean(ratio.seconds for ratio in ratios)
    cost = (f"at {seconds:.2f} times the time (geometric mean of {len(ratios)} comparisons)" if ratios
            else "at no setting within the measured range")
    ends = ", ".join(f"{layer} from {own[0].error:.1%} to {own[-1].error:.1%}" for layer, own in points.items())
    advice.sentences[question] = (f"The denoised pictures have the error of uniform spp {cost}; along the curve the "
                                  f"error goes: {ends}. The rest is bias, so denoising is never recommended.")


def _choose(advice: Advice, spec: DatasetSpec, budget: Budget, *, adaptive: bool) -> None:
    chosen = advice.marks(ADAPTIVE if adaptive else UNIFORM)
    if not chosen:
        return
    advice.noise.update({layer: point.error for layer, point in chosen.items()})
    first = dict.fromkeys(chosen, budget.first)
    advice.overrides.append(spp_line(spec, first if adaptive else {
        layer: round(point.value) for layer, point in chosen.items()}))
    goals = {layer: point.value for layer, point in chosen.items()} if adaptive else {}
    advice.overrides.append(goal_override(goals, budget.cap))


def spp_line(spec: DatasetSpec, wanted: Mapping[str, int]) -> str:
    """spp of each pass: the most that one of its layers wants, in whole batches; its own where none was studied."""
    own, batches = spec.render.spp, spec.render.batches
    chosen = {"first_hit": own.first_hit, "source": own.source, "target": own.target, "rough": own.rough}
    for name in chosen:
        if wishes := [spp for layer, spp in wanted.items() if LAYERS[layer].render_pass == name]:
            chosen[name] = math.ceil(max(wishes) / batches) * batches
    return "render.spp={" + ", ".join(f"{name}: {spp}" for name, spp in chosen.items()) + "}"
