"""Splats become an object: a field and a spec that the builder takes, or a clear error and nothing."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import read_field
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.cli.main import main
from dataset_builder.geometry.splat_moves import joined, moved
from dataset_builder.spec.load import read_document
from tests.assets.splat_files import ball, box, write_ply, write_usda

FAST = ("--licence", "CC-BY-4.0", "--resolution", "24")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A box 1.6 high with y pointing down, as COLMAP leaves it, and a ball apart from it."""
    upside = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    aside = np.diag([0.2, 0.2, 0.2, 1.0])
    aside[0, 3] = 3
    write_ply(tmp_path / "a.ply", moved(joined([box(14, degree=1), moved(ball(100, degree=1), aside)]), upside))
    return tmp_path / "a.ply"


def test_a_file_of_splats_becomes_an_object(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["import", "capture", str(scene), "--height", "0.8", "--name", "crate", "--out", str(out), *FAST]) == 0
    said = capsys.readouterr().out
    assert "100 of 1,276 splats lie outside of the crop, or apart from its largest body" in said
    assert "up is -y, as usual for .ply files" in said and "white of the capture is taken to be" in said
    field = read_field(out / "crate.npz")
    assert field.splats is not None and len(field.splats) == 1176 and field.record.kind == "splats"
    assert field.mesh.size[2] == pytest.approx(0.8) and field.mesh.bounds[0, 2] == pytest.approx(0)
    assert read_document(out / "crate.yaml", "crate").data == {
        "file": "crate.npz", "category": "crate", "licence": "CC-BY-4.0"}
    asset = load_mesh_file(out / "crate.npz", name="crate", category="crate", licence="CC-BY-4.0")
    assert np.allclose(asset.mesh.size, field.mesh.size, atol=1e-6)
    assert np.allclose(asset.mesh.bounds, field.mesh.bounds, atol=1e-6)


def test_white_and_crop_as_given(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["import", "capture", str(scene), "--ball", "3,0,0,0.6", "--white", "0.5", "--up", "0,0,1", "--out",
                 str(tmp_path / "out"), *FAST]
    assert main(arguments) == 0
    field = read_field(tmp_path / "out" / "a.npz")
    assert field.white == 0.5 and field.splats is not None and len(field.splats) == 100
    assert "a unit of the file is taken for a metre" in capsys.readouterr().out
    before = (tmp_path / "out" / "a.npz").read_bytes()
    assert main(arguments) == 2 and (tmp_path / "out" / "a.npz").read_bytes() == before


def test_linear_colours(tmp_path: Path) -> None:
    write_usda(tmp_path / "a.usda", box(10, degree=0))
    out = tmp_path / "out"
    assert main(["import", "capture", str(tmp_path / "a.usda"), "--linear", "--out", str(out), *FAST]) == 0
    field = read_field(out / "a.npz")
    assert field.splats is not None and not field.splats.srgb


@pytest.mark.parametrize(("more", "told"), [
    (["--ball", "9,9,9,1"], "crop: expected it to hold splats"), (["--ball", "9,9,9"], "expected 4 numbers"),
    (["--yaw", "inf"], "--yaw: expected a number of degrees, got inf"),
    (["--no-sheet"], "--no-sheet: expected none"),
    (["--distance", "a", "b", "1"], "it is for photographs"), (["--steps", "300"], "--steps: expected none"),
    (["--seed", "0"], "--seed: expected none"), (["--frame", "0"], "--frame: expected none"),
    (["--resolution", "5000"], "--resolution: expected 16 to 512, got 5000"),
    (["--ball", "0,0,0,-1"], "expected a radius above 0"), (["--box", "0,0,0,1,1,0"], "--box: expected two opposite"),
    (["--up", "0,0,0"], "up: expected a direction"),
    (["--height", "-1"], "--height: expected a number above 0"), (["--name", "../a"], "--name: expected letters")])
def test_mistakes_are_told_and_leave_nothing(scene: Path, tmp_path: Path, more: list[str], told: str,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", "capture", str(scene), "--out", str(tmp_path / "out"), *FAST, *more]) == 2
    assert told in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".npz", ".yaml")]


def test_no_file_and_no_splats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for suffix in (".ply", ".spz", ".glb", ".usda"):
        assert main(["import", "capture", str(tmp_path / f"none{suffix}"), "--out", str(tmp_path), *FAST]) == 2
    assert "readable" in capsys.readouterr().err
