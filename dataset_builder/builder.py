"""Build a dataset: decide keep or build per shard, run the missing views, publish each shard when its examples are
there."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from dataset_builder import __version__
from dataset_builder.byte_store import CACHE_SIZE, require_store
from dataset_builder.digest import digest
from dataset_builder.engine import local
from dataset_builder.engine.calibration import calibrate
from dataset_builder.engine.field_tasks import FieldNews, make_fields
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.one_backend import OneBackend
from dataset_builder.engine.outcomes import Rejections, Timings
from dataset_builder.engine.shard_tasks import OpenShards, ShardTask, decide, shard_tasks, split_digests
from dataset_builder.engine.unit import BuildJob, Outcome, run_unit
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.files import require_space
from dataset_builder.label.example_label import Denoised
from dataset_builder.planning.catalogue import ExampleRef, units
from dataset_builder.planning.cost import expected_bytes
from dataset_builder.planning.plan import Planner, layers_asked
from dataset_builder.planning.precheck import probe
from dataset_builder.planning.scene.sources import object_sources
from dataset_builder.processes import cores
from dataset_builder.rendering import oidn
from dataset_builder.rendering.backend import choose
from dataset_builder.rendering.scene.image_check import check_images
from dataset_builder.shards.field_summary import field_summaries, labels_of
from dataset_builder.shards.folder import Claim, build_lock, require_ours
from dataset_builder.shards.manifest import Manifest, Rejected, make_manifest, with_shards
from dataset_builder.shards.publish import publish_dataset, whole_shards
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import publish_shard
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.own_fields import has_fields
from dataset_builder.spec.resolve import LoadedSpec

Run = Callable[..., Iterator[Any]]
"""An engine: `engine.local.run`, or what keeps its promises."""

MAX_REASONS = 5
"""Reasons that are told where every example of a split was rejected."""


@dataclass(frozen=True, kw_only=True)
class Event:
    """News of a build."""

    wanted: int | None = None
    """How many examples there are to make: the first event of all."""
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


@dataclass(kw_only=True)
class _Progress:
    """What is known so far."""

    digests: dict[str, str] = field(default_factory=dict)
    """Of the finished examples of shards that are open, by key."""
    rejected: dict[str, Rejected]
    """By key."""
    shards: dict[str, ShardRecord]
    """Finished ones, by slot."""
    open: OpenShards


def build(loaded: LoadedSpec, folder: Path, *, backend: str = "auto", workers: int | None = None,
          only: Sequence[int] = (), replace_other: bool = False, cache: Path | None = None,
          cache_size: int = CACHE_SIZE, told: Callable[[FieldNews], None] = lambda news: None,
          run: Run = local.run) -> Iterator[Event]:
    """Build `loaded` into `folder`, yielding news, first of all how many examples there are to make.

    backend: auto | cuda | llvm. workers: processes that render, None for one per core, or a single one on a GPU.
    `only`: indices of examples to stage, without publishing anything. `replace_other`: another dataset or major version
    in `folder` may go, and examples of another backend. What was there before stays until this dataset is whole. cache,
    cache_size: folder for what passes find, so that an edit repeats only the passes that it touches (`.build/passes` in
    the output folder where none is given), and most bytes that it may hold; 0 keeps nothing. run: the engine,
    `local.run` or another that keeps its promises. Raises PlanError where nothing can be planned or an index is none,
    OutputError where the folder or the disk refuses; in both cases what was finished is kept, and a second run goes on
    from there.
    """
    claim = Claim(name=loaded.dataset.name, version=loaded.dataset.version)
    require_ours(folder, claim, replace=replace_other)
    if cache:
        require_store(cache, folder)
    if workers is not None and (not isinstance(workers, int) or workers < 1):
        raise UserError(f"workers: expected a whole number >= 1, or None for one per core, got {workers!r}")
    workers = workers or (1 if choose(backend).variant.startswith("cuda") else cores())
    job = BuildJob.of(loaded, folder, backend=backend, threads=max(1, cores() // workers), cache=cache,
                      cache_size=cache_size)
    denoise = bool(loaded.dataset.render.denoise.layers)
    if denoise:
        oidn.require()
    planner = Planner(loaded)
    chosen = _chosen(planner.examples, only)
    check_images(loaded)
    probe(planner)
    made_by = versions(job.backend, loaded.dataset)
    if not folder.exists():
        # Refused before anything is made
        _require_space(folder, loaded.dataset, len(chosen))
    with build_lock(folder, claim, replace=replace_other):
        digests = split_digests(planner.examples, loaded)
        rejections, timings = Rejections(folder, digest(digests), made_by), Timings(folder)
        known, tasks = dict(rejections.known), shard_tasks(planner.examples, loaded.dataset, digests)
        backends = OneBackend(folder, tasks, made_by)
        tasks = decide(tasks, backends.watched(whole_shards(folder)), made_by, known)
        backends.require(replace_other)
        missing = [task for task in tasks if not task.keep]
        progress = _Progress(rejected=dict(known), open=OpenShards(missing, known),
                             shards={task.slot: task.keep for task in tasks if task.keep})
        wanted = [ref for task in missing for ref in task.examples if ref in chosen]
        _require_space(folder, loaded.dataset, len(wanted))
        yield Event(wanted=len(wanted))
        # Denoised layers are measured on examples of the whole dataset
        needing = [ref for ref in (planner.examples if denoise else wanted) if ref.key not in known]
        for event in make_fields(job, needing, frozenset(wanted), run=run, workers=workers, told=told):
            if isinstance(event, FieldNews):
                timings.add_field(event)
                yield Event(field=event)
            else:
                _note(event, progress, rejections)
                yield Event(outcomes=event)
        wanted = [ref for ref in wanted if ref.key in known or ref.key not in progress.rejected]
        if denoise:
            job = replace(job, denoised=calibrate(loaded, job, made_by, run=run, workers=workers))
            yield Event(denoised=job.denoised)
        try:
            if not only:
                # Fields may have been refused by then: hours of rendering would end with the same words
                _require_examples(tasks, progress.rejected)
            for outcomes in _outcomes(wanted, job, partial(run, workers=workers), known):
                done = _note(outcomes, progress, rejections)
                timings.add(outcomes)
                yield Event(outcomes=tuple(outcomes))
                for task in [] if only else done:
                    yield from _publish(task, folder, loaded, made_by, progress)
        finally:
            timings.write()
            job.store.trim()
        if not only:
            yield Event(manifest=_finish(tasks, folder, planner, progress, job.denoised))


def _chosen(examples: Sequence[ExampleRef], only: Sequence[int]) -> frozenset[ExampleRef]:
    """The examples of these indices, or all. Raises PlanError for every index that is none."""
    if wrong := [index for index in only if not 0 <= index < len(examples)]:
        bounds = f"expected an example in [0, {len(examples)})"
        raise PlanError(Problem(where="", path="example", rule=f"{bounds}, got {index}") for index in wrong)
    return frozenset(examples[index] for index in only) if only else frozenset(examples)


def _require_space(folder: Path, spec: DatasetSpec, count: int) -> None:
    """Raise OutputError where the disk will not hold `count` more examples, and the copies of one shard's meanwhile."""
    copies = min(spec.storage.examples_per_shard, count)
    require_space(folder, max(expected_bytes(spec, count, staged=copies) - Staging(folder).size(), 0))


