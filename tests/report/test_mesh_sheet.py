"""The picture of an example's meshes: distances have one scale, and none has no colour."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.report.looking.level_meshes import ViewMeshes, fields_of_dataset, view_meshes
from dataset_builder.report.mesh_sheet import HEAT, LEAST, PANEL, eye_of, heat_colours, heat_limit, heat_panel
from tests.file_servers import range_server


@pytest.fixture(scope="module")
def meshes(small_dataset: Path, small_spec: Path) -> ViewMeshes:
    return view_meshes(small_dataset, "train:1", small_spec.parent, None)


def colourful(pixels: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels that are not grey."""
    return np.ptp(pixels.astype(int), axis=2) > 2


def test_grey_is_where_nothing_moved(meshes: ViewMeshes) -> None:
    limit = heat_limit(meshes.levels)
    flat, rough = (heat_panel(level, eye_of(meshes), limit) for level in meshes.levels)
    assert flat is not None and rough is not None
    assert not colourful(flat).any() and (np.abs(flat.astype(int) - HEAT[0]).max(axis=2) <= 2).mean() > 0.05
    covered = (rough < 250).any(axis=2)
    assert colourful(rough)[covered].mean() > 0.8


def test_one_scale_for_all_levels(meshes: ViewMeshes) -> None:
    known = [level.distance for level in meshes.levels if level.distance is not None]
    assert heat_limit(meshes.levels) == pytest.approx(np.percentile(known[1], 99))
    assert heat_limit(meshes.levels[:1]) == LEAST


def test_colours_run_from_the_first_to_the_last() -> None:
    colours = heat_colours(401)
    assert [tuple(colours[place]) for place in (0, 100, 200, 300, 400)] == list(HEAT)


def test_a_dataset_at_an_address_has_the_same_pictures_here(
        small_dataset: Path, small_spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with range_server(small_dataset) as address:
        found = view_meshes(address, "train:1", small_spec.parent, fields_of_dataset(address))
        assert main(["inspect", address, "--example", "train:1"]) == 0
    assert [level.rms for level in found.levels] == [level.label.record.roughness_rms for level in found.levels]
    assert main(["inspect", str(small_dataset), "--example", "1", "--out", "local"]) == 0
    for name in ("00000001.html", "00000001.png"):
        assert Path(name).read_bytes() == (tmp_path / "local" / name).read_bytes()


def test_the_picture_is_written_and_told(small_dataset: Path, small_spec: Path, tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--mesh", "1", "--meshes", str(small_spec.parent), "--out", str(tmp_path)]
    assert main(["inspect", str(small_dataset), *options]) == 0
    assert capsys.readouterr().out == f"picture of 2 noise levels: {tmp_path / '00000001-mesh.png'}\n"
    with Image.open(tmp_path / "00000001-mesh.png") as image:
        assert image.width > 3 * PANEL and image.height > 2 * PANEL
