"""Pictures at full size in a grid, each under its name, with lines of text and a bar of its colours below it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.report.example_sheet import GAP, INK, LINE, MARGIN, PALE, PAPER

TITLE, TEXT = 15, 12
"""Sizes of letters."""
SPACE, BAR = 18, 12
"""Pixels between tiles, and the height of a bar."""
STEPS = 256
TICKS = 3


@dataclass(frozen=True, kw_only=True, eq=False)
class ColourBar:
    """What the colours of a picture stand for."""

    colours: np.ndarray
    """(K, 3) uint8 from the low end to the high one."""
    scales: Sequence[tuple[float, float, str]]
    """Low end, high end and unit; several where one length is told in several units."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile:
    """A picture with its name."""

    title: str
    pixels: np.ndarray | None
    """(H, W, 3) uint8, shown pixel by pixel; None leaves the place to the text."""
    lines: Sequence[str] = ()
    bar: ColourBar | None = None


def tiled(title: Sequence[str], rows: Sequence[Sequence[Tile]]) -> Image.Image:
    """The page of all tiles. title: lines on top, the first in large letters."""
    columns = [max(_width(tile) for tile in column if tile) for column in zip_longest(*rows)]
    heights = [max(_height(tile, width) for tile, width in zip(row, columns, strict=False)) for row in rows]
    width = max(sum(columns) + SPACE * (len(columns) - 1), *(_length(line, TITLE) for line in title))
    top = MARGIN + GAP + LINE * len(title) + SPACE
    page = Image.new("RGB", (width + 2 * MARGIN, top + sum(heights) + SPACE * len(rows)), PAPER)
    draw = ImageDraw.Draw(page)
    for number, line in enumerate(title):
        place = (MARGIN, MARGIN + LINE * number + (GAP if number else 0))
        _write(draw, place, line, pale=number > 0, size=TEXT if number else TITLE)
    for row, height in zip(rows, heights, strict=True):
        left = MARGIN
        for tile, column in zip(row, columns, strict=False):
            _draw(page, draw, tile, left, top, column)
            left += column + SPACE
        top += height + SPACE
    return page


def colours_of(name: str) -> np.ndarray:
    """(256, 3) uint8 of one of Matplotlib's maps of colours, from its low end to its high one."""
    from matplotlib import colormaps

    return np.rint(255 * colormaps[name](np.linspace(0, 1, STEPS))[:, :3]).astype(np.uint8)


def coloured(values: np.ndarray, low: float, high: float, colours: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 of (H, W) values by (K, 3) colours from `low` to `high`; those beyond have the colours there."""
    place = (values - low) / ((high - low) or 1.0) * (len(colours) - 1)
    return colours[np.rint(np.clip(place, 0, len(colours) - 1)).astype(int)]


def _draw(page: Image.Image, draw: ImageDraw.ImageDraw, tile: Tile, left: int, top: int, width: int) -> None:
    _write(draw, (left, top), tile.title, size=TITLE)
    top += LINE + GAP
    if tile.pixels is not None:
        page.paste(Image.fromarray(tile.pixels), (left, top))
        top += tile.pixels.shape[0] + GAP
    if tile.bar:
        ramp = tile.bar.colours[np.linspace(0, len(tile.bar.colours) - 1, width).astype(int)]
        page.paste(Image.fromarray(np.repeat(ramp[None], BAR, axis=0)), (left, top))
        top += BAR + GAP
        for scale in tile.bar.scales:
            _ticks(draw, scale, left, top, width)
            top += LINE
    for line in _wrapped(tile.lines, width):
        _write(draw, (left, top), line, pale=True)
        top += LINE


def _ticks(draw: ImageDraw.ImageDraw, scale: tuple[float, float, str], left: int, top: int, width: int) -> None:
    """Numbers below a bar: at its ends, and between them."""
    low, high, unit = scale
    for number in range(TICKS):
        share = number / (TICKS - 1)
        text = f"{low + share * (high - low):.3g}" + (f" {unit}" if share == 1 and unit else "")
        _write(draw, (left + round(share * (width - _length(text, TEXT))), top), text)


def _write(draw: ImageDraw.ImageDraw, at: tuple[int, int], text: str, *, pale: bool = False, size: int = TEXT) -> None:
    draw.text(at, text, fill=PALE if pale else INK, font=ImageFont.load_default(size))


def _wrapped(lines: Sequence[str], width: int) -> list[str]:
    """The lines, broken between words where they are longer than `width` pixels."""
    found = list[str]()
    for line in lines:
        left = ""
        for word in line.split():
            longer = f"{left} {word}".lstrip()
            if left and _length(longer, TEXT) > width:
                found.append(left)
                longer = word
            left = longer
        found.append(left)
    return found


def _length(text: str, size: int) -> int:
    return round(ImageFont.load_default(size).getlength(text)) + 1


def _width(tile: Tile) -> int:
    return max(_length(tile.title, TITLE), tile.pixels.shape[1] if tile.pixels is not None else 0)


def _height(tile: Tile, width: int) -> int:
    """Of a tile in a column of some width."""
    picture = tile.pixels.shape[0] + GAP if tile.pixels is not None else 0
    bar = BAR + GAP + LINE * len(tile.bar.scales) if tile.bar else 0
    return LINE + GAP + picture + bar + LINE * len(_wrapped(tile.lines, width))
