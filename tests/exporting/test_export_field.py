"""Fields written for other programs: what is read back is what was written, and looks the same."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.field_file import FieldFile, write_field
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.splat_file import read_splats
from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.exporting.export_field import MESHES, SPLATS, export_field
from dataset_builder.geometry.mesh_splats import splats_of_mesh
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_moves import moved
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.field.splat_field import SplatStance, field_of_splats, upright
from dataset_builder.rendering.field.splat_look import splat_sight
from dataset_builder.rendering.field.splat_mesh import seen_along
from dataset_builder.tonemap import srgb
from tests.assets.splat_files import ball

SIZE = 48


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, FieldFile]:
    activate("llvm")
    made = field_of_splats(ball(4000, degree=1), SplatStance(up=(0, 0, 1), height=1.0), key="k", cells=56, views=24)
    path = tmp_path_factory.mktemp("field") / "a.npz"
    write_field(path, made)
    return path, made


def picture(cloud: SplatCloud, field: FieldFile) -> np.ndarray:
    """(P, 4) sRGB-encoded colour over black, and opacity, from the front and a little above."""
    at = (np.arange(SIZE) + 0.5) / SIZE - 0.5
    x, z = (each.ravel() for each in np.meshgrid(at, -at))
    ways = np.stack([0.8 * x, np.ones_like(x), 0.8 * z - 0.3], axis=1)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    light, opacity, _ = seen_along(splat_sight(cloud, np.array(field.centre), field.radius),
                                   np.tile([0, -2, 0.5 + 0.6], (len(ways), 1)), ways)
    return np.concatenate([srgb(light), opacity[:, None]], axis=1)


def decibels(one: np.ndarray, two: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((one - two)**2)))


@pytest.mark.parametrize("suffix", sorted(SPLATS))
def test_splats_come_back(tmp_path: Path, field: tuple[Path, FieldFile], suffix: str) -> None:
    path, made = field
    assert made.splats is not None
    done = export_field(path, tmp_path / f"a{suffix}")
    assert (done.content, done.count, done.made) == ("splats", 4000, False)
    found = read_splats(tmp_path / f"a{suffix}")
    assert not found.notes
    # USD is read with y up
    cloud = found.cloud if suffix == ".ply" else moved(found.cloud, upright((0, 1, 0), 0))
    assert np.abs(cloud.centres - made.splats.centres).max() < 1e-5
    # Rounding swaps splats that are entered at almost one place
    assert decibels(picture(cloud, made), picture(made.splats, made)) > 40


def test_a_field_without_splats_looks_alike_in_splats(tmp_path: Path, field: tuple[Path, FieldFile]) -> None:
    """Splats made of the mesh, against the splats that the mesh was taken from."""
    _, made = field
    write_field(tmp_path / "a.npz", replace(made, splats=None))
    done = export_field(tmp_path / "a.npz", tmp_path / "a.ply")
    assert done.made and done.count == len(np.unique(made.mesh.faces))
    assert made.splats is not None
    one, two = picture(read_splats(tmp_path / "a.ply").cloud, made), picture(made.splats, made)
    assert decibels(one, two) > 24 and decibels(one[:, 3], two[:, 3]) > 22


@pytest.mark.parametrize("suffix", sorted(MESHES))
def test_meshes_come_back(tmp_path: Path, field: tuple[Path, FieldFile], suffix: str) -> None:
    path, made = field
    done = export_field(path, tmp_path / f"a{suffix}", "mesh")
    assert done.count == len(made.mesh.faces)
    up = "z" if suffix == ".ply" else "y"
    asset: Asset = load_mesh_file(tmp_path / f"a{suffix}", name="a", category="ball", licence="CC0-1.0", up=up)
    assert np.allclose(asset.mesh.size, made.mesh.size, atol=1e-3)
    assert len(asset.mesh.faces) == pytest.approx(len(made.mesh.faces), rel=0.01)
    assert asset.mesh.colors is not None and made.mesh.colors is not None
    assert np.allclose(asset.mesh.colors[..., :3].mean(axis=(0, 1)), made.mesh.colors[..., :3].mean(axis=(0, 1)),
                       atol=5e-3)


def test_what_cannot_be_written_is_told(tmp_path: Path, field: tuple[Path, FieldFile]) -> None:
    path, made = field
    with pytest.raises(UserError, match="for mesh that ends in one of"):
        export_field(path, tmp_path / "a.obj", "mesh")
    with pytest.raises(UserError, match="for splats that ends in one of"):
        export_field(path, tmp_path / "a.glb", "splats")
    with pytest.raises(UserError, match="found no file"):
        export_field(tmp_path / "none.npz", tmp_path / "a.ply")
    assert made.splats is not None
    write_field(tmp_path / "a.npz", replace(made, splats=replace(made.splats, srgb=False)))
    with pytest.raises(UserError, match="write them as"):
        export_field(tmp_path / "a.npz", tmp_path / "a.ply")
    assert not (tmp_path / "a.ply").exists()
    export_field(tmp_path / "a.npz", tmp_path / "a.usda")
    assert not read_splats(tmp_path / "a.usda").cloud.srgb


def test_the_verb(tmp_path: Path, field: tuple[Path, FieldFile], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-field", str(field[0]), str(tmp_path / "a.glb")]) == 0
    assert "triangles" in capsys.readouterr().out and (tmp_path / "a.glb").exists()
    assert main(["export-field", str(field[0]), str(tmp_path / "a.ply"), "--splats"]) == 0
    assert "4,000 splats" in capsys.readouterr().out
    assert main(["export-field", str(tmp_path / "b.npz"), str(tmp_path / "b.ply")]) == 2


def test_nothing_is_overwritten(tmp_path: Path, field: tuple[Path, FieldFile],
                                capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vase.ply").write_text("the scan")
    assert main(["export-field", str(field[0]), str(tmp_path / "vase.ply")]) == 2
    assert "nothing is overwritten" in capsys.readouterr().err
    assert (tmp_path / "vase.ply").read_text() == "the scan"


def test_splats_of_a_mesh_cover_it(field: tuple[Path, FieldFile]) -> None:
    mesh = field[1].mesh
    cloud = splats_of_mesh(mesh)
    area = float(np.linalg.norm(mesh.area_normals, axis=1).sum()) / 2
    assert float((2 * np.pi * cloud.scales[:, 0]**2).sum()) > 2 * area
    assert np.allclose(cloud.scales[:, 2] / cloud.scales[:, 0], 0.1, atol=1e-5) and cloud.srgb
