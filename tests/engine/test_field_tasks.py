"""Which fields a build makes, what makes a field another one, and what becomes of examples that one fails."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.engine import local
from dataset_builder.engine.field_tasks import GATE, FieldNews, NeededFields, make_fields, refusals
from dataset_builder.engine.unit import BuildJob
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.field_needs import field_needs
from dataset_builder.planning.pass_work import Rates
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.field_shelf import FieldShelf, tasks_of
from dataset_builder.spec.load import load_dataset
from tests.small_specs import write_spec

SOURCE = "{kind: field, views: 24, held_out: 4, size: 32, spp: 4, resolution: 32, steps: 40, gates: {psnr: 22}}"
FIELDS = "rough.fields=[{field: sdf, views: 20, held_out: 4, size: 32, spp: 4, resolution: 32, steps: 40}]"
SHELF = FieldShelf(folder=Path("/nowhere"), made_by={"code": "1"})
OBJECTS = {"objects/ottoman.yaml": "family: ottoman\n"}
RECORD = FieldRecord(key="ab", kind="density", truth=True, masked=True, views=24, held_out=4, width=32, resolution=32,
                     psnr=27.34, psnr_worst=21.0, ssim=0.9, opacity_iou=0.9512, silhouette_iou=0.98, level=0.0,
                     bodies=1, bodies_dropped=0, depth_95=0.02, loss=0.01)


def planner_for(folder: Path, *overrides: str, files: dict[str, str] | None = None) -> Planner:
    spec = write_spec(folder, files)
    return Planner(load_dataset(spec, ("layers={i_s: object, s_prime: object, mask: object, mask_field: object}",
                                       f"splits.test.source={SOURCE}", *overrides)))


def keys(planner: Planner, split: str = "test") -> set[str]:
    needed = NeededFields.of(field_needs(planner, planner.examples), SHELF)
    return {key for ref, needs in needed.by_example.items() if ref.view.pair.split == split for key in needs}


def test_needs_are_what_plans_have(tmp_path: Path) -> None:
    planner = planner_for(tmp_path, FIELDS)
    needs = field_needs(planner, planner.examples)
    for ref in planner.examples:
        planned = [(task.object, task.field) for task in tasks_of(planner.example(ref))]
        assert [(need.object, need.field) for need in needs.get(ref, ())] == planned
    # Four views of train objects see a mesh, and have a level with a field; the test object's field is one
    assert len(keys(planner, "test")) == 1 and len(keys(planner, "train")) == 2


@pytest.mark.parametrize(("changes", "same"), [
    ({"overrides": ["target.strength=3"]}, True), ({"overrides": ["splits.test.views=2"]}, True),
    ({"overrides": ["rough.sigma=0.01"]}, True), ({"overrides": ["splits.test.source.gates={psnr: 13}"]}, True),
    ({"files": {"rooms/den.yaml": "width: 5\ndepth: 4\nheight: 2.6\n"}}, True),
    ({"overrides": ["splits.test.source.steps=41"]}, False), ({"overrides": ["splits.test.source.views=25"]}, False),
    ({"overrides": ["source.sun={elevation: 50}"]}, False), ({"overrides": ["seed=2"]}, False),
    ({"files": {"objects/ottoman.yaml": "family: ottoman\nmaterials: {'*': {roughness: 0.9}}\n"}}, False)])
def test_what_makes_a_field_another_one(changes: dict[str, Any], same: bool, tmp_path: Path) -> None:
    before = keys(planner_for(tmp_path / "before"))
    after = keys(planner_for(tmp_path / "after", *changes.get("overrides", ()), files=changes.get("files")))
    assert (before == after) == same and len(before) == len(after) == 1


def finished(planner: Planner, **record: float) -> tuple[NeededFields, dict[str, FieldNews]]:
    """The fields of a dataset, each with the same figures."""
    needed = NeededFields.of(field_needs(planner, planner.examples), SHELF)
    return needed, {key: FieldNews(object=task.object.name, kind=task.field.kind, key=key,
                                   record=RECORD.model_copy(update=record)) for key, task in needed.tasks.items()}


def test_examples_of_a_field_that_fails_are_refused_with_figures(tmp_path: Path) -> None:
    planner = planner_for(tmp_path, FIELDS)
    assert list(refusals(*finished(planner))) == []
    refused = list(refusals(*finished(planner, psnr=21.96)))
    # Levels of noise of the training objects have no field
    assert sorted(outcome.ref.index for outcome in refused) == [2, 5, 8, 11, 12]
    rejected = refused[-1].rejected
    assert rejected and rejected.gate == GATE and rejected.reason == (
        "psnr: expected at least 22 dB over 4 held-out images inside their masks, got 21.96 (density field of "
        "test-ottoman-00)")
    both = next(refusals(*finished(planner, psnr=20.0, opacity_iou=0.5))).rejected
    assert both and "psnr" in both.reason and "opacity_iou: expected at least 0.8" in both.reason


def test_examples_without_a_field_are_refused_with_the_reason(tmp_path: Path) -> None:
    needed, news = finished(planner_for(tmp_path))
    failed = {key: FieldNews(object=each.object, kind=each.kind, key=key, failed="test-ottoman-00: expected a surface")
              for key, each in news.items()}
    refused = list(refusals(needed, failed))
    assert len(refused) == 1 and refused[0].rejected
    assert refused[0].rejected.reason == "no density field: test-ottoman-00: expected a surface"


def test_only_what_is_missing_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a stand-in for the engine, which makes nothing."""
    planner, asked = planner_for(tmp_path / "spec", FIELDS), list[str]()

    def run(work: Callable[..., Any], units: list[Any], *, workers: int, told: Callable[..., None]) -> Any:
        asked.extend(task.object.name for task in units)
        return iter([FieldNews(object=task.object.name, kind=task.field.kind, key=job.fields.key(task), record=RECORD)
                     for task in units])

    job = BuildJob.of(planner.loaded, tmp_path / "out", backend="llvm", threads=1)
    news = list(make_fields(job, planner.examples, frozenset(planner.examples), run=run, workers=2, told=print))
    assert sorted(asked) == ["test-ottoman-00", "train-cabinet-00", "train-nightstand-01"] and len(news) == 3
    asked.clear()
    assert list(make_fields(job, planner.examples[:2], frozenset(), run=run, workers=2, told=print)) == [] == asked


