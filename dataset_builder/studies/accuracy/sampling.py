"""Questions 1 to 3: uniform spp, adaptive sampling, and denoising of both: errors, knees, and what is saved."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from dataset_builder.errors import UserError
from dataset_builder.layers import DENOISABLE, LAYERS
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.oidn import require
from dataset_builder.rendering.sampling.adaptive import BATCH_SIZES
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.curves import PRICE, Advice, curve, equal_error, knee
from dataset_builder.studies.accuracy.rows import (
    ADAPTIVE,
    ADAPTIVE_DENOISED,
    DENOISED,
    QUESTIONS,
    UNIFORM,
    AccuracyRow,
    layers_in,
)
from dataset_builder.studies.accuracy.workbench import Bench, Budget
from dataset_builder.studies.image_errors import geometric_mean


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One way to sample."""

    question: str
    name: str
    value: float
    """spp, or the error asked for."""
    overrides: tuple[str, ...]
    layers: tuple[str, ...]


def settings(bench: Bench) -> Iterator[Setting]:
    """All ways of the budget, cheapest first within each question."""
    budget, layers = bench.budget, tuple(bench.extents)
    smooth = tuple(layer for layer in layers if layer in DENOISABLE) if _denoiser_runs() else ()
    yield from _ways(bench, (UNIFORM, ADAPTIVE), budget.uniform, budget.goals, layers)
    if smooth:
        yield from _ways(bench, (DENOISED, ADAPTIVE_DENOISED), budget.denoised_spp, budget.denoised_goals, smooth,
                         ", denoised", f"render.denoise={{layers: [{', '.join(smooth)}]}}")


def _ways(bench: Bench, questions: tuple[str, str], counts: Sequence[int], goals: Sequence[float],
          layers: tuple[str, ...], suffix: str = "", *more: str) -> Iterator[Setting]:
    """Uniform sampling with each number of samples, and adaptive sampling with each goal. more: further overrides."""
    budget, (uniform, adaptive) = bench.budget, questions
    for spp in counts:
        yield Setting(question=uniform, name=f"{spp} spp{suffix}", value=spp, overrides=(bench.spp(spp), *more),
                      layers=layers)
    for goal in goals:
        asked = goal_override(dict.fromkeys(bench.extents, goal), budget.cap)
        yield Setting(question=adaptive, name=f"error {goal:g}{suffix}", value=goal, layers=layers,
                      overrides=(bench.spp(budget.first), asked, *more))


def _denoiser_runs() -> bool:
    """Whether there is a denoiser, which is an extra: without it the study goes without these curves."""
    try:
        require()
    except UserError:
        return False
    return True


def goal_override(goals: Mapping[str, float], cap: int) -> str:
    """The override that asks for an error by layer."""
    return "render.accuracy={" + ", ".join(f"{name}: {{error: {error:g}, cap: {cap}}}"
                                           for name, error in goals.items()) + "}"


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """Every setting on one example, each in every layer."""
    reference = bench.converged(ref)
    _compile_batches(bench, ref)
    for setting in settings(bench):
        plan = bench.plan(ref, *setting.overrides)
        found = bench.timed(setting.name, plan)
        yield from bench.compared(setting.question, setting.name, setting.value, found, reference, setting.layers)


def _compile_batches(bench: Bench, ref: ExampleRef) -> None:
    """Adaptive rounds choose among batch sizes, each with kernels of its own; a tiny picture may not meet them all."""
    batches = bench.spec.dataset.render.batches
    for size in [size for size in BATCH_SIZES if size * batches <= bench.budget.cap]:
        plan = bench.plan(ref, bench.spp(size * batches))
        bench.warm.up(f"{size} per batch", plan, bench.spec.mesh_root)


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
