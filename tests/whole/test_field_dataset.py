"""Datasets whose objects are seen through fields: made once, the same bytes each time, refused with figures."""

import csv
import json
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.api import render_example
from dataset_builder.assets.field_file import read_field
from dataset_builder.builder import Event, build
from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.errors import PlanError, UserError
from dataset_builder.exporting.export_usd import ExportJob, export_usd
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.report.dataset_summary import summary_tables
from dataset_builder.report.looking.level_meshes import view_meshes
from dataset_builder.report.mesh_sheet import mesh_sheet
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.verify import verify
from dataset_builder.spec.load import load_dataset
from tests.small_specs import contents, outcomes_of, write_spec

SPEC = """\
name: small
seed: 1
image: {width: 24, height: 20}
layers: {i_s: object, i_t: object, d: object, r: object, s_prime: object, mask: object, mask_rough: object,
         mask_field: object, i_s_clean: object}
render: {spp: 16, max_depth: 4}
rough: {sigma: 0.006, edge_length: 0.2, rounds: 0}
gates: {mask_overlap: 0.1}
camera: {azimuth: {uniform: [-180, 180]}, elevation: {uniform: [10, 40]}, coverage: [0.1, 0.5]}
storage: {examples_per_shard: 3}
splits:
  - name: train
    objects: {count: 1, from: [objects/nightstand.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
  - name: test
    objects: {count: 2, from: [objects/ottoman.yaml, objects/stool.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
    lights: 2
    source: {kind: field, views: 24, held_out: 4, size: 32, spp: 4, resolution: 32, steps: 40,
             gates: {psnr: 12, opacity_iou: 0.6}}
"""
FILES = {"small.yaml": SPEC, "scenes/den.yaml": "room: ../rooms/den.yaml\n"}


def built(spec: Path, folder: Path, *overrides: str, workers: int = 1, told: list[FieldNews] | None = None,
          cache: Path | None = None) -> list[Event]:
    return list(build(load_dataset(spec, overrides), folder, backend="llvm", workers=workers, cache=cache,
                      told=([] if told is None else told).append))


def made(events: Sequence[Event]) -> list[FieldNews]:
    """News of fields that were made, not found."""
    return [event.field for event in events if event.field and event.field.seconds]


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_spec(tmp_path_factory.mktemp("spec"), FILES)


@pytest.fixture(scope="module")
def first(spec: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Event], list[FieldNews]]:
    folder, told = tmp_path_factory.mktemp("first") / "small", list[FieldNews]()
    return folder, built(spec, folder, told=told), told


def test_fields_come_first_and_are_seen(first: tuple[Path, list[Event], list[FieldNews]]) -> None:
    folder, events, told = first
    kinds = ["field" if event.field else "outcomes" if event.outcomes else "other" for event in events]
    assert [news.object for news in made(events)] == ["test-stool-01", "test-ottoman-00"]
    assert kinds.index("outcomes") > max(k for k, kind in enumerate(kinds) if kind == "field")
    stages = [(news.object, news.progress.stage) for news in told if news.progress]
    assert stages.index(("test-stool-01", "fit")) == 28 and stages[:28] == [("test-stool-01", "images")] * 28
    assert verify(folder) == [] and sorted(path.suffix for path in (folder / ".build" / "fields").iterdir()) == [
        ".npz", ".npz"]
    dataset = open_dataset(folder)
    for key in dataset.splits["test"]:
        example = dataset[key]
        record, = dataset.label(key).record.field
        assert record.views == 24 and record.psnr > 12 and record.key in {news.key for news in made(events)}
        close = np.abs(example["i_s"] - example["i_s_clean"])[example["mask"][..., 0] == 1].mean()
        assert close < 0.25 * example["i_s_clean"].max()
        assert not np.array_equal(example["mask_field"], example["mask"])
    for key in dataset.splits["train"]:
        assert dataset.label(key).record.field == ()
        assert np.array_equal(dataset[key]["mask_field"], dataset[key]["mask"])


def test_exported_stages_take_the_mesh_of_the_field(spec: Path, tmp_path: Path, first: tuple[
        Path, list[Event], list[FieldNews]]) -> None:
    from pxr import Usd, UsdGeom

    folder, dataset = first[0], open_dataset(first[0])
    key = dataset.splits["test"][0]
    file = folder / ".build" / "fields" / f"{dataset.label(key).record.field[0].key}.npz"
    job = ExportJob(dataset=folder, key=key, out=tmp_path / "stage", mesh_root=spec.parent, fields=file.parent)
    stage = Usd.Stage.Open(str(export_usd(job).stage))
    stage.GetPrimAtPath("/Example/Target").GetVariantSets().GetVariantSet("geometry").SetVariantSelection("R3DM")
    mesh, = (prim for prim in stage.Traverse() if prim.GetTypeName() == "Mesh" and "Target" in str(prim.GetPath()))
    faces = UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Get()
    assert len(faces) == len(read_field(file).mesh.faces)
    with pytest.raises(UserError, match=r"expected the field that the rough mesh is taken from, found none \(give "):
        export_usd(replace(job, out=tmp_path / "other", fields=tmp_path))
    meshes = view_meshes(folder, key, spec.parent, file.parent)
    level, = meshes.levels
    assert len(level.rough.corners) == len(faces) and not level.differs and meshes.missing == ()
    assert level.distance is not None and level.distance.max() == pytest.approx(level.label.record.roughness_max)
    mesh_sheet(meshes).save(tmp_path / "meshes.png")
    with pytest.raises(UserError, match=r"expected the field that the rough mesh is taken from, found none \(give "):
        view_meshes(folder, key, spec.parent, None)


