"""Build a dataset: decide keep or build per shard, run the missing views, publish each shard when its examples are
there."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from dataset_builder.byte_store import CACHE_SIZE, require_store
from dataset_builder.digest import digest
from dataset_builder.engine import local
from dataset_builder.engine.calibration import calibrate
from dataset_builder.engine.dataset_part import DatasetPart, PartRecord, known_outcomes, parts_of, write_record
from dataset_builder.engine.field_tasks import FieldNews, make_fields
from dataset_builder.engine.finishing import Progress, finish, let_go, publish_task, require_examples
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.one_backend import OneBackend
from dataset_builder.engine.outcomes import Rejections, Timings
from dataset_builder.engine.shard_tasks import OpenShards, decide, shard_tasks, split_digests
from dataset_builder.engine.unit import BuildJob, Outcome, run_unit
from dataset_builder.engine.unit_limits import UnitLimits
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.files import exhaustion_errors, require_space
from dataset_builder.label.example_label import Denoised
from dataset_builder.planning.catalogue import ExampleRef, units
from dataset_builder.planning.cost import expected_bytes
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import probe
from dataset_builder.processes import cores
from dataset_builder.rendering import oidn
from dataset_builder.rendering.backend import default_workers
from dataset_builder.rendering.scene.image_check import check_images
from dataset_builder.shards.folder import Claim, require_ours
from dataset_builder.shards.manifest import Manifest, Rejected
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import Again, whole_shards
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.resolve import LoadedSpec

Run = Callable[..., Iterator[Any]]
"""An engine: `engine.local.run`, or what keeps its promises."""

@dataclass(frozen=True, kw_only=True)
class Event:
    """News of a build."""

    wanted: int | None = None
    """How many examples there are to make: the first event of all."""
    splits: Mapping[str, int] | None = None
    """How many of them each split has."""
    workers: int = 1
    """How many processes render, told with it."""
    denoised: tuple[Denoised, ...] = ()
    """How far denoised layers may be trusted."""
    field: FieldNews | None = None
    """Of one field that is finished."""
    outcomes: tuple[Outcome, ...] = ()
    """Of the examples of one unit."""
    shard: ShardIndex | None = None
    """One that was published."""
    manifest: Manifest | None = None
    """Of the finished dataset."""
    part: PartRecord | None = None
    """Of the finished part."""


def build(loaded: LoadedSpec, folder: Path, *, backend: str = "auto", workers: int | None = None,
          only: Sequence[int] = (), part: DatasetPart | None = None, replace_other: bool = False,
          cache: Path | None = None, cache_size: int = CACHE_SIZE,
          told: Callable[[FieldNews], None] = lambda news: None, run: Run = local.run, staging_url: str = "",
          unit_limit: float | None = None, again: Again | None = None) -> Iterator[Event]:
    """Build `loaded` into `folder`, yielding news, first of all how many examples there are to make.

    backend: auto | cuda | llvm. workers: processes that render, None for one per core, or a single one on a GPU.
    `only`: indices of examples to stage, without publishing anything; part: the same of one part of them all, with a
    record for `merge.merge`. `replace_other`: another dataset or major version in `folder` may go, and examples of
    another backend. What was there before stays until this dataset is whole. cache, cache_size: folder for what passes
    find, so that an edit repeats only the passes that it touches (`.build/passes` in the output folder where none is
    given), and most bytes that it may hold; 0 keeps nothing. run: the engine, `local.run` or another that keeps its
    promises. staging_url: where finished examples wait for their shard, for engines of several machines; in the output
    folder where none is given. unit_limit: seconds that a unit may take, 0 for any, `UnitLimits` unless given; without
    it a single worker is this process, in which nothing is watched. again: the dataset that must come out.

    Raises PlanError where nothing can be planned or an index is none, ShardError where another dataset than `again`
    comes out, OutputError where the folder or the disk refuses, or processes die again and again; in all cases what was
    finished is kept, and a second run goes on from there.
    """
    claim = Claim(name=loaded.dataset.name, version=loaded.dataset.version)
    require_ours(folder, claim, replace=replace_other)
    if cache:
        require_store(cache, folder)
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise UserError(f"workers: expected a whole number >= 1, or None for one per core, got {workers!r}")
    workers = workers or default_workers(backend)
    job = BuildJob.of(loaded, folder, backend=backend, threads=max(1, cores() // workers), cache=cache,
                      cache_size=cache_size, staging_url=staging_url)
    if part and staging_url:
        raise UserError("--staging: a part keeps its examples in its own folder, for `merge`; leave it out")
    denoise, publishes = bool(loaded.dataset.render.denoise.layers), not only and part is None
    if denoise:
        oidn.require()
    planner = Planner(loaded)
    if workers > 1 or unit_limit is not None:
        run = partial(run, limit=UnitLimits(spec=loaded.dataset, fixed=unit_limit))
    chosen = _chosen(planner, only, part)
    keys = {ref.key for ref in chosen}
    check_images(loaded)
    probe(planner)
    made_by = versions(job.backend, loaded.dataset)
    if not folder.exists():
        # Refused before anything is made
        _require_space(job, loaded.dataset, len(chosen))
    with exhaustion_errors(folder), build_lock(folder, claim, replace=replace_other):
        digests = split_digests(planner.examples, loaded)
        rejections, timings = Rejections(folder, digest(digests), made_by), Timings(folder)
        rejections.known |= {item.key: item for item in again.rejected} if again else {}
        known, tasks = dict(rejections.known), shard_tasks(planner.examples, loaded.dataset, digests)
        backends = OneBackend(folder, tasks, made_by)
        # A part is staged whole, whatever is published in its folder
        tasks = decide(tasks, () if part else backends.watched(whole_shards(folder)), made_by, known)
        backends.require(replace_other)
        missing = [task for task in tasks if not task.keep]
        open_shards = OpenShards(missing, known)
        progress = Progress(rejected=dict(known), shards={task.slot: task.keep for task in tasks if task.keep})
        wanted = [ref for task in missing for ref in task.examples if ref in chosen]
        _require_space(job, loaded.dataset, len(wanted))
        yield Event(wanted=len(wanted), splits=Counter(ref.view.pair.split for ref in wanted), workers=workers)
        if part and (staged := known_outcomes(folder, part, loaded.spec_digest, made_by, wanted)):
            progress.add(staged)
            yield Event(outcomes=tuple(staged))
            wanted = [ref for ref in wanted if ref.key not in progress.digests]
        # Denoised layers are measured on examples of the whole dataset
        needing = [ref for ref in (planner.examples if denoise else wanted) if ref.key not in known]
        for event in make_fields(job, needing, frozenset(wanted), run=run, workers=workers, told=told):
            if isinstance(event, FieldNews):
                timings.add_field(event)
                yield Event(field=event)
            else:
                # A shard that is complete by refusals alone has no example
                list(open_shards.settle(_note(event, progress, rejections)))
                yield Event(outcomes=event)
        wanted = [ref for ref in wanted if ref.key in known or ref.key not in progress.rejected]
        if denoise:
            known_figures = again.denoised if again else ()
            job = replace(job, denoised=known_figures or calibrate(loaded, job, made_by, run=run, workers=workers))
            yield Event(denoised=job.denoised)
        try:
            if publishes:
                # Fields may have been refused by then: hours of rendering would end with the same words
                require_examples(tasks, progress.rejected)
            for outcomes in _outcomes(wanted, job, partial(run, workers=workers), known):
                settled = _note(outcomes, progress, rejections)
                timings.add(outcomes)
                yield Event(outcomes=tuple(outcomes))
                for task in open_shards.settle(settled) if publishes else ():
                    if index := publish_task(task, folder, loaded, made_by, progress, job.staging):
                        yield Event(shard=index)
                    let_go(task, job.staging, progress)
        finally:
            timings.write()
            job.store.trim()
        if publishes:
            yield Event(manifest=finish(tasks, folder, planner, progress, job.denoised, again))
            job.staging.clear()
        elif part:
            yield Event(part=write_record(folder, part, loaded.spec_digest, made_by, job.denoised, progress.digests,
                                          [item for key, item in progress.rejected.items() if key in keys]))


def _chosen(planner: Planner, only: Sequence[int], part: DatasetPart | None) -> frozenset[ExampleRef]:
    """The examples of these indices, of a part, or all. Raises PlanError for every index that is none."""
    examples = planner.examples
    if part:
        if only:
            raise UserError("--part: expected a part or single examples, got both")
        return frozenset(ref for found, unit in parts_of(planner.loaded.dataset, examples, part.of) if found == part
                         for ref in unit.examples)
    if wrong := [index for index in only if not 0 <= index < len(examples)]:
        bounds = f"expected an example in [0, {len(examples)})"
        raise PlanError(Problem(where="", path="example", rule=f"{bounds}, got {index}") for index in wrong)
    return frozenset(examples[index] for index in only) if only else frozenset(examples)


def _require_space(job: BuildJob, spec: DatasetSpec, count: int) -> None:
    """Raise OutputError where the disk will not hold `count` more examples, and the copies of one shard's meanwhile."""
    here = job.staging.here
    copies, staged = (min(spec.storage.examples_per_shard, count), job.staging.size()) if here else (0, 0)
    require_space(job.folder, max(expected_bytes(spec, count, staged=copies) - staged, 0))


def _outcomes(wanted: Sequence[ExampleRef], job: BuildJob, run: Run,
              rejected: Mapping[str, Rejected]) -> Iterator[Sequence[Outcome]]:
    """What is known of the wanted examples, then what becomes of the others, view by view."""
    if known := [Outcome(ref=ref, rejected=rejected[ref.key], kept=True) for ref in wanted if ref.key in rejected]:
        yield known
    others = units(ref for ref in wanted if ref.key not in rejected)
    yield from run(partial(run_unit, job), others)


def _note(outcomes: Sequence[Outcome], progress: Progress, rejections: Rejections) -> list[ExampleRef]:
    """Take note of outcomes; the examples that nothing was known of before."""
    rejections.add([outcome.rejected for outcome in outcomes if outcome.rejected and not outcome.kept])
    return progress.add(outcomes)
