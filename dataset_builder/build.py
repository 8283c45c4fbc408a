"""Build a dataset: decide keep or build per shard, run the missing views, publish each shard when its examples are
there."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from dataset_builder import __version__
from dataset_builder.engine import local
from dataset_builder.engine.rejections import Rejections
from dataset_builder.engine.unit import Job, Outcome, run_unit, versions
from dataset_builder.errors import PlanError
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.plan import Planner, layers_asked
from dataset_builder.planning.views import ViewUnit, units
from dataset_builder.shards.folder import build_lock
from dataset_builder.shards.manifest import Manifest, Rejected, ShardIndex, make_manifest, shard_stem
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import publish_shard, published, remove_others, remove_shard
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.loaded import LoadedSpec

PROBES = 3
"""Views per split that are planned before anything is written; a spec under which all of them fail is refused."""


@dataclass(frozen=True, kw_only=True)
class ShardTask:
    """One shard, and what the plan wants in it. keep: it is published already, from this spec by these versions."""

    stem: str
    split: str
    examples: tuple[ExampleRef, ...]
    keep: ShardIndex | None


@dataclass(frozen=True, kw_only=True)
class Event:
    """News of a build: outcomes of one unit, a shard that was published, or the finished manifest."""

    outcomes: tuple[Outcome, ...] = ()
    shard: ShardIndex | None = None
    manifest: Manifest | None = None


@dataclass(kw_only=True)
class _Progress:
    """What is known so far: examples by key, published shards by stem."""

    digests: dict[str, str] = field(default_factory=dict)
    rejected: dict[str, Rejected] = field(default_factory=dict)
    shards: dict[str, ShardIndex] = field(default_factory=dict)

    def settled(self, task: ShardTask) -> bool:
        return all(ref.key in self.digests or ref.key in self.rejected for ref in task.examples)


def shard_tasks(examples: Sequence[ExampleRef], spec: DatasetSpec) -> list[ShardTask]:
    """Fixed numbers of neighbouring examples per shard and split; example i of a split lies in shard i // size."""
    by_split: dict[str, list[ExampleRef]] = defaultdict(list)
    for ref in examples:
        by_split[ref.view.pair.split].append(ref)
    size = spec.storage.examples_per_shard
    return [ShardTask(stem=shard_stem(spec, split, first // size), split=split, keep=None,
                      examples=tuple(refs[first:first + size]))
            for split, refs in by_split.items() for first in range(0, len(refs), size)]


def decide(tasks: Sequence[ShardTask], folder: Path, spec_digest: str, made_by: dict[str, str],
           rejected: dict[str, Rejected]) -> list[ShardTask]:
    """Which published shards stay: same spec, same versions, and every example in it or known to be rejected."""
    return [ShardTask(stem=task.stem, split=task.split, examples=task.examples,
                      keep=_kept(task, published(folder, task.stem), spec_digest, made_by, rejected)) for task in tasks]


def _kept(task: ShardTask, index: ShardIndex | None, spec_digest: str, made_by: dict[str, str],
          rejected: dict[str, Rejected]) -> ShardIndex | None:
    if index is None or index.spec_digest != spec_digest or index.versions != made_by:
        return None
    there = {example.key for example in index.examples}
    return index if all(ref.key in there or ref.key in rejected for ref in task.examples) else None


def build(loaded: LoadedSpec, folder: Path, job: Job, *, workers: int, only: Sequence[int] = ()) -> Iterator[Event]:
    """Build `loaded` into `folder`, yielding news. `only`: indices of examples to stage, without publishing anything.

    Raises PlanError where nothing can be planned, OutputError where the folder or the disk refuses; in both cases what
    was finished before is kept, and a second run goes on from there.
    """
    planner = Planner(loaded)
    probe(planner)
    made_by = versions(job.backend)
    with build_lock(folder):
        rejections = Rejections(folder, loaded.spec_digest, made_by)
        tasks = decide(shard_tasks(planner.examples, loaded.dataset), folder, loaded.spec_digest, made_by, rejections.known)
        progress = _Progress(rejected=dict(rejections.known),
                             shards={task.stem: task.keep for task in tasks if task.keep})
        missing = [task for task in tasks if not task.keep]
        wanted = [ref for task in missing for ref in task.examples if not only or ref.index in only]
        for outcomes in local.run(partial(run_unit, job), _todo(wanted, progress), workers=workers):
            _note(outcomes, progress, rejections)
            yield Event(outcomes=tuple(outcomes))
            for task in [] if only else [task for task in missing if progress.settled(task)]:
                missing.remove(task)
                yield from _publish(task, folder, loaded, made_by, progress)
        if not only:
            yield Event(manifest=_finish(tasks, folder, loaded, progress))


def probe(planner: Planner) -> None:
    """Plan a few views of every split. Raises the first PlanError where all of a split's fail."""
    for split in planner.loaded.dataset.splits:
        refs = [ref for ref in planner.examples if ref.view.pair.split == split.name]
        problems = []
        for ref in refs[::max(1, len(refs) // PROBES)][:PROBES]:
            try:
                planner.example(ref)
                break
            except PlanError as error:
                problems.append(error)
        else:
            raise problems[0]


def _todo(wanted: Sequence[ExampleRef], progress: _Progress) -> tuple[ViewUnit, ...]:
    return units(ref for ref in wanted if ref.key not in progress.rejected)


def _note(outcomes: Sequence[Outcome], progress: _Progress, rejections: Rejections) -> None:
    for outcome in outcomes:
        if outcome.rejected:
            progress.rejected[outcome.ref.key] = outcome.rejected
            rejections.add(outcome.rejected)
        else:
            progress.digests[outcome.ref.key] = outcome.digest


def _publish(task: ShardTask, folder: Path, loaded: LoadedSpec, made_by: dict[str, str],
             progress: _Progress) -> Iterator[Event]:
    """Publish one shard and let its staged examples go; a shard whose examples were all rejected is none."""
    examples = [(ref.key, progress.digests[ref.key]) for ref in task.examples if ref.key in progress.digests]
    if not examples:
        remove_shard(folder, task.stem)
        return
    index = publish_shard(folder, stem=task.stem, split=task.split, examples=examples, spec_digest=loaded.spec_digest,
                          versions=made_by)
    for key, _ in examples:
        Staging(folder).drop(key)
    progress.shards[task.stem] = index
    yield Event(shard=index)


def _finish(tasks: Sequence[ShardTask], folder: Path, loaded: LoadedSpec, progress: _Progress) -> Manifest:
    """Take away what no plan asks for, and write the manifest. Raises PlanError where a split is left without
    examples."""
    indices = [progress.shards[task.stem] for task in tasks if task.stem in progress.shards]
    for split in loaded.dataset.splits:
        if not any(index.shard.split == split.name for index in indices):
            reasons = "; ".join(f"{item.key}: {item.reason}" for item in progress.rejected.values())
            raise PlanError(f"split {split.name}: expected at least one example that passes all gates, got none: {reasons}")
    remove_others(folder, [index.shard.stem for index in indices])
    manifest = make_manifest(loaded.dataset, layers=dict(layers_asked(loaded.dataset)), shards=indices,
                             rejected=progress.rejected.values(), spec_digest=loaded.spec_digest,
                             generator=f"dataset-builder {__version__}")
    Staging(folder).clear()
    publish_dataset(folder, manifest)
    return manifest
