"""A whole export: what the stage holds, that it is valid, and what is refused."""

import json
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pxr import Kind, Sdf, Usd, UsdGeom, UsdShade, UsdValidation

from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.exporting import export_usd as module
from dataset_builder.exporting.export_usd import Exported, ExportJob, export_usd
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.rendering.scene.triangle_soup import clean, rough_twin, surroundings
from dataset_builder.shards.exr import decode
from dataset_builder.shards.reader import open_dataset
from tests.exporting.conftest import KEY

VARIANTS = tuple(product(("source", "target"), ("3DM", "R3DM")))


def chosen(exported: Exported, illumination: str = "target", geometry: str = "3DM") -> Usd.Stage:
    """The stage in some of its variants, chosen in the session alone."""
    stage = Usd.Stage.Open(str(exported.stage))
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetDefaultPrim().GetVariantSet("illumination").SetVariantSelection(illumination)
    stage.GetPrimAtPath("/Example/Target").GetVariantSet("geometry").SetVariantSelection(geometry)
    return stage


def triangles(stage: Usd.Stage, below: str) -> np.ndarray:
    """(F, 3, 3) corners in the world of all meshes below a prim."""
    cache, found = UsdGeom.XformCache(), []
    for prim in Usd.PrimRange(stage.GetPrimAtPath(below)):
        if prim.IsA(UsdGeom.Mesh):
            mesh, matrix = UsdGeom.Mesh(prim), np.array(cache.GetLocalToWorldTransform(prim))
            points = np.array(mesh.GetPointsAttr().Get(), float) @ matrix[:3, :3] + matrix[3, :3]
            found.append(points[np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)])
    return np.concatenate(found)


