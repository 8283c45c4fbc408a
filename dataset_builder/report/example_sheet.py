"""Pictures in rows under common headings, with a few lines of text before each row; and a composed frame as files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.files import write_atomic
from dataset_builder.shards.exr import encode_picture

if TYPE_CHECKING:
    from dataset_builder.lightnet.results.compose import Composite

MARGIN, GAP, HEADER, LINE = 12, 4, 24, 17
LABEL_WIDTH = 200
INK, PALE, PAPER = (32, 32, 32), (110, 110, 110), (250, 250, 250)

LINEAR, PREVIEW, SIDES = "composite.exr", "composite.png", "side_by_side.png"
RESULT = "I_R"
"""Heading of the composed frame."""
CELL = 320


@dataclass(frozen=True, kw_only=True, eq=False)
class SheetRow:
    """A row of pictures."""

    lines: Sequence[str]
    """Text, the first in black."""
    panels: Mapping[str, np.ndarray]
    """(H, W, 3) uint8 pictures by heading; a heading may lack here."""


def sheet(rows: Sequence[SheetRow], cell: int = 160) -> Image.Image:
    """The picture of all rows. cell: width of a panel in pixels; smaller pictures are shown with square pixels."""
    headings = list(dict.fromkeys(heading for row in rows for heading in row.panels))
    heights = [max(_height(row, cell), len(row.lines) * LINE) for row in rows]
    width = _left(len(headings), cell) + MARGIN
    page = Image.new("RGB", (width, 2 * MARGIN + HEADER + sum(heights) + GAP * len(rows)), PAPER)
    draw = ImageDraw.Draw(page)
    for column, heading in enumerate(headings):
        draw.text((_left(column, cell), MARGIN), heading, fill=INK, font=ImageFont.load_default(13))
    top = MARGIN + HEADER
    for row, height in zip(rows, heights, strict=True):
        page.paste(_label(row.lines, height), (MARGIN, top))
        for heading, pixels in row.panels.items():
            page.paste(_scaled(pixels, cell), (_left(headings.index(heading), cell), top))
        top += height + GAP
    return page


def write_sheet(rows: Sequence[SheetRow], target: Path, cell: int = 160) -> None:
    """Write the sheet as a PNG file, whole or not at all. Raises OutputError."""
    write_atomic(target, png_of(np.asarray(sheet(rows, cell))))


def png_of(pixels: np.ndarray) -> bytes:
    """The PNG file of (H, W, 3) uint8 pixels."""
    stream = BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def _label(lines: Sequence[str], height: int) -> Image.Image:
    """Lines of text, cut where they are too long."""
    label = Image.new("RGB", (LABEL_WIDTH - GAP, height), PAPER)
    draw = ImageDraw.Draw(label)
    for number, line in enumerate(lines):
        draw.text((0, LINE * number), line, fill=PALE if number else INK, font=ImageFont.load_default(12))
    return label


def _scaled(pixels: np.ndarray, width: int) -> Image.Image:
    """The picture `width` pixels wide: averaged down, or its pixels made larger."""
    picture = Image.fromarray(pixels)
    method = Image.Resampling.BOX if picture.width > width else Image.Resampling.NEAREST
    return picture.resize((width, _scaled_height(pixels, width)), method)


def _scaled_height(pixels: np.ndarray, width: int) -> int:
    return max(1, round(width * pixels.shape[0] / pixels.shape[1]))


def _height(row: SheetRow, cell: int) -> int:
    return max((_scaled_height(pixels, cell) for pixels in row.panels.values()), default=0)


def _left(column: int, cell: int) -> int:
    return MARGIN + LABEL_WIDTH + column * (cell + GAP)


def write_composite(composite: "Composite", panels: Mapping[str, np.ndarray], out: Path, *, title: str) -> list[Path]:
    """Write the frame as EXR and as PNG, and all panels side by side; the paths. Raises OutputError."""
    write_atomic(out / LINEAR, encode_picture(composite.picture, name="composite"))
    write_atomic(out / PREVIEW, png_of(panels[RESULT]))
    lines = [*_wrapped(title), f"{composite.predicted.sum()} pixels predicted", f"{composite.filled.sum()} filled",
             f"exposure {composite.exposure:.4g}"]
    write_sheet([SheetRow(lines=lines, panels=panels)], out / SIDES, cell=CELL)
    return [out / LINEAR, out / PREVIEW, out / SIDES]


def _wrapped(title: str) -> list[str]:
    """A path with its example on lines of their own, the end of each being what tells it from others."""
    return [part[-28:] for part in title.split(", ")]
