"""Questions 1 to 3: uniform spp, adaptive sampling, and denoising of both, against converged references."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dataset_builder.errors import UserError
from dataset_builder.layers import DENOISABLE
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.oidn import require
from dataset_builder.rendering.sampling.adaptive import BATCH_SIZES
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench

UNIFORM, ADAPTIVE = "uniform", "adaptive"
DENOISED, ADAPTIVE_DENOISED = "uniform-denoised", "adaptive-denoised"
QUESTIONS = (UNIFORM, ADAPTIVE, DENOISED, ADAPTIVE_DENOISED)


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
    denoise = denoise_override(smooth)
    for spp in budget.uniform:
        yield Setting(question=UNIFORM, name=f"{spp} spp", value=spp, overrides=(bench.spp(spp),), layers=layers)
    for goal in budget.goals:
        yield Setting(question=ADAPTIVE, name=f"error {goal:g}", value=goal, layers=layers,
                      overrides=(bench.spp(budget.first), goal_override(dict.fromkeys(layers, goal), budget.cap)))
    if not smooth:
        return
    for spp in budget.denoised_spp:
        yield Setting(question=DENOISED, name=f"{spp} spp, denoised", value=spp, layers=smooth,
                      overrides=(bench.spp(spp), denoise))
    for goal in budget.denoised_goals:
        yield Setting(question=ADAPTIVE_DENOISED, name=f"error {goal:g}, denoised", value=goal, layers=smooth,
                      overrides=(bench.spp(budget.first), goal_override(dict.fromkeys(layers, goal), budget.cap),
                                 denoise))


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


def denoise_override(layers: tuple[str, ...]) -> str:
    """The override that denoises layers."""
    return f"render.denoise={{layers: [{', '.join(layers)}]}}"


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
