"""Sheets have a column per heading, a row per row, and show pictures pixel by pixel."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.errors import OutputError
from dataset_builder.report.example_sheet import GAP, HEADER, LABEL_WIDTH, LINE, MARGIN, SheetRow, sheet, write_sheet
from dataset_builder.seeding import rng

CELL = 48
PAPER = 250


def picture(seed: int, height: int = 16, width: int = 16) -> np.ndarray:
    """(H, W, 3) uint8 noise."""
    return rng(seed, "picture").integers(0, 200, (height, width, 3), dtype=np.uint8)


def cell(page: np.ndarray, column: int, top: int, height: int = CELL) -> np.ndarray:
    """One panel of a sheet."""
    left = MARGIN + LABEL_WIDTH + column * (CELL + GAP)
    return page[top:top + height, left:left + CELL]


def rows() -> list[SheetRow]:
    """Two rows that share one heading."""
    return [SheetRow(lines=["best: 00000001", "net"], panels={"a": picture(0), "b": picture(1)}),
            SheetRow(lines=["best: 00000001"] * 6, panels={"b": picture(2, 8, 16), "c": picture(3, 96, 96)})]


def test_headings_are_columns_and_what_lacks_stays_blank() -> None:
    page = np.asarray(sheet(rows(), CELL))
    heights = CELL, max(CELL, 6 * LINE)
    assert page.shape == (2 * MARGIN + HEADER + sum(heights) + 2 * GAP, 2 * MARGIN + LABEL_WIDTH + 3 * (CELL + GAP), 3)
    first, second = MARGIN + HEADER, MARGIN + HEADER + heights[0] + GAP
    assert (cell(page, 2, first) == PAPER).all() and (cell(page, 0, second) == PAPER).all()
    assert np.array_equal(cell(page, 1, first), picture(1).repeat(3, 0).repeat(3, 1))
    assert np.array_equal(cell(page, 1, second, CELL // 2), picture(2, 8, 16).repeat(3, 0).repeat(3, 1))
    mean = picture(3, 96, 96).reshape(48, 2, 48, 2, 3).mean((1, 3))
    assert np.abs(cell(page, 2, second).astype(float) - mean).max() <= 1  # rounded in both directions in turn


def test_each_row_has_its_text() -> None:
    page = np.asarray(sheet(rows(), CELL))
    for top in (MARGIN + HEADER, MARGIN + HEADER + CELL + GAP):
        assert page[top:top + LINE, MARGIN:MARGIN + LABEL_WIDTH].min() < 100
    assert all(page[MARGIN:MARGIN + HEADER - 4, MARGIN + LABEL_WIDTH + column * (CELL + GAP):][:, :CELL].min() < 100
               for column in range(3))


def test_long_lines_do_not_reach_the_pictures() -> None:
    long = SheetRow(lines=["m" * 200, "evaluation-dining-table-with-a-name-of-sixty-characters"], panels={})
    page = np.asarray(sheet([rows()[0], long], CELL))
    assert (cell(page, 0, MARGIN + HEADER + CELL + GAP, 2 * LINE) == PAPER).all()


def test_it_is_written_whole(tmp_path: Path) -> None:
    write_sheet(rows(), tmp_path / "new" / "sheet.png", CELL)
    with Image.open(tmp_path / "new" / "sheet.png") as image:
        assert np.array_equal(np.asarray(image), np.asarray(sheet(rows(), CELL)))
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="choose another output folder"):
        write_sheet(rows(), tmp_path / "file" / "sheet.png")
