"""From settled examples to shards, and from shards to the dataset."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dataset_builder import __version__
from dataset_builder.engine.shard_tasks import ShardTask
from dataset_builder.engine.unit import Outcome
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.example_label import Denoised
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.plan import Planner, layers_asked
from dataset_builder.planning.scene.sources import object_sources, shared_contents
from dataset_builder.shards.field_summary import field_summaries, labels_of
from dataset_builder.shards.manifest import Manifest, Rejected, make_manifest, with_shards
from dataset_builder.shards.publish import Again, publish_dataset
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
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
    """Of the finished examples of shards that are not published, by key."""
    rejected: dict[str, Rejected] = field(default_factory=dict)
    """By key."""
    shards: dict[str, ShardRecord] = field(default_factory=dict)
    """Finished ones, by slot."""

    def add(self, outcomes: Sequence[Outcome]) -> list[ExampleRef]:
        """Note what became of some examples; those of which nothing was known before."""
        news = [outcome.ref for outcome in outcomes
                if outcome.ref.key not in self.digests and outcome.ref.key not in self.rejected]
        for outcome in outcomes:
            if outcome.rejected:
                self.rejected[outcome.ref.key] = outcome.rejected
            else:
                self.digests[outcome.ref.key] = outcome.digest
        return news


def publish_task(task: ShardTask, folder: Path, loaded: LoadedSpec, made_by: Mapping[str, str], progress: Progress,
                 source: Source) -> ShardIndex | None:
    """Make one shard of settled examples; None where all were rejected. source: where they are staged. Raises
    OutputError and ShardError as `publish_shard` does."""
    examples = [(ref.key, progress.digests[ref.key]) for ref in task.examples if ref.key in progress.digests]
    if not examples:
        return None
    index = publish_shard(folder, slot=task.slot, split=task.split, examples=examples, spec_digest=task.spec_digest,
                          versions=made_by, share=loaded.dataset.storage.shared == "once", source=source)
    progress.shards[task.slot] = index.shard
    return index


def let_go(task: ShardTask, staging: Staging, progress: Progress) -> None:
    """Forget the examples of a shard that is published. Raises OutputError."""
    for ref in task.examples:
        if progress.digests.pop(ref.key, None):
            staging.drop(ref.key)


def finish(tasks: Sequence[ShardTask], folder: Path, planner: Planner, progress: Progress,
           denoised: Sequence[Denoised], again: Again | None = None) -> Manifest:
    """Publish the shards as a dataset in the place of the old one; again: as `publish_dataset` takes it. Raises
    PlanError where a split has no examples left."""
    loaded = planner.loaded
    shards = [progress.shards[task.slot] for task in tasks if task.slot in progress.shards]
    require_examples(tasks, progress.rejected)
    manifest = make_manifest(loaded.dataset, layers=dict(layers_asked(loaded.dataset)), shards=(),
                             rejected=progress.rejected.values(), spec_digest=loaded.spec_digest,
                             generator=f"dataset-builder {__version__}", denoised=denoised,
                             parts=object_sources(loaded, planner.contents),
                             fields=field_summaries(labels_of(folder, shards, _one_of_each(planner, progress))),
                             in_common=shared_contents(loaded, planner.contents))
    manifest = with_shards(manifest, shards)
    publish_dataset(folder, manifest, again)
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


def _one_of_each(planner: Planner, progress: Progress) -> Iterator[str]:
    """Keys of examples that between them have every field of the dataset; none where it has no fields."""
    if has_fields(planner.loaded.dataset, planner.loaded.objects):
        yield from {(ref.view.pair, ref.level): ref.key for ref in reversed(planner.examples)
                    if ref.key not in progress.rejected}.values()
