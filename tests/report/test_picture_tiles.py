"""Pictures in a grid keep their pixels, and colours stand for the values beside their bar."""

import numpy as np
import pytest

from dataset_builder.report.example_sheet import GAP, LINE, MARGIN, PAPER
from dataset_builder.report.picture_tiles import BAR, SPACE, ColourBar, Tile, coloured, colours_of, tiled
from dataset_builder.seeding import rng

RAMP = np.stack([np.arange(101)] * 3, axis=1).astype(np.uint8)
TOP = MARGIN + GAP + LINE + SPACE + LINE + GAP
"""First row of pixels of the first picture, below one line of text and its name."""


def noise(seed: int, height: int, width: int) -> np.ndarray:
    return rng(seed, "picture").integers(0, 200, (height, width, 3), dtype=np.uint8)


def test_pictures_keep_their_pixels() -> None:
    """Columns are as wide as their widest picture, rows as high as their highest."""
    one, wide, high = noise(0, 60, 70), noise(1, 30, 120), noise(2, 90, 50)
    page = np.asarray(tiled(["t"], [[Tile(title="a", pixels=one), Tile(title="b", pixels=high)],
                                    [Tile(title="c", pixels=wide)]]))
    left, second = MARGIN + 120 + SPACE, TOP + 90 + GAP + SPACE + LINE + GAP
    assert np.array_equal(page[TOP:TOP + 60, MARGIN:MARGIN + 70], one)
    assert np.array_equal(page[TOP:TOP + 90, left:left + 50], high)
    assert np.array_equal(page[second:second + 30, MARGIN:MARGIN + 120], wide)
    assert (page[second:second + 30, left:] == PAPER).all()


def test_a_bar_has_its_colours_and_its_numbers() -> None:
    bar = ColourBar(colours=RAMP, scales=[(0, 2.5, "mm"), (0, 0.01, "radii")])
    page = np.asarray(tiled(["t"], [[Tile(title="a", pixels=noise(0, 20, 202), bar=bar)]]))
    top = TOP + 20 + GAP
    assert page[top, MARGIN].tolist() == [0] * 3 and page[top + BAR - 1, MARGIN + 201].tolist() == [100] * 3
    assert np.abs(page[top, MARGIN:MARGIN + 202, 0] - np.linspace(0, 100, 202)).max() <= 1
    for line in (0, 1):
        scale = page[top + BAR + GAP + LINE * line:][:LINE, MARGIN:MARGIN + 202].min(axis=(0, 2))
        assert scale[:10].min() < 120 and scale[90:112].min() < 120 and scale[190:].min() < 120
        assert scale[20:85].min() == PAPER[0]


def test_long_lines_are_broken_and_nothing_is_cut() -> None:
    text = "a line that is much longer than the picture is wide " * 3
    short = np.asarray(tiled(["t"], [[Tile(title="a", pixels=noise(0, 20, 200), lines=["short"])]]))
    page = np.asarray(tiled(["t"], [[Tile(title="a", pixels=noise(0, 20, 200), lines=[text])]]))
    assert page.shape[0] >= short.shape[0] + 3 * LINE and page.shape[1] == short.shape[1] == 200 + 2 * MARGIN
    assert (page[:, -MARGIN:] == PAPER).all()


@pytest.mark.parametrize(("value", "place"), [(-1, 0), (2.0, 0), (3.0, 50), (3.99, 100), (9.0, 100)])
def test_values_have_the_colour_at_their_place(value: float, place: int) -> None:
    assert coloured(np.array([[value]]), 2.0, 4.0, RAMP)[0, 0, 0] == place
    assert coloured(np.array([[value]]), 5.0, 5.0, RAMP).shape == (1, 1, 3)


def test_maps_begin_and_end_as_in_the_browser() -> None:
    """The first and last stops in `scripts/layers.js`."""
    assert colours_of("viridis")[[0, -1]].tolist() == [[0x44, 0x01, 0x54], [0xFD, 0xE7, 0x25]]
    assert np.abs(colours_of("magma")[[0, -1]].astype(int) - [[0, 0, 4], [0xFC, 0xFD, 0xBF]]).max() <= 1