def test_card_and_tables_have_their_figures(first: tuple[Path, list[Event], list[FieldNews]]) -> None:
    summary, = open_dataset(first[0]).manifest.fields
    records = [record_of(first, name) for name in ("test-ottoman-00", "test-stool-01")]
    assert (summary.split, summary.gives, summary.fields, summary.views) == ("test", ("i_s", "r3dm"), 2, 24)
    assert summary.psnr == pytest.approx(sum(record.psnr for record in records) / 2)
    assert summary.psnr_worst == min(record.psnr_worst for record in records) and not summary.captures
    fields = next(table for table in summary_tables(first[0]) if table.title == "fields")
    assert list(fields.columns[0].cells) == ["test-ottoman-00", "test-stool-01"]
    assert all(cell.endswith("°") for cell in fields.columns[-1].cells)


def test_seconds_of_fields_are_noted(first: tuple[Path, list[Event], list[FieldNews]]) -> None:
    rows = list(csv.reader((first[0] / "seconds.csv").read_text().splitlines()))
    found = {(key, step.split()[0]) for key, step, _ in rows if " of density " in step}
    assert found == {(name, step) for name in ("test-ottoman-00", "test-stool-01") for step in ("images", "fit")}


def test_two_processes_make_the_same_bytes(spec: Path, first: tuple[Path, list[Event], list[FieldNews]],
                                           tmp_path: Path) -> None:
    told = list[FieldNews]()
    events = built(spec, tmp_path / "small", workers=2, told=told)
    assert len(made(events)) == 2 and {news.object for news in told} == {"test-ottoman-00", "test-stool-01"}
    assert contents(tmp_path / "small") == contents(first[0])
    fields = [{path.name: path.read_bytes() for path in (folder / ".build" / "fields").iterdir()}
              for folder in (first[0], tmp_path / "small")]
    assert fields[0] == fields[1]


def test_another_light_reuses_the_fields(spec: Path, first: tuple[Path, list[Event], list[FieldNews]],
                                         tmp_path: Path) -> None:
    shutil.copytree(first[0], tmp_path / "small")
    events = built(spec, tmp_path / "small", "target.strength=3")
    assert sum(event.field is not None for event in events) == 2 and not made(events)


def test_an_example_alone_is_the_same(spec: Path, first: tuple[Path, list[Event], list[FieldNews]]) -> None:
    there, alone = open_dataset(first[0])["00000001"], render_example(load_dataset(spec, ()), 1, backend="llvm")
    assert alone["meta"] == there["meta"] and all(np.array_equal(alone[name], there[name]) for name in alone
                                                  if name != "meta")


def test_a_truncated_field_is_made_again(spec: Path, first: tuple[Path, list[Event], list[FieldNews]],
                                         tmp_path: Path) -> None:
    shutil.copytree(first[0], tmp_path / "small")
    shutil.rmtree(tmp_path / "small" / ".build" / "passes")
    path = next((tmp_path / "small" / ".build" / "fields").iterdir())
    whole = path.read_bytes()
    path.write_bytes(whole[:len(whole) // 2])
    assert len(made(built(spec, tmp_path / "small", "target.strength=3"))) == 1
    assert path.read_bytes() == whole


def test_an_object_that_fails_is_rejected_with_figures(spec: Path, first: tuple[Path, list[Event], list[FieldNews]],
                                                       tmp_path: Path) -> None:
    shutil.copytree(first[0], tmp_path / "small")
    worse, better = sorted(record_of(first, name).psnr for name in ("test-ottoman-00", "test-stool-01"))
    gate = f"splits.test.source.gates={{psnr: {(worse + better) / 2:.6f}, opacity_iou: 0.6}}"
    events = built(spec, tmp_path / "small", gate)
    rejected = [each.rejected for each in outcomes_of(events).values() if each.rejected]
    assert len(rejected) == 2 and {each.gate for each in rejected} == {"field"}
    assert f"got {worse:.4g}" in rejected[0].reason and "dB over 4 held-out images" in rejected[0].reason
    manifest = events[-1].manifest
    assert manifest and manifest.totals.rejected == 2 and manifest.totals.examples == 3
    assert verify(tmp_path / "small") == []
    # Nothing is made, or tried, again
    assert not made(built(spec, tmp_path / "small", gate))


def test_a_split_without_objects_left_ends_the_build_before_views_are_rendered(
        spec: Path, first: tuple[Path, list[Event], list[FieldNews]], tmp_path: Path) -> None:
    shutil.copytree(first[0] / ".build" / "fields", tmp_path / "cache" / "fields")
    events = build(load_dataset(spec, ["splits.test.source.gates.psnr=90"]), tmp_path / "small", backend="llvm",
                   workers=1, cache=tmp_path / "cache")
    with pytest.raises(PlanError, match="split test: expected at least one example that passes all gates"):
        assert all(outcome.rejected for event in events for outcome in event.outcomes)


def record_of(first: tuple[Path, list[Event], list[FieldNews]], name: str) -> FieldRecord:
    return next(news.record for news in made(first[1]) if news.object == name and news.record)


def test_a_shared_cache_holds_the_fields(spec: Path, first: tuple[Path, list[Event], list[FieldNews]],
                                         tmp_path: Path) -> None:
    shutil.copytree(first[0] / ".build" / "fields", tmp_path / "cache" / "fields")
    events = built(spec, tmp_path / "small", cache=tmp_path / "cache")
    assert not made(events) and contents(tmp_path / "small") == contents(first[0])
    assert not (tmp_path / "small" / ".build" / "fields").exists()


def test_labels_name_a_field_that_can_be_read(first: tuple[Path, list[Event], list[FieldNews]]) -> None:
    for news in made(first[1]):
        file = read_field(first[0] / ".build" / "fields" / f"{news.key}.npz")
        assert file.record == news.record and json.loads(file.record.model_dump_json())["truth"] is True
