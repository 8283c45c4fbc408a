"""The manifest of chosen examples: the source's, less what is not of them."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.scene_plan import ObjectSource
from dataset_builder.shards.field_summary import field_summaries, labels_of
from dataset_builder.shards.folder import next_of
from dataset_builder.shards.manifest import Manifest, Rejected, from_json, identity_records, with_shards
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import read_small
from dataset_builder.shards.subset_record import SubsetRecord
from dataset_builder.shards.writer import index_path
from dataset_builder.transfer.choice import FACTS, ExampleChoice
from dataset_builder.transfer.origin import Origin


def subset_record(origin: Origin, choice: ExampleChoice) -> SubsetRecord:
    """What a dataset says of being a subset."""
    manifest = origin.manifest
    return SubsetRecord(name=manifest.name, version=manifest.version, sha256=origin.sha256,
                        examples=manifest.totals.examples, asked=choice.asked())


def subset_manifest(origin: Origin, choice: ExampleChoice, layers: Sequence[str], shards: Sequence[ShardRecord],
                    folder: Path) -> Manifest:
    """The manifest of `shards`, which wait in `folder` or lie there, with these layers.

    Splits without examples are left out. Sources and fields are those that the labels of the examples name. Rejected
    examples are those of the splits that were asked for and, where more was asked than splits and layers, only of views
    that are there: nothing else is known of them.
    """
    whole, views = origin.manifest, set[str]()
    labels = list(labels_of(folder, shards, _one_of_each(folder, shards, views)))
    fields = field_summaries(labels) if whole.fields else ()
    seen = any("i_s" in summary.gives for summary in fields)
    kept = {shard.split for shard in shards}
    narrow = choice.count is not None or any(getattr(choice, name) for name in FACTS)
    rejected = tuple(item for item in whole.rejected if _split(item) in kept and (not narrow or item.view in views))
    part = whole.model_copy(update={
        "layers": tuple(layer for layer in whole.layers if layer.name in layers),
        "denoised": tuple(item for item in whole.denoised if item.layer in layers),
        "identities": identity_records(whole.layers[0].dtype, seen),
        "splits": tuple(split for split in whole.splits if split.name in kept),
        "totals": whole.totals.model_copy(update={"rejected": len(rejected)}), "rejected": rejected,
        "parts": tuple(_parts(whole.parts, labels)), "fields": fields,
        "in_common": tuple(one.model_copy(update={"whole": True}) for one in whole.in_common
                           if kept.issuperset(one.splits)),
        "subset": subset_record(origin, choice)})
    return with_shards(part, shards)


def _split(item: Rejected) -> str:
    return item.view.partition("/")[0]


def _indexes(folder: Path, shards: Iterable[ShardRecord]) -> Iterator[ShardIndex]:
    """One in memory at a time."""
    for shard in shards:
        waiting = index_path(next_of(folder), shard.stem)
        path = waiting if waiting.is_file() else index_path(folder, shard.stem)
        yield from_json(ShardIndex, read_small(path), where=path.name)


def _one_of_each(folder: Path, shards: Iterable[ShardRecord], views: set[str]) -> list[str]:
    """Keys of examples that between them show every object, scene and field; `views` fills with all views."""
    found = dict[tuple[str, str, str, int], str]()
    for index in _indexes(folder, shards):
        for example in index.examples:
            views.add(example.view)
            facts = example.facts
            found.setdefault((index.shard.split, facts.scene, facts.object, facts.level), example.key)
    return list(found.values())


def _parts(parts: Iterable[ObjectSource], labels: Sequence[ExampleLabel]) -> Iterator[ObjectSource]:
    """Those sources that something of the examples was made from, with the objects that are there."""
    placed = [item.object for label in labels for item in (label.plan.target, *label.plan.furniture)]
    used = {(plan.kind, plan.source, plan.licence, plan.name) for plan in placed}
    scenes = {label.plan.room.scene.file.source for label in labels}
    targets = {label.plan.target.object.name for label in labels}
    for part in parts:
        there = tuple(name for name in part.objects if (
            name in targets if part.kind == "thing" else (part.kind, part.source, part.licence, name) in used))
        # The building and the other things of a scene are seen, too
        if there or (part.kind == "thing" and part.source in scenes):
            yield part.model_copy(update={"objects": there})
