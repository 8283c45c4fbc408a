"""Which splits of a dataset are seen through fields, and how good these are: rows of the manifest, from labels."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.shards.example import LABEL
from dataset_builder.shards.folder import next_of
from dataset_builder.shards.label_text import parse_label
from dataset_builder.shards.manifest import FieldSummary, Gives, from_json
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import read_member, read_small
from dataset_builder.shards.writer import index_path, shard_path


def fields_of(label: ExampleLabel) -> Iterator[tuple[tuple[Gives, ...], bool, FieldRecord]]:
    """What each field of an example gives, whether it is a capture's, and its figures."""
    image, rough = label.plan.field, label.plan.rough.field
    if image.there:
        yield ("i_s", "r3dm") if rough == image else ("i_s",), image.kind == "own", label.record.field[0]
    if rough.there and rough != image:
        yield ("r3dm",), rough.kind == "own", label.record.field[-1]


def field_summaries(labels: Iterable[ExampleLabel]) -> tuple[FieldSummary, ...]:
    """One row of each split, kind of field and use, in the order that labels bring them."""
    groups: dict[tuple[str, str, tuple[Gives, ...], bool], dict[str, FieldRecord]] = {}
    for label in labels:
        for gives, capture, record in fields_of(label):
            groups.setdefault((label.split, record.kind, gives, capture), {})[record.key] = record
    return tuple(_summary(*group, list(found.values())) for group, found in groups.items())


def _summary(split: str, kind: str, gives: tuple[Gives, ...], captures: bool,
             found: Sequence[FieldRecord]) -> FieldSummary:
    measured = [record for record in found if record.held_out]
    return FieldSummary.model_validate({
        "split": split, "kind": kind, "gives": gives, "captures": captures, "fields": len(found),
        "views": min(record.views for record in found), "resolution": min(record.resolution for record in found),
        "psnr": sum(record.psnr for record in measured) / max(len(measured), 1),
        "psnr_worst": min((record.psnr_worst for record in measured), default=0.0),
        "opacity_iou": min((record.opacity_iou for record in measured), default=0.0)})


def labels_of(folder: Path, shards: Iterable[ShardRecord], keys: Iterable[str]) -> Iterator[ExampleLabel]:
    """Labels of some examples of published shards, those that wait for the next set among them, in order of the shards.
    One index is read after the other, and none where no labels are asked for.

    Raises ShardError where one cannot be read.
    """
    wanted = set(keys)
    for shard in shards if wanted else ():
        there = next_of(folder) if shard_path(next_of(folder), shard.stem).is_file() else folder
        path, place = shard_path(there, shard.stem), index_path(there, shard.stem)
        index = from_json(ShardIndex, read_small(place), where=place.name)
        for example in (example for example in index.examples if example.key in wanted):
            member = next(each for each in example.members if each.suffix == LABEL)
            yield parse_label(read_member(path, member), where=path.name, name=member.name)