def test_costs_count_what_was_made(tmp_path: Path) -> None:
    planner = planner_for(tmp_path, FIELDS)
    none, rates = estimate(planner, views=3), Rates()
    assert (none.field_cost.count, none.field_cost.known, none.field_cost.images) == (3, 0, 24 + 4 + 2 * (20 + 4))
    known = estimate(planner, views=3, known=lambda target, _: target.name.startswith("train"))
    assert (known.field_cost.known, known.field_cost.images) == (2, 28)
    saved = none.field_cost.seconds - known.field_cost.seconds
    assert saved == pytest.approx(2 * (24 * (rates.seconds_per_image + 32**2 * 4 / rates.image_paths)
                                       + rates.seconds_per_field
                                       + 40 * (rates.seconds_per_step + 32**3 * rates.seconds_per_cell)))
    assert none.total.seconds - known.total.seconds == pytest.approx(saved)
    assert estimate(planner, views=3, known=lambda *_: True).field_cost.seconds == 0


def test_glass_is_warned_of(tmp_path: Path) -> None:
    glass = {"objects/ottoman.yaml": "family: ottoman\nmaterials: {'*': {transmission: 1, roughness: 0}}\n"}
    planner = planner_for(tmp_path, files=glass)
    said = [line for line in estimate(planner, views=3).warnings if "glass" in line]
    assert said == ["test-ottoman-00: 100% of the surface is glass, which a field cannot show: what is seen through it "
                    "moves with the camera; it may well fail its gates"]
    assert not any("glass" in note for note in planner.example(planner.examples[0]).notes)
    shutil.rmtree(tmp_path)
    assert not any("glass" in line for line in estimate(planner_for(tmp_path), views=3).warnings)


def _tells(unit: int, told: Callable[[str], None]) -> int:
    for step in range(3):
        told(f"{unit}.{step}")
    return unit


@pytest.mark.parametrize("workers", [1, 2])
def test_what_work_tells_comes_before_its_result(workers: int) -> None:
    told = list[str]()
    for result in local.run(_tells, [1, 2, 3], workers=workers, told=told.append):
        assert [line for line in told if line.startswith(f"{result}.")] == [f"{result}.{step}" for step in range(3)]
    assert len(told) == 9
