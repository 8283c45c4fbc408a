"""From settled examples to shards, and from shards to the dataset."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dataset_builder import __version__
from dataset_builder.engine.shard_tasks import ShardTask
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.example_label import Denoised
from dataset_builder.planning.plan import Planner, layers_asked
from dataset_builder.planning.scene.sources import object_sources
from dataset_builder.shards.field_summary import field_summaries, labels_of
from dataset_builder.shards.manifest import Manifest, Rejected, make_manifest
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import Source, publish_shard
from dataset_builder.spec.own_fields import has_fields
from dataset_builder.spec.resolve import LoadedSpec

MAX_REASONS = 5
"""Reasons that are told where every example of a split was rejected."""


@dataclass(kw_only=True)
class Progress:
    """What is known so far of a build."""

    digests: dict[str, str] = field(default_factory=dict)
    """Of the finished examples, by key."""
    rejected: dict[str, Rejected] = field(default_factory=dict)
    """By key."""
    shards: dict[str, ShardIndex] = field(default_factory=dict)
    """Finished ones, by slot."""

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Note what became of some examples."""
        for outcome in outcomes:
            if outcome.rejected:
                self.rejected[outcome.ref.key] = outcome.rejected
            else:
                self.digests[outcome.ref.key] = outcome.digest

    def settled(self, task: ShardTask) -> bool:
        """Whether it is known of each example of a shard what became of it."""
        return all(ref.key in self.digests or ref.key in self.rejected for ref in task.examples)


def publish_task(task: ShardTask, folder: Path, loaded: LoadedSpec, made_by: Mapping[str, str], progress: Progress,
                 source: Source | None = None) -> ShardIndex | None:
    """Make one shard of settled examples; None where all were rejected. source: where they are staged, `folder` unless
    given, whose examples are let go then. Raises OutputError and ShardError as `publish_shard` does."""
    examples = [(ref.key, progress.digests[ref.key]) for ref in task.examples if ref.key in progress.digests]
    if not examples:
        return None
    index = publish_shard(folder, slot=task.slot, split=task.split, examples=examples, spec_digest=task.spec_digest,
                          versions=made_by, share=loaded.dataset.storage.shared == "once", source=source)
    if source is None:
        for key, _ in examples:
            Staging(folder).drop(key)
    progress.shards[task.slot] = index
    return index


def finish(tasks: Sequence[ShardTask], folder: Path, planner: Planner, progress: Progress,
           denoised: Sequence[Denoised]) -> Manifest:
    """Publish the shards as a dataset in the place of the old one. Raises PlanError where a split has no examples
    left."""
    loaded = planner.loaded
    indices = [progress.shards[task.slot] for task in tasks if task.slot in progress.shards]
    require_examples(tasks, progress.rejected)
    manifest = make_manifest(loaded.dataset, layers=dict(layers_asked(loaded.dataset)), shards=indices,
                             rejected=progress.rejected.values(), spec_digest=loaded.spec_digest,
                             generator=f"dataset-builder {__version__}", denoised=denoised,
                             parts=object_sources(loaded, planner.contents),
                             fields=field_summaries(labels_of(folder, indices, _one_of_each(planner, indices))))
    publish_dataset(folder, manifest)
    Staging(folder).clear()
    return manifest


def require_examples(tasks: Sequence[ShardTask], rejected: Mapping[str, Rejected]) -> None:
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


def _one_of_each(planner: Planner, indices: Sequence[ShardIndex]) -> Iterator[str]:
    """Keys of examples that between them have every field of the dataset; none where it has no fields."""
    there = {example.key for index in indices for example in index.examples}
    if has_fields(planner.loaded.dataset, planner.loaded.objects):
        yield from {(ref.view.pair, ref.level): ref.key for ref in reversed(planner.examples)
                    if ref.key in there}.values()
