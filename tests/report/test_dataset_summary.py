"""The contact sheet shows every layer of every row, at one exposure."""

import json
import shutil
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import OutputError
from dataset_builder.label.example_label import Denoised
from dataset_builder.report import example_sheet
from dataset_builder.report.dataset_summary import (
    PALETTE,
    cell_pixels,
    contact_rows,
    summary_tables,
    write_contact_sheet,
)
from dataset_builder.report.example_sheet import GAP, HEADER, LABEL_WIDTH, MARGIN
from dataset_builder.report.gallery.shown_examples import chosen
from dataset_builder.shards.reader import open_dataset

CELL, CELL_HEIGHT = 128, 107


@pytest.fixture(scope="module")
def sheet(small_dataset: Path) -> np.ndarray:
    """(H, W, 3) uint8 sheet of six rows."""
    return np.asarray(example_sheet.sheet(contact_rows(small_dataset, 6), CELL))


def cells(sheet: np.ndarray, row: int) -> list[np.ndarray]:
    """The pictures of one row."""
    top = MARGIN + HEADER + row * (CELL_HEIGHT + GAP)
    lefts = [MARGIN + LABEL_WIDTH + column * (CELL + GAP) for column in range(13)]
    return [sheet[top:top + CELL_HEIGHT, left:left + CELL] for left in lefts]


def test_layers_are_columns_and_examples_rows(sheet: np.ndarray) -> None:
    height, width = HEADER + 6 * (CELL_HEIGHT + GAP), LABEL_WIDTH + 13 * (CELL + GAP)
    assert sheet.shape == (2 * MARGIN + height, 2 * MARGIN + width, 3)


def test_no_picture_is_blank_and_each_has_its_label(sheet: np.ndarray) -> None:
    for row in range(6):
        assert all(picture.std() > 1 for picture in cells(sheet, row))
        top = MARGIN + HEADER + row * (CELL_HEIGHT + GAP)
        assert sheet[top:top + 14, MARGIN:MARGIN + LABEL_WIDTH].min() < 100
    assert all(sheet[MARGIN:MARGIN + HEADER - 4, MARGIN + LABEL_WIDTH + column * (CELL + GAP):][:, :CELL].min() < 100
               for column in range(13))


def test_all_splits_are_among_few_rows(small_dataset: Path) -> None:
    dataset = open_dataset(small_dataset, layers=())

    def spread(count: int) -> list[str]:
        return [key for own in chosen(dataset, (), count).values() for key in own]

    assert spread(2) == ["00000000", "00000008"] == spread(1)
    assert spread(5) == ["00000000", "00000002", "00000004", "00000006", "00000008"]
    assert len(spread(3)) == 3 and spread(3)[-1] == "00000008"
    assert len(spread(100)) == 10 == len(set(spread(100)))


def test_what_values_look_like() -> None:
    ramp = np.linspace(0, 1, 5, dtype=np.float32).reshape(1, 5, 1).repeat(3, axis=2)
    assert cell_pixels("d", ramp, 100.0)[0, :, 0].tolist() == cell_pixels("d", ramp, 1.0)[0, :, 0].tolist()
    assert cell_pixels("i_t", ramp, 0.5).astype(int).sum() < cell_pixels("i_t", ramp, 1.0).astype(int).sum()
    depth = np.array([[[0.0], [2.0], [4.0]]], np.float32)
    assert cell_pixels("depth", depth, 1.0)[0, 2].tolist() == [255, 255, 255]
    normals = np.array([[[0, 0, 0], [0, 0, 1], [-1, 0, 0]]], np.float32)
    assert cell_pixels("normal", normals, 1.0)[0].tolist() == [[0, 0, 0], [128, 128, 255], [0, 128, 128]]
    ids = np.array([[[0], [1], [2], [3], [9]]], np.float32)
    shown = cell_pixels("instance", ids, 1.0)[0]
    assert shown[:4].tolist() == PALETTE[:4].tolist() and shown[4].tolist() == PALETTE[3].tolist()


def test_it_is_written_whole(small_dataset: Path, tmp_path: Path) -> None:
    write_contact_sheet(small_dataset, tmp_path / "new" / "sheet.png", rows=1)
    with Image.open(tmp_path / "new" / "sheet.png") as image:
        assert image.size[1] == 2 * MARGIN + HEADER + 2 * (round(128 * 20 / 24) + GAP)
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="choose another output folder"):
        write_contact_sheet(small_dataset, tmp_path / "file" / "sheet.png", rows=1)


def test_figures_of_denoised_layers_are_whole_in_80_columns(small_dataset: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(small_dataset, tmp_path / "denoised")
    told = Denoised(layer="i_t", bias=-0.00101, bias_error=0.00099, pixel_bias=0.0247, relmse_raw=0.00335,
                    relmse_denoised=0.0021, relmse_reference=0.000194, examples=2, known="measured")
    layers = [told, told.model_copy(update={"layer": "s_prime", "known": "at most"}),
              told.model_copy(update={"layer": "i_s", "known": "unknown"})]
    about = json.loads((folder / "dataset.json").read_bytes())
    about["denoised"] = [layer.model_dump() for layer in layers]
    text = json.dumps(about)
    sums = (folder / "SHA256SUMS").read_text()
    (folder / "SHA256SUMS").write_text(sums.replace(sha256_bytes((folder / "dataset.json").read_bytes()),
                                                    sha256_bytes(text.encode())))
    (folder / "dataset.json").write_text(text)
    shown = StringIO()
    Console(file=shown, width=80).print(*summary_tables(folder))
    text = " ".join(shown.getvalue().split())
    assert "errors of i_t, s_prime, i_s are those before denoising" in text
    table = shown.getvalue().partition("denoised layers")[2]
    assert "\u2026" not in table and table.count("unknown") == 5
    for figure in ("-0.10%", "0.10%", "2.47%", "at most", "3.35e-03", "2.10e-03", "1.94e-04", "reference"):
        assert figure in table
