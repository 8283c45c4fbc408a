"""Questions 1 to 3: uniform spp, adaptive sampling, and denoising of both."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from dataset_builder.errors import UserError
from dataset_builder.layers import DENOISABLE
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.oidn import require
from dataset_builder.rendering.sampling.adaptive import BATCH_SIZES
from dataset_builder.studies.accuracy.rows import ADAPTIVE, ADAPTIVE_DENOISED, DENOISED, UNIFORM, AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench
from dataset_builder.studies.renders import render
from dataset_builder.studies.sampled import reseeded


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
    """Every setting on one example, several times with other samples, each in every layer."""
    reference = bench.converged(ref)
    _compile_batches(bench, ref)
    ways = [(setting, bench.plan(ref, *setting.overrides)) for setting in settings(bench)]
    for setting, plan in ways:
        bench.warm.up(setting.name, plan, bench.spec.mesh_root)
    # In turns, so that whatever else the machine does for a while falls on all settings
    for run in range(bench.budget.runs):
        for setting, plan in ways:
            found = render(reseeded(plan, "run", run), bench.spec.mesh_root)
            for row in bench.compared(setting.question, setting.name, setting.value, found, reference, setting.layers):
                yield replace(row, replicate=run)


def _compile_batches(bench: Bench, ref: ExampleRef) -> None:
    """Adaptive rounds choose among batch sizes, each with kernels of its own; a tiny picture may not meet them all."""
    batches = bench.spec.dataset.render.batches
    for size in [size for size in BATCH_SIZES if size * batches <= bench.budget.cap]:
        plan = bench.plan(ref, bench.spp(size * batches))
        bench.warm.up(f"{size} per batch", plan, bench.spec.mesh_root)
