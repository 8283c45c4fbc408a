"""Which examples a dataset has: splits, pairs, views, lights and noise levels, counted without touching geometry."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby, product

from dataset_builder.errors import PlanError
from dataset_builder.label.sequence_plan import SequencePlan
from dataset_builder.seeding import rng
from dataset_builder.spec.dataset import DatasetSpec, SplitSpec

KEY_DIGITS = 8
MIN_SHARDS = 4
"""Shards that a split is cut into at least, one example each at the least, so that as many readers have work."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PairRef:
    """A target object of a split standing in a scene of that split, both by their index in it."""

    split: str
    object: int
    scene: int

    @property
    def path(self) -> tuple[str | int, ...]:
        """Where this pair's random numbers come from, whatever else the dataset holds."""
        return self.split, "pair", self.object, self.scene


@dataclass(frozen=True, kw_only=True, slots=True)
class ViewRef:
    """One camera of a pair."""

    number: int
    """Counts the split's views in the order of `views_of`."""
    pair: PairRef
    camera: int
    """Counts the cameras of the pair."""

    @property
    def name(self) -> str:
        """`train/000003`."""
        return f"{self.pair.split}/{self.number:06d}"

    @property
    def path(self) -> tuple[str | int, ...]:
        """Where this view's random numbers come from."""
        return *self.pair.path, "view", self.camera


@dataclass(frozen=True, kw_only=True, slots=True)
class ExampleRef:
    """One example of a view."""

    index: int
    """Counts over all splits."""
    view: ViewRef
    light: int
    """Number of the light."""
    level: int
    """Number of the noise level."""

    def __str__(self) -> str:
        return f"example {self.key} (view {self.view.name})"

    @property
    def key(self) -> str:
        """Eight digits, unique over all splits."""
        return f"{self.index:0{KEY_DIGITS}d}"


def pairs_of(split: SplitSpec) -> tuple[PairRef, ...]:
    """The (object, scene) pairs of a split; any number of them uses every object and every scene evenly.

    Pair k takes object k mod O and scene (k + k div lcm(O, S)) mod S, which meets each of the O S pairs once
    before any comes again (the spec asks for no more).
    """
    objects, scenes = split.objects.count, split.scenes.count
    wanted = objects * scenes if split.pairs == "all" else split.pairs
    turn = math.lcm(objects, scenes)
    return tuple(PairRef(split=split.name, object=k % objects, scene=(k + k // turn) % scenes) for k in range(wanted))


def views_of(spec: DatasetSpec, split: SplitSpec) -> tuple[ViewRef, ...]:
    """All views of a split, shuffled so that neighbours in a shard differ in object and scene; those of paths pair by
    pair in their order."""
    cameras = list(product(pairs_of(split), range(split.views)))
    order = range(len(cameras)) if spec.camera_of(split.name).path else \
        rng(spec.seed, split.name, "order").permutation(len(cameras))
    return tuple(ViewRef(number=number, pair=cameras[k][0], camera=cameras[k][1]) for number, k in enumerate(order))


def sequence_of(spec: DatasetSpec, view: ViewRef) -> SequencePlan:
    """The place of a view among those of its path; empty where it is of none."""
    pair, split = view.pair, spec.split_of(view.pair.split)
    if spec.camera_of(pair.split).path is None:
        return SequencePlan()
    return SequencePlan(name=f"{pair.split}-{pair.object:02d}-{pair.scene:02d}", frame=view.camera, frames=split.views)


def _examples(spec: DatasetSpec) -> Iterator[ExampleRef]:
    index = 0
    for split in spec.splits:
        variants = list(product(range(spec.target.count_of(split.lights)), range(len(split.levels(spec.rough)))))
        for view in views_of(spec, split):
            for light, level in variants:
                yield ExampleRef(index=index, view=view, light=light, level=level)
                index += 1


def examples(spec: DatasetSpec) -> tuple[ExampleRef, ...]:
    """Every example of a dataset in order of index; the examples of one view are neighbours (light, then level).

    Raises PlanError where eight digits do not suffice.
    """
    total = count_examples(spec)
    if total > 10**KEY_DIGITS:
        raise PlanError(f"expected at most {10**KEY_DIGITS} examples, got {total}")
    return tuple(_examples(spec))


def count_examples(spec: DatasetSpec, only: SplitSpec | None = None) -> int:
    """How many examples the dataset has, or one split of it, by arithmetic."""
    return sum(len(pairs_of(split)) * split.views * spec.target.count_of(split.lights) * len(split.levels(spec.rough))
               for split in ([only] if only else spec.splits))


def shard_size(spec: DatasetSpec, examples: int) -> int:
    """Examples per shard of a split of so many: what the spec says, less where it would have fewer than `MIN_SHARDS`.

    Example i of a split lies in shard i // size.
    """
    return max(min(spec.storage.examples_per_shard, examples // MIN_SHARDS), 1)


@dataclass(frozen=True, kw_only=True)
class ViewUnit:
    """One view and those of its examples that are asked for, in order of index; never empty."""

    view: ViewRef
    examples: tuple[ExampleRef, ...]

    def __str__(self) -> str:
        return f"view {self.view.name}" if len(self.examples) > 1 else str(self.examples[0])

    @property
    def lights(self) -> tuple[int, ...]:
        """Distinct target lights among the examples, ascending."""
        return tuple(sorted({example.light for example in self.examples}))

    @property
    def levels(self) -> tuple[int, ...]:
        """Distinct noise levels among the examples, ascending."""
        return tuple(sorted({example.level for example in self.examples}))


def units(examples: Iterable[ExampleRef]) -> tuple[ViewUnit, ...]:
    """Group examples, of all splits or of a selection, by view; units come in the order of their first index."""
    ordered = sorted(examples, key=lambda example: example.index)
    return tuple(ViewUnit(view=view, examples=tuple(group))
                 for view, group in groupby(ordered, key=lambda example: example.view))