def _outcomes(wanted: Sequence[ExampleRef], job: BuildJob, run: Run,
              rejected: Mapping[str, Rejected]) -> Iterator[Sequence[Outcome]]:
    """What is known of the wanted examples, then what becomes of the others, view by view."""
    if known := [Outcome(ref=ref, rejected=rejected[ref.key], kept=True) for ref in wanted if ref.key in rejected]:
        yield known
    others = units(ref for ref in wanted if ref.key not in rejected)
    yield from run(partial(run_unit, job), others)


def _note(outcomes: Sequence[Outcome], progress: _Progress, rejections: Rejections) -> list[ShardTask]:
    """Take note of outcomes; the shards that are complete by them."""
    news = [outcome.ref for outcome in outcomes
            if outcome.ref.key not in progress.digests and outcome.ref.key not in progress.rejected]
    for outcome in outcomes:
        if outcome.rejected:
            progress.rejected[outcome.ref.key] = outcome.rejected
        else:
            progress.digests[outcome.ref.key] = outcome.digest
    rejections.add([outcome.rejected for outcome in outcomes if outcome.rejected and not outcome.kept])
    return list(progress.open.settle(news))


def _publish(task: ShardTask, folder: Path, loaded: LoadedSpec, made_by: dict[str, str],
             progress: _Progress) -> Iterator[Event]:
    """Make one shard and let its staged examples go; a shard whose examples were all rejected is none."""
    examples = [(ref.key, progress.digests.pop(ref.key)) for ref in task.examples if ref.key in progress.digests]
    if not examples:
        return
    index = publish_shard(folder, slot=task.slot, split=task.split, examples=examples, spec_digest=task.spec_digest,
                          versions=made_by, share=loaded.dataset.storage.shared == "once")
    for key, _ in examples:
        Staging(folder).drop(key)
    progress.shards[task.slot] = index.shard
    yield Event(shard=index)


