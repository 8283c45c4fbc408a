"""Rows of the manifest about fields: what each kind gives, how many there are, and their worst figures."""

from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.shards.card import card
from dataset_builder.shards.croissant import croissant
from dataset_builder.shards.field_summary import field_summaries
from dataset_builder.shards.label_text import SCHEMA_VERSION
from dataset_builder.shards.manifest import FieldSummary, Manifest
from tests.plans import example_plan, render_record
from tests.shards.tiny_dataset import build

NONE, DENSITY = FieldPlan(), FieldPlan(kind="density", views=50)
SDF, OWN = FieldPlan(kind="sdf", views=50), FieldPlan(kind="own")


def record(key: str, kind: str = "density", psnr: float = 30.0, **figures: float) -> FieldRecord:
    plain = {"truth": True, "views": 50, "held_out": 8, "width": 64, "resolution": 48, "psnr_worst": psnr - 5,
             "ssim": 0.9, "opacity_iou": 0.9, "silhouette_iou": 0.9, "level": 0.1, "bodies": 1, "bodies_dropped": 0,
             "depth_95": 0.1, "loss": 0.1}
    return FieldRecord.model_validate({**plain, "key": key, "kind": kind, "psnr": psnr, **figures})


def label(split: str, field: FieldPlan, rough: FieldPlan, *records: FieldRecord) -> ExampleLabel:
    plan = example_plan(split=split)
    plan = plan.model_copy(update={"field": field, "rough": plan.rough.model_copy(update={"field": rough})})
    return ExampleLabel(schema_version=SCHEMA_VERSION, key=plan.key, index=0, split=split, plan=plan, layers={},
                        record=render_record(field=records))


def test_each_kind_and_use_is_a_row() -> None:
    one, two = record("a", psnr=30), record("b", psnr=34, opacity_iou=0.8)
    labels = [label("train", DENSITY, NONE, one), label("test", DENSITY, DENSITY, one),
              label("test", DENSITY, DENSITY, two), label("test", DENSITY, DENSITY, one),
              label("test", DENSITY, SDF, one, record("c", "sdf", views=20)), label("other", NONE, NONE)]
    found = field_summaries(labels)
    assert [(row.split, row.kind, row.gives, row.fields, row.views) for row in found] == [
        ("train", "density", ("i_s",), 1, 50), ("test", "density", ("i_s", "r3dm"), 2, 50),
        ("test", "density", ("i_s",), 1, 50), ("test", "sdf", ("r3dm",), 1, 20)]
    both = found[1]
    assert (both.psnr, both.psnr_worst, both.opacity_iou) == (32, 25, 0.8) and not both.captures


def test_what_was_not_measured_is_zero() -> None:
    row, = field_summaries([label("test", OWN, OWN, record("s", "splats", psnr=0, held_out=0, views=0, resolution=0))])
    assert row.captures and (row.psnr, row.psnr_worst, row.opacity_iou, row.views) == (0, 0, 0, 0)


def test_card_and_croissant_tell_of_fields(tmp_path) -> None:
    plain = build(tmp_path / "tiny")
    rows = field_summaries([label("test", DENSITY, DENSITY, record("a"))])
    seen: Manifest = plain.model_copy(update={"fields": rows})
    assert "### Fields" not in card(plain) and not plain.through_fields
    assert "| test | density | `i_s` and rough meshes | 1 | 50 | 48 | 30.0 | 25.0 | 0.900 |" in card(seen)
    assert "Synthetic, by path tracing" in card(seen) and "no photographs. Some of the images" in croissant(seen)
    rough_alone = plain.model_copy(update={"fields": (FieldSummary.model_validate({
        **rows[0].model_dump(), "gives": ("r3dm",)}),)})
    assert seen.through_fields and not rough_alone.through_fields
    assert "neural fields" not in croissant(rough_alone)
