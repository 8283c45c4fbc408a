"""What an example costs by every mix: seconds of the processor, measured on a few examples, mix by mix in turn.

Seconds of the processor, of all threads together, depend little on what else the machine does, while wall time does. On
a GPU the processor waits for it, and wall time counts. The least of a few repetitions holds planning, meshes, every
pass, denoising and encoding, but neither the compilation of kernels nor what a build does once.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from statistics import fmean, stdev
from time import perf_counter, process_time

from dataset_builder.digest import digest
from dataset_builder.engine.unit import example_of
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.effects.light_left import LEFT
from dataset_builder.processes import cores
from dataset_builder.rendering.backend import activate, default_workers
from dataset_builder.shards.example import encode_members, preview
from dataset_builder.studies.budget.arms import Mix
from dataset_builder.studies.budget.budget_study import BudgetStudy
from dataset_builder.studies.comma_separated import read_csv, write_csv
from dataset_builder.studies.renders import REPEATS, STEADY, Warm, pixel_versions, render
from dataset_builder.studies.sampled import StudySpec
from dataset_builder.studies.trainings import EXACT, about, claim

COSTS = "costs.csv"
COLUMNS = ("example", "mix", "seconds", "wall_seconds")
SPREAD = 16
"""Examples of the training split among which those to be timed are spread."""


@dataclass(frozen=True, kw_only=True)
class CostRow:
    """One example by one mix."""

    example: str
    mix: str
    seconds: float
    """Of the processor; on a GPU of the clock."""
    wall_seconds: float


@dataclass(frozen=True, kw_only=True)
class RenderCost:
    """Seconds of an example, mean over those timed."""

    seconds: float
    error: float
    """Standard error; 0 of one example."""
    examples: int

    @classmethod
    def of(cls, rows: list[float]) -> "RenderCost":
        """From the seconds of every example."""
        error = stdev(rows) / sqrt(len(rows)) if len(rows) > 1 else 0.0
        return cls(seconds=fmean(rows), error=error, examples=len(rows))


def costs_of(study: BudgetStudy, rows: list[CostRow]) -> dict[Mix, RenderCost]:
    """By mix, in the study's order."""
    return {mix: RenderCost.of([row.seconds for row in rows if row.mix == mix.name]) for mix in study.mixes}


def cores_had(rows: list[CostRow]) -> float:
    """Seconds of the processor in a second of the clock: below 1 the machine was busy with other work."""
    return sum(row.seconds for row in rows) / sum(row.wall_seconds for row in rows)


def measure(study: BudgetStudy) -> Iterator[CostRow]:
    """Time every mix on every example, or take what an earlier run measured. Raises UserError as planning does."""
    # As many threads as a process of the build has
    backend = activate(study.backend, max(1, cores() // (study.workers or default_workers(study.backend))))
    mixes = {mix.name: mix for mix in study.mixes}
    every = StudySpec(path=study.spec, overrides=study.train_settings(study.mixes[0], SPREAD))
    refs = every.sample(study.size.timed)
    specs = {name: StudySpec(path=study.spec, overrides=study.train_settings(mix, SPREAD))
             for name, mix in mixes.items()}
    identity = digest({"plans": [specs[name].plan(ref).model_dump(mode="json") for ref in refs for name in mixes],
                       "versions": pixel_versions(study.backend)})
    folder, path = study.out / "costs", study.out / "costs" / COSTS
    if not about(folder, identity):
        path.unlink(missing_ok=True)
        claim(folder, identity)
    rows = _read(path)
    yield from rows
    done, warm = {(row.example, row.mix) for row in rows}, Warm()
    for ref in refs:
        planning = _planning(every, ref)
        for name, spec in specs.items():
            if (ref.key, name) not in done:
                plan = spec.plan(ref)
                warm.up(name, plan, spec.mesh_root)
                seconds = _least(plan, spec, on_gpu="cuda" in backend.variant)
                rows.append(CostRow(example=ref.key, mix=name, seconds=seconds[0] + planning, wall_seconds=seconds[1]))
                write_csv(path, COLUMNS, ([getattr(row, column) for column in COLUMNS] for row in rows),
                          digits=EXACT)
                yield rows[-1]


def _planning(spec: StudySpec, ref: ExampleRef) -> float:
    """Seconds that an example takes to plan, once what all examples share is loaded: what its own view needs counts."""
    planner = spec.planner()
    planner.example(ref)
    LEFT.cache_clear()
    begin = process_time()
    planner.example(ref)
    return process_time() - begin


def _least(plan: ExamplePlan, spec: StudySpec, *, on_gpu: bool) -> tuple[float, float]:
    """The least of up to `REPEATS` runs, until one saves next to nothing; what else the machine does only adds."""
    found = _spent(plan, spec, on_gpu=on_gpu)
    for _ in range(REPEATS - 1):
        before, again = found, _spent(plan, spec, on_gpu=on_gpu)
        found = min(before, again)
        if again[0] >= STEADY * before[0]:
            break
    return found


def _spent(plan: ExamplePlan, spec: StudySpec, *, on_gpu: bool) -> tuple[float, float]:
    """Seconds that count, and those of the clock, from a plan to what is stored of it."""
    begin = process_time(), perf_counter()
    found = render(plan, spec.mesh_root)
    encode_members(example_of(found), dtype=spec.dataset.storage.dtype, preview_png=preview(found.layers))
    wall = perf_counter() - begin[1]
    return wall if on_gpu else process_time() - begin[0], wall


def _read(path: Path) -> list[CostRow]:
    try:
        return [CostRow(example=line["example"], mix=line["mix"], seconds=float(line["seconds"]),
                        wall_seconds=float(line["wall_seconds"])) for line in read_csv(path)]
    except (FileNotFoundError, KeyError, ValueError):
        return []
