"""Examples that were made from files: scenes and meshes, which are not part of a dataset."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from dataset_builder.errors import UserError
from dataset_builder.exporting.export_usd import ExportJob, export_usd
from dataset_builder.rendering.scene.triangle_soup import clean, surroundings
from dataset_builder.shards.reader import open_dataset
from tests.gltf_scenes import write_dataset
from tests.small_specs import run_build

TINY = ("image={width: 16, height: 16}", "render={spp: 4, max_depth: 3}", "rough={edge_length: 0.3, rounds: 0}",
        "layers={i_t: frame, mask: object}", "gates={mask_overlap: 0, s_prime_energy: [0, 1000000]}")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A dataset of a scene from a glTF file, and the folder of its spec."""
    folder = tmp_path_factory.mktemp("scene")
    run_build(write_dataset(folder), folder / "built", *TINY)
    return folder / "built", folder


def job(built: tuple[Path, Path], out: Path, meshes: Path | None = None) -> ExportJob:
    return ExportJob(dataset=built[0], key="00000000", out=out, mesh_root=meshes or built[1])


def test_all_things_of_a_scene_are_prims(built: tuple[Path, Path], tmp_path: Path) -> None:
    plan = open_dataset(built[0]).label("00000000").plan
    stage = Usd.Stage.Open(str(export_usd(job(built, tmp_path / "out")).stage))
    assert [prim.GetName() for prim in stage.GetPrimAtPath("/Example/Room").GetChildren()] == ["floor", "walls"]
    other, = plan.room.scene.things
    piece, = stage.GetPrimAtPath("/Example/Furniture").GetChildren()
    assert piece.GetCustomDataByKey("name") == other.name and piece.GetCustomDataByKey("instance") == other.instance
    assert stage.GetPrimAtPath("/Example/Target").GetCustomDataByKey("licence") == "CC-BY-4.0"
    assert list(stage.GetDefaultPrim().GetCustomDataByKey("licences")) == ["CC-BY-4.0"]
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    soup = surroundings(plan, built[1])
    for prim, corners in ((piece, soup.only(soup.instance == other.instance).corners),
                          (stage.GetPrimAtPath("/Example/Target"), clean(plan.target, built[1]).corners)):
        meshes = [mesh for mesh in Usd.PrimRange(prim) if mesh.IsA(UsdGeom.Mesh)]
        found = boxes.ComputeWorldBound(meshes[0])
        points = np.array(UsdGeom.Mesh(meshes[0]).GetPointsAttr().Get()) @ np.array(found.GetMatrix())[:3, :3]
        points = points + np.array(found.GetMatrix())[3, :3]
        np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)],
                                   [corners.min(axis=(0, 1)), corners.max(axis=(0, 1))], atol=1e-6)


def test_the_folder_of_the_spec_is_asked_for(built: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"expected a file that the example was made from.*--meshes"):
        export_usd(job(built, tmp_path / "out", meshes=tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_file_that_changed_is_refused(built: tuple[Path, Path], tmp_path: Path) -> None:
    source = open_dataset(built[0]).label("00000000").plan.room.scene.file.source
    changed = tmp_path / "changed"
    (changed / source).parent.mkdir(parents=True)
    (changed / source).write_bytes((built[1] / source).read_bytes() + b" ")
    with pytest.raises(UserError, match="changed after planning"):
        export_usd(job(built, tmp_path / "out", meshes=changed))
    assert not (tmp_path / "out").exists()