def _finish(tasks: Sequence[ShardTask], folder: Path, planner: Planner, progress: _Progress,
            denoised: Sequence[Denoised]) -> Manifest:
    """Publish the shards as a dataset in the place of the old one. Raises PlanError where a split has no examples
    left."""
    loaded = planner.loaded
    shards = [progress.shards[task.slot] for task in tasks if task.slot in progress.shards]
    _require_examples(tasks, progress.rejected)
    fields = field_summaries(labels_of(folder, shards, _one_of_each(planner, progress)))
    bare = make_manifest(loaded.dataset, layers=dict(layers_asked(loaded.dataset)), shards=(), fields=fields,
                         rejected=progress.rejected.values(), spec_digest=loaded.spec_digest, denoised=denoised,
                         generator=f"dataset-builder {__version__}", parts=object_sources(loaded, planner.contents))
    manifest = with_shards(bare, shards)
    publish_dataset(folder, manifest)
    Staging(folder).clear()
    return manifest


def _one_of_each(planner: Planner, progress: _Progress) -> Iterator[str]:
    """Keys of examples that between them have every field of the dataset; none where it has no fields."""
    if has_fields(planner.loaded.dataset, planner.loaded.objects):
        yield from {(ref.view.pair, ref.level): ref.key for ref in reversed(planner.examples)
                    if ref.key not in progress.rejected}.values()


def _require_examples(tasks: Sequence[ShardTask], rejected: Mapping[str, Rejected]) -> None:
    """Raise PlanError where every example of a split was rejected."""
    keys = defaultdict[str, list[str]](list)
    for task in tasks:
        keys[task.split] += [ref.key for ref in task.examples]
    for split, named in keys.items():
        if all(key in rejected for key in named):
            raise _nothing_left(split, named, rejected)


def _nothing_left(split: str, keys: Sequence[str], rejected: Mapping[str, Rejected]) -> PlanError:
    """That every example of a split was rejected, and why the first few were."""
    problems = [Problem(where="", path=f"split {split}", hint="change the spec, or widen the bounds of `gates`",
                        rule=f"expected at least one example that passes all gates, got none of {len(keys)}")]
    problems += [Problem(where=key, path=rejected[key].gate, rule=rejected[key].reason) for key in keys[:MAX_REASONS]]
    return PlanError(problems)
