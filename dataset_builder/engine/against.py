"""What a build of a spec into a folder would run again, and what changed: from plans alone, before anything renders."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from dataset_builder.engine.made_by import plan_digest, versions
from dataset_builder.engine.unit import BuildJob
from dataset_builder.errors import PlanError, ShardError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.field_shelf import FieldTask, tasks_of
from dataset_builder.rendering.pass_inputs import Inputs, all_passes, field_inputs, inputs_of
from dataset_builder.shards.folder import Claim, require_ours
from dataset_builder.shards.published_examples import PublishedExamples
from dataset_builder.shards.reader import open_dataset

NEW, GONE = "new", "no longer kept"
"""Why a pass runs that the folder's dataset does not have, or has, but without the samples of it."""

FIELD = "field"
"""What the making of a field is called among passes."""

Place = tuple[str, int, int]
"""Seed of a view's sampling, number of the light, noise level: the same for one example whatever its key."""


@dataclass(kw_only=True)
class PassRuns:
    """How often a pass would run."""

    total: int = 0
    """Times that a build from nothing would run it."""
    runs: int = 0
    """Times that it has to run now."""
    changed: Counter[str] = field(default_factory=Counter)
    """What changed, in words, with the number of runs that it touches."""


@dataclass(frozen=True, kw_only=True)
class Against:
    """What a build would do with a folder as it is."""

    examples: int
    kept: int
    """Examples that are published already and stay as they are."""
    unplanned: int
    """Examples that cannot be planned."""
    passes: Mapping[str, PassRuns]


@dataclass(kw_only=True)
class _Count:
    """Counts what would run, by key: once, however many examples need it."""

    passes: dict[str, PassRuns] = field(default_factory=dict)
    known: set[str] = field(default_factory=set)
    running: set[str] = field(default_factory=set)

    def add(self, name: str, key: str) -> None:
        """An example has it."""
        self.passes.setdefault(name, PassRuns()).total += key not in self.known
        self.known.add(key)

    def run(self, name: str, key: str, changed: Callable[[], list[str]]) -> None:
        """An example that is to be made needs it, and no earlier build kept it."""
        if key not in self.running:
            self.running.add(key)
            self.passes[name].runs += 1
            self.passes[name].changed.update(changed())


def against(planner: Planner, folder: Path, job: BuildJob) -> Against:
    """Compare the plans of a whole dataset with what is published in `folder` and with the results that the job's store
    keeps. Raises ShardError where a dataset in the folder cannot be read, OutputError where a build would refuse it."""
    spec = planner.loaded.dataset
    require_ours(folder, Claim(name=spec.name, version=spec.version))
    made_by, memory = versions(job.backend, spec), job.memory
    published, old = PublishedExamples(folder), _plans_in(folder)
    shelf, root = job.fields, planner.loaded.path.parent
    count, kept, unplanned = _Count(), 0, 0
    for plan in _plans(planner):
        if plan is None:
            unplanned += 1
            continue
        same = plan_digest(plan, spec, made_by, job.denoised) in published
        kept += same
        before = old.get(_place(plan))
        for task in (task for task in tasks_of(plan) if task.field.kind != "own"):
            count.add(FIELD, key := shelf.key(task))
            if not same and not shelf.path(task, root).is_file():
                count.run(FIELD, key, partial(_changed_field, before, task))
        for name in all_passes(plan):
            count.add(name, key := memory.key(plan, name))
            if not same and not job.store.has(key):
                count.run(name, key, partial(_changed, before, name, inputs_of(plan, name)))
    return Against(examples=len(planner.examples), kept=kept, unplanned=unplanned, passes=count.passes)


def _plans(planner: Planner) -> Iterator[ExamplePlan | None]:
    for ref in planner.examples:
        try:
            yield planner.example(ref)
        except PlanError:
            yield None


def _plans_in(folder: Path) -> dict[Place, ExamplePlan]:
    """Plans of the published examples, but for those of another version of this package: nothing of them compares."""
    dataset, plans = open_dataset(folder, layers=[]), dict[Place, ExamplePlan]()
    for keys in dataset.splits.values():
        for key in keys:
            with suppress(ShardError):
                plan = dataset.label(key).plan
                plans[_place(plan)] = plan
    return plans


def _place(plan: ExamplePlan) -> Place:
    return plan.render.seed, plan.light, plan.rough.level


def _changed(before: ExamplePlan | None, name: str, inputs: Inputs) -> list[str]:
    """Topics in which a pass's inputs differ from what they were."""
    if before is None or name not in all_passes(before):
        return [NEW]
    were = inputs_of(before, name)
    return [topic for topic in inputs if inputs[topic] != were.get(topic)] or [GONE]


def _changed_field(before: ExamplePlan | None, task: FieldTask) -> list[str]:
    """Topics in which what a field is made from differs from what it was of the same kind."""
    inputs = field_inputs(task.object, task.field)
    were = [field_inputs(old.object, old.field) for old in (tasks_of(before) if before else ())
            if old.field.kind == task.field.kind]
    if not were:
        return [NEW]
    return [topic for topic in inputs if all(inputs[topic] != old[topic] for old in were)] or [GONE]
