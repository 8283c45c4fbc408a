"""A finished dataset in tables: splits, layers, objects and rejected examples, from its manifest and labels."""

from collections import Counter
from pathlib import Path

import numpy as np
from rich.table import Table

from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.shards.reader import Dataset, open_dataset


def summary_tables(folder: Path) -> list[Table]:
    """Tables for the terminal. Raises ShardError where there is no finished dataset."""
    dataset = open_dataset(folder, layers=())
    labels = [dataset.label(key) for keys in dataset.splits.values() for key in keys]
    return [_splits(dataset, labels), _layers(dataset, labels), *_rejected(dataset)]


def _splits(dataset: Dataset, labels: list[ExampleLabel]) -> Table:
    manifest = dataset.manifest
    table = Table("split", "examples", "objects", "rooms", "categories",
                  title=f"{manifest.title} {manifest.version}, {manifest.width}x{manifest.height}, {manifest.licence}")
    for split in manifest.splits:
        own = [label.plan for label in labels if label.split == split.name]
        kinds = Counter(plan.target.object.category for plan in own)
        table.add_row(split.name, str(split.examples), str(len({plan.target.object.name for plan in own})),
                      str(len({plan.room.name for plan in own})),
                      ", ".join(f"{kind} {count}" for kind, count in kinds.most_common()))
    return table


def _layers(dataset: Dataset, labels: list[ExampleLabel]) -> Table:
    table = Table("layer", "extent", "type", "least", "mean", "largest", "relative error", title="layers")
    errors: dict[str, list[float]] = {}
    for label in labels:
        for entry in label.record.layers:
            errors.setdefault(entry.name, []).append(entry.relative_error)
    for layer in dataset.manifest.layers:
        values = [label.layers[layer.name] for label in labels]
        error = f"{np.median(errors[layer.name]):.1%}" if layer.name in errors else ""
        table.add_row(layer.name, layer.extent, layer.dtype, f"{min(value.min for value in values):.3g}",
                      f"{np.mean([value.mean for value in values]):.3g}",
                      f"{max(value.max for value in values):.3g}", error)
    return table


def _rejected(dataset: Dataset) -> list[Table]:
    if not dataset.manifest.rejected:
        return []
    table = Table("key", "view", "gate", "reason", title="rejected examples")
    for item in dataset.manifest.rejected:
        table.add_row(item.key, item.view, item.gate, item.reason)
    return [table]
