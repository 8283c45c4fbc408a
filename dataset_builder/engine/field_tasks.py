"""Fields that a build needs: made before any view is rendered, measured, and refused with their figures."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from dataset_builder.engine.made_by import field_versions
from dataset_builder.engine.unit import BuildJob, Outcome, planner_of
from dataset_builder.errors import OutputError, UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.label.scene_plan import ObjectPlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.field_needs import FieldNeed, field_needs
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.field_shelf import NO_SHELF, FieldProgress, FieldShelf, FieldTask, tasks_of
from dataset_builder.shards.manifest import Rejected
from dataset_builder.spec.field import FieldGatesSpec

GATE = "field"
"""Gate that an example fails whose object no field shows well enough."""


@dataclass(frozen=True, kw_only=True)
class FieldNews:
    """Of one field: how far it is, or what became of it."""

    object: str
    """Name of the object that it is of."""
    kind: str
    key: str
    progress: FieldProgress | None = None
    """None once it is finished."""
    record: FieldRecord | None = None
    """Figures of a finished one."""
    failed: str = ""
    """Why there is none."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """That its images and its fit took."""


@dataclass(frozen=True, kw_only=True)
class NeededFields:
    """The fields that examples need, by their key."""

    tasks: Mapping[str, FieldTask]
    by_example: Mapping[ExampleRef, Mapping[str, FieldNeed]]

    @classmethod
    def of(cls, needs: Mapping[ExampleRef, Sequence[FieldNeed]], shelf: FieldShelf) -> "NeededFields":
        """Those of needs, whose keys are the shelf's."""
        distinct = dict.fromkeys(need for each in needs.values() for need in each)
        known = {need: shelf.key(_task(need)) for need in distinct}
        return cls(tasks={key: _task(need) for need, key in known.items()},
                   by_example={ref: {known[need]: need for need in each} for ref, each in needs.items()})


def make_fields(job: BuildJob, refs: Sequence[ExampleRef], wanted: frozenset[ExampleRef], *,
                run: Callable[..., Iterator[Any]], workers: int,
                told: Callable[[FieldNews], None]) -> Iterator[FieldNews | tuple[Outcome, ...]]:
    """Make the fields that examples need and that are missing, then refuse those of the `wanted` examples that a field
    fails.

    Yields news of each field as it is finished, those that were there first, then an outcome of every example that is
    refused, where any is. told: called with news on the way. Raises PlanError where splits share an object, OutputError
    as `run` and writing do.
    """
    planner, shelf = planner_of(job), job.fields
    root = planner.loaded.path.parent
    needed = NeededFields.of(field_needs(planner, refs), shelf)
    finished, missing = dict[str, FieldNews](), list[FieldTask]()
    for key, task in needed.tasks.items():
        if (file := shelf.find(task, root)) is not None:
            finished[key] = FieldNews(object=task.object.name, kind=task.field.kind, key=key, record=file.record)
        else:
            missing.append(task)
    yield from finished.values()
    for news in run(partial(make_one, job), missing, workers=min(workers, max(len(missing), 1)), told=told):
        finished[news.key] = news
        yield news
    if refused := tuple(outcome for outcome in refusals(needed, finished) if outcome.ref in wanted):
        yield refused


def make_one(job: BuildJob, task: FieldTask, told: Callable[[FieldNews], None]) -> FieldNews:
    """Make one field, in any process; what becomes of it."""
    # Verbs that render nothing import this module, too; they need not wait for Mitsuba
    from dataset_builder.rendering.field_maker import make_field

    activate(job.backend, job.threads)
    news = partial(FieldNews, object=task.object.name, kind=task.field.kind, key=job.fields.key(task))
    start, imaged = perf_counter(), 0.0

    def telling(progress: FieldProgress) -> None:
        nonlocal imaged
        imaged = perf_counter() - start if progress.stage == "images" else imaged
        told(news(progress=progress))

    try:
        made = make_field(task, job.fields, job.spec_path.parent, told=telling)
    except UserError as error:
        if isinstance(error, OutputError):
            raise
        return news(failed=str(error))
    return news(record=made.record, seconds={"images": imaged, "fit": perf_counter() - start - imaged})


def refusals(needed: NeededFields, finished: Mapping[str, FieldNews]) -> Iterator[Outcome]:
    """An outcome of every example with a field that there is none of, or that fails the gates of the spec."""
    for ref, needs in needed.by_example.items():
        found = [(key, need, finished[key]) for key, need in needs.items()]
        reasons = [reason for _, need, news in found for reason in faults(news, need.asked.gates)]
        if reasons:
            rejected = Rejected(key=ref.key, view=ref.view.name, gate=GATE, reason="; ".join(dict.fromkeys(reasons)))
            yield Outcome(ref=ref, rejected=rejected)


def faults(news: FieldNews, gates: FieldGatesSpec) -> list[str]:
    """What a finished field fails, in words."""
    if news.record is None:
        return [f"no {news.kind} field: {news.failed}"]
    said = {"psnr": ("dB over {} held-out images inside their masks", "{:.4g}"),
            "opacity_iou": ("of opacity and mask over {} held-out images", "{:.3g}")}
    return [f"{name}: expected at least {getattr(gates, name):g} {text.format(news.record.held_out)}, got "
            f"{digits.format(getattr(news.record, name))} ({news.kind} field of {news.object})"
            for name, (text, digits) in said.items() if getattr(news.record, name) < getattr(gates, name)]


def fields_known(job: BuildJob) -> Callable[[ObjectPlan, FieldPlan], bool]:
    """Which fields a job would find."""
    shelf = job.fields if planner_of(job).loaded.dataset.fields else NO_SHELF
    root = job.spec_path.parent
    return lambda target, plan: shelf.path(FieldTask(object=target, field=plan), root).is_file()


def _task(need: FieldNeed) -> FieldTask:
    return FieldTask(object=need.object, field=need.field)


def passing_shelf(plans: Sequence[ExamplePlan], mesh_root: Path, backend: str = "auto") -> FieldShelf:
    """The shelf of this process, for verbs that render without a dataset's folder: what plans need is made now, where
    none made it before, and is gone when the process ends. Raises UserError as `make_field` does."""
    from dataset_builder.rendering.field_maker import make_field

    tasks = [task for plan in plans for task in tasks_of(plan) if task.field.kind != "own"]
    if not tasks:
        return NO_SHELF
    shelf = FieldShelf(folder=Path(_passing_folder().name), made_by=field_versions(backend))
    for task in dict.fromkeys(tasks):
        make_field(task, shelf, mesh_root)
    return shelf


@cache
def _passing_folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="fields-")
