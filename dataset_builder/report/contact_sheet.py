"""The contact sheet: examples as rows, layers as columns, one tone mapping for all radiometric layers."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.files import write_atomic
from dataset_builder.layers import LAYERS
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.spread import runs, shares
from dataset_builder.tonemap import exposure, to_8bit

MARGIN, GAP = 12, 4
LABEL_WIDTH, HEADER = 190, 24
INK, PAPER, PALE = (32, 32, 32), (250, 250, 250), (110, 110, 110)
PALETTE = np.array([(0, 0, 0), (230, 120, 40), (150, 160, 170), (60, 130, 200), (90, 170, 90), (190, 90, 160),
                    (220, 200, 70), (80, 180, 180), (140, 100, 70)], dtype=np.uint8)
"""Colours of instances: none, target, room, furniture in turn."""


def contact_sheet(folder: Path, *, rows: int = 12, cell: int = 128) -> Image.Image:
    """A picture of up to `rows` examples, taken evenly from every split. cell: width of a layer in pixels.

    Radiometric layers share one exposure over the whole sheet, so that brightness can be compared; reflectances and
    masks are shown as they are, depth is scaled per example, normals are mapped from [-1, 1].
    """
    dataset = open_dataset(folder)
    names = [name for name in LAYERS if name in dataset.layers]
    examples = [dataset[key] for key in spread(dataset, rows)]
    factor = exposure(example[name] for example in examples for name in names if LAYERS[name].radiometric)
    height = round(cell * examples[0][names[0]].shape[0] / examples[0][names[0]].shape[1])
    size = (2 * MARGIN + LABEL_WIDTH + len(names) * (cell + GAP), 2 * MARGIN + HEADER + len(examples) * (height + GAP))
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    for column, name in enumerate(names):
        draw.text((_left(column, cell), MARGIN), f"{name}  {LAYERS[name].symbol}", fill=INK, font=_font(13))
    for row, example in enumerate(examples):
        top = MARGIN + HEADER + row * (height + GAP)
        _label(draw, example["meta"], top)
        for column, name in enumerate(names):
            picture = Image.fromarray(cell_pixels(name, example[name], factor))
            sheet.paste(picture.resize((cell, height), Image.Resampling.BOX), (_left(column, cell), top))
    return sheet


def spread(dataset: Dataset, count: int) -> list[str]:
    """Keys of up to `count` examples: every split gets its share, at least one (be it more in all), spaced evenly."""
    splits = list(dataset.splits.values())
    found = zip(splits, shares([len(split) for split in splits], count), strict=True)
    return [split[run.start] for split, share in found for run in runs(len(split), share)]


def cell_pixels(name: str, array: np.ndarray, factor: float) -> np.ndarray:
    """(H, W, 3) uint8 picture of one layer; `factor` is the exposure of radiometric ones."""
    if name == "instance":
        ids = array[..., 0].astype(int)
        return PALETTE[np.where(ids < 3, ids, 3 + (ids - 3) % (len(PALETTE) - 3))]
    if name.startswith("normal"):
        shown = np.where(np.any(array != 0, axis=-1, keepdims=True), (array + 1) / 2, 0)
        return np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)
    if name == "depth":
        return to_8bit(array, 1 / max(float(array.max()), 1e-6))
    return to_8bit(array, factor if LAYERS[name].radiometric else 1.0)


def write_contact_sheet(folder: Path, target: Path, *, rows: int = 12) -> None:
    """Write the sheet of the dataset in `folder` as a PNG file, whole or not at all. Raises OutputError."""
    stream = BytesIO()
    contact_sheet(folder, rows=rows).save(stream, "PNG")
    write_atomic(target, stream.getvalue())


def _left(column: int, cell: int) -> int:
    return MARGIN + LABEL_WIDTH + column * (cell + GAP)


def _label(draw: ImageDraw.ImageDraw, meta: dict[str, Any], top: int) -> None:
    plan = meta["plan"]
    lights = " + ".join(light["kind"] for light in plan["target_light"]["lights"])
    lines: Sequence[tuple[str, tuple[int, int, int]]] = (
        (meta["key"], INK), (plan["split"], PALE), (plan["target"]["object"]["name"], PALE),
        (plan["room"]["name"], PALE), (lights, PALE), (f"sigma {plan['rough']['sigma']:.4f}", PALE))
    for number, (text, colour) in enumerate(lines):
        draw.text((MARGIN, top + 16 * number), text[:28], fill=colour, font=_font(12))


def _font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)
