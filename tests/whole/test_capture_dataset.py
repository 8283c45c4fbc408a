"""A capture as the target of a dataset: its image stands where its mesh stands, and all that tells of it says that
there is no clean mesh."""

import json
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import write_field
from dataset_builder.exporting.export_usd import ExportJob, export_usd
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.planning.scene.assets_of_plan import turned_up
from dataset_builder.report.dataset_summary import summary_tables
from dataset_builder.report.looking.level_meshes import view_meshes
from dataset_builder.report.mesh_sheet import mesh_sheet
from dataset_builder.shards.reader import Dataset, open_dataset
from dataset_builder.shards.verify import verify
from tests.small_fields import ball_field
from tests.small_specs import outcomes_of, run_build, write_spec

RADIUS = 0.4
SPEC = """\
name: small
seed: 1
image: {width: 40, height: 32}
layers: {i_s: object, mask_field: object, s_prime: object, mask_rough: object, normal_rough: object, i_t_empty: frame,
         i_pbr: frame}
render: {spp: 16, max_depth: 3}
camera: {azimuth: 60, elevation: 25, coverage: [0.15, 0.5]}
source: {dome: 2}
storage: {standard_errors: true}
splits:
  - name: test
    objects: {count: 1, from: [objects/ball.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
"""


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("capture")
    path = write_spec(folder, {"small.yaml": SPEC, "scenes/den.yaml": "room: ../rooms/den.yaml\n",
                               "objects/ball.yaml": "file: ball.npz\nlicence: CC-BY-4.0\ncategory: ball\n"})
    write_field(folder / "objects" / "ball.npz", ball_field(RADIUS))
    return path


@pytest.fixture(scope="module")
def built(spec: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("built") / "small"
    outcome, = outcomes_of(run_build(spec, folder)).values()
    assert outcome.rejected is None
    return folder


@pytest.fixture(scope="module")
def dataset(built: Path) -> Dataset:
    return open_dataset(built)


@pytest.fixture(scope="module")
def label(dataset: Dataset) -> ExampleLabel:
    return dataset.label("00000000")


def test_it_is_whole_and_has_no_truth(built: Path, dataset: Dataset) -> None:
    assert verify(built) == []
    assert not {"i_t", "d", "mask"} & set(dataset.layers) and "i_s_se" in dataset.layers


def test_its_mesh_can_be_looked_at_without_distances(built: Path, spec: Path, tmp_path: Path) -> None:
    meshes = view_meshes(built, "0", spec.parent, None)
    level, = meshes.levels
    assert meshes.clean is None and level.distance is None and not level.differs
    assert meshes.missing == ("no 3DM and no distances: the object is a field",)
    mesh_sheet(meshes).save(tmp_path / "meshes.png")


def test_the_image_stands_where_the_mesh_stands(dataset: Dataset, label: ExampleLabel) -> None:
    """The field is red on one side: where the mesh's normals say that this side is seen, the image is red."""
    layers = dataset["00000000"]
    field, rough = layers["mask_field"], layers["mask_rough"]
    assert np.minimum(field, rough).sum() / np.maximum(field, rough).sum() > 0.92
    inside = rough[..., 0] > 0.999
    normals = layers["normal_rough"][inside] @ turned_up(label.plan.target.yaw)
    red, green, blue = layers["i_s"][inside].T / field[inside].T
    expected = np.clip(0.5 + 0.5 * normals[:, 0], 0.05, 0.95)
    assert inside.sum() > 100 and np.ptp(expected) > 0.4
    # White paper under a dome of 2 has a radiance of 2
    np.testing.assert_allclose(green, 2 * 0.5, atol=0.02)
    np.testing.assert_allclose(red, 2 * expected, atol=0.15)
    np.testing.assert_allclose(blue, 2 * (1 - expected), atol=0.15)


def test_its_label_says_what_it_is(label: ExampleLabel) -> None:
    plan, record = label.plan, label.record
    assert (plan.field.kind, plan.rough.field.kind, plan.rough.name) == ("own", "own", "own")
    assert plan.target.object.licence == "CC-BY-4.0"
    field, = record.field
    assert not field.truth and field.psnr == 31.0
    assert record.roughness == () and (record.roughness_rms, record.roughness_max) == (0, 0)
    assert record.bounding_radius == pytest.approx(RADIUS)
    ran = {each.name: each.spp for each in record.passes}
    assert ran["source"] == 16 and ran["target"] == ran["source_clean"] == 0
    assert any("capture" in decision.reason for decision in plan.effects.decisions if decision.effect == "pass source")


def test_card_croissant_and_tables_say_where_it_comes_from(built: Path, dataset: Dataset) -> None:
    summary, = dataset.manifest.fields
    assert (summary.split, summary.kind, summary.gives, summary.captures) == ("test", "density", ("i_s", "r3dm"), True)
    assert (summary.fields, summary.views, summary.psnr, summary.psnr_worst) == (1, 40, 31.0, 27.5)
    assert dataset.manifest.licence == "CC-BY-4.0" and "field" in {each.name for each in dataset.manifest.identities}
    card = (built / "README.md").read_text()
    assert "By path tracing, with captures of real objects; generator" in card
    assert "| test | density, captured | `i_s` and rough meshes | 1 | 40 | 16 | 31.0 | 27.5 | 0.950 |" in card
    assert "| objects/ball.npz | capture | CC-BY-4.0 | test-ball-00 |" in card
    collected = json.loads((built / "croissant.json").read_text())["rai:dataCollection"]
    assert "captures of real objects" in collected and "no photographs" not in collected
    fields = next(table for table in summary_tables(built) if table.title == "fields")
    assert [list(column.cells) for column in fields.columns] == [
        ["test-ball-00"], ["density"], ["i_s r3dm"], ["40"], ["31.0"], ["27.5"], ["0.950"], ["1"], ["2"], [""]]


def test_its_stage_has_one_mesh_in_both_variants(built: Path, spec: Path, tmp_path: Path) -> None:
    done = export_usd(ExportJob(dataset=built, key="00000000", out=tmp_path / "usd", mesh_root=spec.parent))
    assert "the field that i_s is the image of" in done.not_said
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(done.stage))
    variants = stage.GetPrimAtPath("/Example/Target").GetVariantSets().GetVariantSet("geometry")
    counts = set()
    for name in ("3DM", "R3DM"):
        variants.SetVariantSelection(name)
        mesh, = (prim for prim in stage.Traverse() if prim.GetTypeName() == "Mesh" and "Target" in str(prim.GetPath()))
        counts.add(len(UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get()))
    assert counts == {len(ball_field(RADIUS).mesh.faces)}