@pytest.mark.parametrize(("illumination", "geometry"), VARIANTS)
def test_the_stage_is_valid(exported: Exported, illumination: str, geometry: str) -> None:
    """Everything that usdchecker asks, of every combination of variants."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [error.GetMessage() for error in context.Validate(chosen(exported, illumination, geometry))] == []


def test_the_stage_states_its_units(exported: Exported) -> None:
    stage = Usd.Stage.Open(str(exported.stage))
    assert stage.GetDefaultPrim().GetPath() == "/Example"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == "Z"
    assert Usd.ModelAPI(stage.GetDefaultPrim()).GetKind() == Kind.Tokens.assembly


@pytest.mark.parametrize("geometry", ["3DM", "R3DM"])
def test_the_target_is_what_is_rendered(exported: Exported, label: ExampleLabel, small_spec: Path,
                                        geometry: str) -> None:
    placed, root = label.plan.target, small_spec.parent
    soup = clean(placed, root) if geometry == "3DM" else rough_twin(placed, label.plan.rough, root).soup
    stage = chosen(exported, geometry=geometry)
    np.testing.assert_allclose(triangles(stage, "/Example/Target"), soup.corners, atol=1e-6)
    mesh = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Example/Target/Target_mesh"))
    turn = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim()))[:3, :3]
    normals = np.array(mesh.GetPrimvar("normals").Get()).reshape(-1, 3, 3) @ turn
    np.testing.assert_allclose(normals, soup.normals, atol=1e-6)
    np.testing.assert_allclose(np.array(mesh.GetPrimvar("st").Get()).reshape(-1, 3, 2), soup.uvs, atol=1e-6)


def test_all_that_is_around_is_there(exported: Exported, label: ExampleLabel, small_spec: Path) -> None:
    soup = surroundings(label.plan, small_spec.parent)
    stage = chosen(exported)
    found = np.concatenate([triangles(stage, "/Example/Room"), triangles(stage, "/Example/Furniture")])
    assert len(found) == len(soup.corners)
    np.testing.assert_allclose(np.sort(found.reshape(-1, 9), axis=0), np.sort(soup.corners.reshape(-1, 9), axis=0),
                               atol=1e-6)
    names = [prim.GetName() for prim in stage.GetPrimAtPath("/Example/Room").GetChildren()]
    assert names == ["floor", "walls", "ceiling"]
    piece, = stage.GetPrimAtPath("/Example/Furniture").GetChildren()
    placed, = label.plan.furniture
    said = {"name": placed.object.name, "category": "stool", "licence": "CC0-1.0", "instance": 3}
    assert {key: piece.GetCustomDataByKey(key) for key in said} == said
    assert Usd.ModelAPI(piece).GetKind() == Kind.Tokens.component


def test_what_the_source_opens_is_invisible_then(exported: Exported, label: ExampleLabel) -> None:
    assert set(label.plan.source_light.open) == {"ceiling", "walls"}
    for illumination, hidden in (("source", {"ceiling", "walls"}), ("target", set())):
        stage = chosen(exported, illumination)
        parts = stage.GetPrimAtPath("/Example/Room").GetChildren()
        assert {part.GetName() for part in parts
                if UsdGeom.Imageable(part).ComputeVisibility() == "invisible"} == hidden


def test_the_camera_is_the_label_s(exported: Exported, label: ExampleLabel) -> None:
    stage = chosen(exported)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Example/Camera"))
    seen, plan = camera.GetCamera(0), label.plan.camera
    assert seen.GetFieldOfView(seen.FOVHorizontal) == pytest.approx(plan.fov, rel=1e-6)
    assert seen.aspectRatio == pytest.approx(label.plan.render.width / label.plan.render.height, rel=1e-6)
    ray = seen.frustum.ComputeViewDirection()
    ahead = np.array(plan.target) - np.array(plan.position)
    np.testing.assert_allclose(ray, ahead / np.linalg.norm(ahead), atol=1e-6)
    np.testing.assert_allclose(seen.frustum.position, plan.position, atol=1e-9)


def test_meshes_are_plain_triangles(exported: Exported) -> None:
    stage = chosen(exported)
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            assert mesh.GetSubdivisionSchemeAttr().Get() == "none" and mesh.GetDoubleSidedAttr().Get()
            points = np.array(mesh.GetPointsAttr().Get())
            assert len(np.unique(points, axis=0)) == len(points)
            np.testing.assert_array_equal(mesh.GetExtentAttr().Get(), [points.min(axis=0), points.max(axis=0)])
            faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
            subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
            owned = np.concatenate([np.array(subset.GetIndicesAttr().Get()) for subset in subsets]) if subsets else []
            assert not subsets or np.array_equal(np.sort(owned), np.arange(len(faces)))
            for bound in subsets or [prim]:
                assert UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial()[0]


def test_layers_and_label_come_along(exported: Exported, small_dataset: Path) -> None:
    dataset = open_dataset(small_dataset)
    stage = chosen(exported)
    files = {attribute.GetName(): attribute.Get() for attribute in
             stage.GetPrimAtPath("/Example/Layers").GetAttributes()
             if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset}
    assert set(files) == {f"layers:{name}" for name in dataset.layers}
    for name in dataset.layers:
        read = decode(Path(files[f"layers:{name}"].resolvedPath).read_bytes())
        np.testing.assert_array_equal(read, dataset[KEY][name])
    data = stage.GetDefaultPrim().GetCustomData()
    assert json.loads(data["label"]) == dataset[KEY]["meta"]
    assert list(data["licences"]) == ["CC0-1.0"] and data["key"] == KEY and data["width"] == 24


def test_the_same_bytes_in_another_process(exported: Exported, small_dataset: Path, small_spec: Path,
                                           tmp_path: Path) -> None:
    again = tmp_path / "again"
    subprocess.run([sys.executable, "-m", "dataset_builder", "export-usd", str(small_dataset), KEY, "--out", str(again),
                    "--meshes", str(small_spec.parent)], check=True, capture_output=True)
    first, second = ({path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*"))
                      if path.is_file()} for folder in (exported.stage.parent, again))
    assert first == second and len(first) > 10


def refusal(job: ExportJob) -> str:
    with pytest.raises(UserError) as caught:
        export_usd(job)
    return str(caught.value)


def test_what_is_refused_writes_nothing(small_dataset: Path, small_spec: Path, tmp_path: Path) -> None:
    job = ExportJob(dataset=small_dataset, key="00000011", out=tmp_path / "out", mesh_root=small_spec.parent)
    assert "train:0, got '00000011' (nearest known key: 0000000" in refusal(job)
    empty = ExportJob(dataset=tmp_path, key=KEY, out=tmp_path / "out", mesh_root=tmp_path)
    assert "expected a finished dataset" in refusal(empty)
    (tmp_path / "there").mkdir()
    there = ExportJob(dataset=small_dataset, key=KEY, out=tmp_path / "there", mesh_root=tmp_path)
    assert "nothing is overwritten" in refusal(there)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_what_fails_half_way_leaves_nothing(small_dataset: Path, small_spec: Path, tmp_path: Path,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> tuple[str, ...]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module, "write_stage", full)
    job = ExportJob(dataset=small_dataset, key=KEY, out=tmp_path / "out", mesh_root=small_spec.parent)
    assert "the disk is full" in refusal(job)
    assert not list(tmp_path.iterdir())


def test_usd_core_may_be_missing(small_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                 capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    assert main(["export-usd", str(small_dataset), KEY, "--out", str(tmp_path / "out")]) == 2
    assert 'pip install "3df-lighting-builder[usd]"' in capsys.readouterr().err


def test_the_verb_says_what_it_did(small_dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export-usd", str(small_dataset), KEY]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-1] == f"stage: small-{KEY}-usd/scene.usdc" and said[-2].startswith("5 things, ")
    assert (tmp_path / f"small-{KEY}-usd" / "scene.usdc").is_file()
