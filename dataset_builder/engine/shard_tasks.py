"""Which shards a dataset needs, and which of those that are there stay."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from dataset_builder.planning.catalogue import ExampleRef, shard_size
from dataset_builder.shards.manifest import Rejected, shard_slot
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.resolve import LoadedSpec


@dataclass(frozen=True, kw_only=True)
class ShardTask:
    """One shard, and what the plan wants in it."""

    slot: str
    split: str
    examples: tuple[ExampleRef, ...]
    spec_digest: str
    """Of what the examples of its split depend on."""
    keep: ShardIndex | None
    """The one that is there, where it is whole, from this spec and by these versions."""


def split_digests(examples: Sequence[ExampleRef], loaded: LoadedSpec) -> dict[str, str]:
    """Digest of what the examples of each split depend on."""
    first = {ref.view.pair.split: ref.index for ref in reversed(examples)}
    return {split.name: loaded.split_digest(split, first[split.name]) for split in loaded.dataset.splits}


def shard_tasks(examples: Sequence[ExampleRef], spec: DatasetSpec, digests: Mapping[str, str]) -> list[ShardTask]:
    """Fixed numbers of neighbouring examples per shard and split, see `shard_size`; digests: of the splits."""
    by_split: dict[str, list[ExampleRef]] = defaultdict(list)
    for ref in examples:
        by_split[ref.view.pair.split].append(ref)
    sizes = {split: shard_size(spec, len(refs)) for split, refs in by_split.items()}
    return [ShardTask(slot=shard_slot(spec, split, first // sizes[split]), split=split, keep=None,
                      spec_digest=digests[split], examples=tuple(refs[first:first + sizes[split]]))
            for split, refs in by_split.items() for first in range(0, len(refs), sizes[split])]


def decide(tasks: Sequence[ShardTask], whole: Sequence[ShardIndex], made_by: dict[str, str],
           rejected: Mapping[str, Rejected]) -> list[ShardTask]:
    """Which of the whole shards stay: same spec, same versions, and every example in it or known to be rejected."""
    def fits(task: ShardTask, index: ShardIndex) -> bool:
        there = {example.key for example in index.examples}
        return (index.shard.slot, index.spec_digest, index.versions) == (task.slot, task.spec_digest, made_by) \
            and all(ref.key in there or ref.key in rejected for ref in task.examples)

    return [replace(task, keep=next((index for index in whole if fits(task, index)), None)) for task in tasks]
