"""A finished dataset at a glance: tables from its manifest and labels, and a contact sheet of examples and layers."""

from collections import Counter
from pathlib import Path

import numpy as np
from rich.table import Table

from dataset_builder.label.denoised_words import told_bias, told_relmse
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.label.mean_told import means_told, unknown_means
from dataset_builder.layers import LAYERS
from dataset_builder.report.example_sheet import SheetRow, write_sheet
from dataset_builder.report.gallery.shown_examples import chosen
from dataset_builder.shards.field_summary import fields_of
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.tonemap import exposure, to_8bit

CELL = 128
"""Width of a layer in pixels."""
PALETTE = np.array([(0, 0, 0), (230, 120, 40), (150, 160, 170), (60, 130, 200), (90, 170, 90), (190, 90, 160),
                    (220, 200, 70), (80, 180, 180), (140, 100, 70)], dtype=np.uint8)
"""Colours of instances: none, target, room, furniture in turn."""


def summary_tables(folder: Path | str) -> list[Table]:
    """Tables for the terminal. Raises ShardError where there is no finished dataset."""
    dataset = open_dataset(folder, layers=())
    labels = [*dataset.labels(key for keys in dataset.splits.values() for key in keys)]
    return [_splits(dataset, labels), _layers(dataset, labels), *_denoised(dataset), *_fields(labels),
            *_rejected(dataset)]


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
    if manifest.in_common:
        table.caption = ". ".join(one.sentence for one in manifest.in_common)
    return table


def _layers(dataset: Dataset, labels: list[ExampleLabel]) -> Table:
    table = Table("layer", "extent", "type", "least", "mean", "largest", "relative error", title="layers")
    errors: dict[str, list[float]] = {}
    for label in labels:
        for entry in label.record.layers:
            errors.setdefault(entry.name, []).append(entry.relative_error)
    unknown = unknown_means(entry for label in labels for entry in label.record.layers)
    for layer in dataset.manifest.layers:
        values = [label.layers[layer.name] for label in labels]
        error = f"{np.median(errors[layer.name]):.1%}" if layer.name in errors else ""
        table.add_row(layer.name, layer.extent, layer.dtype, f"{min(value.min for value in values):.3g}",
                      f"{np.mean([value.mean for value in values]):.3g}",
                      f"{max(value.max for value in values):.3g}", error)
    denoised = [entry.layer for entry in dataset.manifest.denoised if entry.layer in errors]
    told = [f"errors of {', '.join(denoised)} are those before denoising"] * bool(denoised)
    table.caption = "; ".join([*told, means_told(unknown)] if unknown else told) or None
    return table


def _denoised(dataset: Dataset) -> list[Table]:
    """How far denoised layers may be trusted."""
    if not dataset.manifest.denoised:
        return []
    table = Table("layer", "bias", "of a pixel", title="denoised layers")
    for name in ("relMSE before", "after", "reference", "examples"):
        # 80 columns hold whole figures; only what has spaces is broken
        table.add_column(name, min_width=max(map(len, (*name.split(), "1.23e-04"))))
    for item in dataset.manifest.denoised:
        bias, error, pixel = told_bias(item)
        table.add_row(item.layer, bias if item.known == "unknown" else f"{bias}\n± {error}", pixel, *told_relmse(item),
                      str(item.examples))
    return [table]


def _fields(labels: list[ExampleLabel]) -> list[Table]:
    """Every field that something was seen through or taken from, with the roughness of its mesh over the examples."""
    found: dict[tuple[str, str], tuple[FieldRecord, str]] = {}
    rough: dict[str, list[float]] = {}
    for label in labels:
        for gives, _, record in fields_of(label):
            found.setdefault((label.plan.target.object.name, record.key), (record, " ".join(gives)))
            if "r3dm" in gives and label.record.roughness:
                rough.setdefault(record.key, []).append(label.record.roughness[0].normal_median)
    if not found:
        return []
    table = Table("object", "field", "gives", "views", "PSNR", "worst", "IoU", "bodies", "dropped", "normals",
                  title="fields")
    for (name, key), (record, given) in sorted(found.items(), key=lambda item: item[0]):
        held_out = (f"{record.psnr:.1f}", f"{record.psnr_worst:.1f}", f"{record.opacity_iou:.3f}")
        table.add_row(name, record.kind, given, str(record.views or ""), *(held_out if record.held_out else ("",) * 3),
                      str(record.bodies), str(record.bodies_dropped),
                      f"{np.median(rough[key]):.1f}°" if key in rough else "")
    return [table]


def _rejected(dataset: Dataset) -> list[Table]:
    if not dataset.manifest.rejected:
        return []
    table = Table("key", "view", "gate", "reason", title="rejected examples")
    for item in dataset.manifest.rejected:
        table.add_row(item.key, item.view, item.gate, item.reason)
    return [table]


def write_contact_sheet(folder: Path | str, target: Path, *, rows: int = 12) -> None:
    """Write the sheet of the dataset in `folder` as a PNG file, whole or not at all. Raises OutputError."""
    write_sheet(contact_rows(folder, rows), target, CELL)


def contact_rows(folder: Path | str, rows: int) -> list[SheetRow]:
    """Rows of up to `rows` examples, taken evenly from every split.

    Radiometric layers share one exposure over the whole sheet, so that brightness can be compared; reflectances and
    masks are shown as they are, depth is scaled per example, normals are mapped from [-1, 1].
    """
    dataset = open_dataset(folder)
    names = [name for name in LAYERS if name in dataset.layers]
    keys = [key for own in chosen(dataset, (), rows).values() for key in own]
    examples = [dataset[key] for key in keys]
    factor = exposure(example[name] for example in examples for name in names if LAYERS[name].radiometric)
    return [SheetRow(lines=_sheet_lines(dataset.label(key).plan), panels={
        f"{name}  {LAYERS[name].symbol}": cell_pixels(name, example[name], factor) for name in names})
        for key, example in zip(keys, examples, strict=True)]


def cell_pixels(name: str, array: np.ndarray, factor: float) -> np.ndarray:
    """(H, W, 3) uint8 picture of one layer; `factor` is the exposure of radiometric ones."""
    if name == "instance":
        ids = array[..., 0].astype(int)
        return PALETTE[np.where(ids < 3, ids, 3 + (ids - 3) % (len(PALETTE) - 3))]
    if name.startswith("normal"):
        shown = np.where(np.any(array != 0, axis=-1, keepdims=True), (array + 1) / 2, 0)
        return np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)
    if LAYERS[name].unit == "m":
        return to_8bit(array, 1 / max(float(array.max()), 1e-6))
    return to_8bit(array, factor if LAYERS[name].radiometric else 1.0)


def _sheet_lines(plan: ExamplePlan) -> list[str]:
    lights = " + ".join(light.kind for light in plan.target_light.lights)
    return [plan.key, plan.split, plan.target.object.name, plan.room.name, lights,
            plan.rough.name or f"sigma {plan.rough.sigma:.4f}"]
