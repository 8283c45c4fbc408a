"""The files under scene_specs/ load, follow their schemas, and the schemas follow the models."""

from pathlib import Path

import jsonschema
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.plan import Planner
from dataset_builder.report.spec_help import export_schema, schema_files
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.load import load_dataset, read_document
from dataset_builder.spec.problems import dotted

FOLDER = Path(__file__).parents[2] / "scene_specs"
KINDS = {"rooms": "room", "objects": "object", "scenes": "scene", "scene_specs": "dataset",
         "training": "training"}
DATASETS = sorted(FOLDER.glob("*.yaml"))
TRAININGS = sorted((FOLDER / "training").glob("*.yaml"))
PARTS = sorted(file for name in ("rooms", "objects", "scenes") for file in (FOLDER / name).glob("*.yaml"))
FILES = [*DATASETS, *PARTS, *TRAININGS]
SCHEMAS = export_schema()


def listed(value: object) -> object:
    """JSON Schema knows lists, not tuples."""
    if isinstance(value, dict):
        return {key: listed(item) for key, item in value.items()}
    return [listed(item) for item in value] if isinstance(value, tuple) else value


def test_schemas_are_in_step() -> None:
    written = {file.name: file.read_text() for file in (FOLDER / "schema").iterdir()}
    assert written == schema_files(), "run `make schema`"


@pytest.mark.parametrize("kind", sorted(SCHEMAS))
def test_schemas_are_schemas(kind: str) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMAS[kind])


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_files_follow_their_schema_and_name_it(file: Path) -> None:
    kind = KINDS[file.parent.name]
    jsonschema.Draft202012Validator(SCHEMAS[kind]).validate(listed(read_document(file, file.name).data))
    first = file.read_text().splitlines()[0]
    assert (file.parent / first.split("$schema=")[1]).resolve() == FOLDER / "schema" / f"{kind}.schema.json"


@pytest.mark.parametrize(("kind", "data"), [
    ("dataset", {"name": "x", "splits": [], "sedd": 1}), ("room", {"width": "wide"}),
    ("room", {"width": {"unifrom": [1, 2]}}), ("scene", {}), ("object", {"params": {"width": [1]}}),
])
def test_schemas_refuse(kind: str, data: object) -> None:
    assert not jsonschema.Draft202012Validator(SCHEMAS[kind]).is_valid(data)


def test_every_family_has_an_object_file() -> None:
    assert set(FAMILIES) <= {file.stem for file in (FOLDER / "objects").glob("*.yaml")}


@pytest.mark.parametrize("path", DATASETS, ids=lambda path: path.stem)
def test_datasets_load(path: Path) -> None:
    loaded = load_dataset(path)
    assert loaded.dataset.name == path.stem
    assert loaded.objects and loaded.scenes and loaded.rooms


@pytest.mark.parametrize(("name", "expected"), [
    ("3df-lighting-mini", {"train": 64, "evaluation": 16}), ("3df-lighting-effects", {"train": 8}),
    ("3df-lighting", {"train": 6000, "evaluation": 6000}),
    ("3df-lighting-field-mini", {"train": 8, "evaluation": 4, "smooth": 2}),
    ("3df-lighting-dagger", {"train": 448, "evaluation": 96})])
def test_sizes(name: str, expected: dict[str, int]) -> None:
    spec = load_dataset(FOLDER / f"{name}.yaml").dataset
    assert {split.name: split.views * split.lights * len(split.levels(spec.rough)) * (
        split.objects.count * split.scenes.count if split.pairs == "all" else split.pairs)
        for split in spec.splits} == expected


def test_every_file_is_used() -> None:
    used = {dotted((kind, key)) for path in DATASETS for kind, specs in load_dataset(path).content().items()
            if isinstance(specs, dict) for key in specs}
    assert not [file for file in PARTS if f"{file.parent.name}.{file.relative_to(FOLDER).as_posix()}" not in used]


@pytest.mark.parametrize("path", DATASETS, ids=lambda path: path.stem)
def test_an_example_of_every_split_can_be_planned(path: Path) -> None:
    planner = Planner(load_dataset(path))
    for split in planner.loaded.dataset.splits:
        plan = next(plan for ref in planner.examples if ref.view.pair.split == split.name
                    if (plan := _planned(planner, ref)))
        asked = {"i_s": plan.field, "r3dm": plan.rough.field}
        kind = split.source.field if split.source.kind == "field" else "none"
        assert {gives: field.kind for gives, field in asked.items()} == {
            gives: kind if gives in split.source.gives else "none" for gives in asked}


def _planned(planner: Planner, ref: ExampleRef) -> ExamplePlan | None:
    try:
        return planner.example(ref)
    except PlanError:
        return None


def test_dagger_differs_from_128_by_what_is_seen() -> None:
    """Objects, rooms and cameras are the same, so that trainings tell what images of fields change."""
    plain, dagger = (Planner(load_dataset(FOLDER / f"3df-lighting-{name}.yaml")) for name in ("128", "dagger"))
    assert [ref.key for ref in plain.examples] == [ref.key for ref in dagger.examples]
    for index in (0, len(plain.examples) - 1):
        one, other = (planner.example(planner.examples[index]) for planner in (plain, dagger))
        for part in ("room", "target", "furniture", "camera"):
            assert getattr(one, part) == getattr(other, part)
        assert (one.rough == other.rough) == (one.split == "train") and one.field != other.field
