"""Which shards a dataset needs, and which of those that are there stay."""

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from dataset_builder.planning.catalogue import ExampleRef, shard_size
from dataset_builder.shards.manifest import Rejected, shard_slot
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
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
    keep: ShardRecord | None
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


def decide(tasks: Sequence[ShardTask], whole: Iterable[ShardIndex], made_by: dict[str, str],
           rejected: Mapping[str, Rejected]) -> list[ShardTask]:
    """Which of the whole shards stay: same spec, same versions, and every example in it or known to be rejected. One
    index after the other is looked at, and of those that stay only what the manifest says is kept."""
    by_slot, keep = {task.slot: task for task in tasks}, dict[str, ShardRecord]()
    for index in whole:
        task = by_slot.get(index.shard.slot)
        if task is None or task.slot in keep or (index.spec_digest, index.versions) != (task.spec_digest, made_by):
            continue
        there = {example.key for example in index.examples}
        if all(ref.key in there or ref.key in rejected for ref in task.examples):
            keep[task.slot] = index.shard
    return [replace(task, keep=keep.get(task.slot)) for task in tasks]


class OpenShards:
    """The shards that a build has yet to publish, and how many of their examples nothing is known of: each outcome is
    counted once, however many shards there are."""

    def __init__(self, tasks: Sequence[ShardTask], settled: Container[str]):
        """settled: keys of examples that are known to be rejected."""
        self._tasks = sorted(tasks, key=lambda task: task.examples[0].index)
        self._firsts = [task.examples[0].index for task in self._tasks]
        self._left = [sum(ref.key not in settled for ref in task.examples) for task in self._tasks]

    def settle(self, refs: Iterable[ExampleRef]) -> Iterator[ShardTask]:
        """Take note of examples that are done with, each for the first time; the shards that are complete by them."""
        for ref in refs:
            number = bisect_right(self._firsts, ref.index) - 1
            self._left[number] -= 1
            if not self._left[number]:
                yield self._tasks[number]
