"""Which views are in which part, and what a record of a part says."""

from pathlib import Path

import pytest

from dataset_builder.engine.dataset_part import DatasetPart, PartRecord, parts_of, read_record
from dataset_builder.errors import UserError
from dataset_builder.planning.catalogue import ViewUnit, examples, units
from dataset_builder.planning.unit_cost import unit_seconds
from dataset_builder.shards.folder import WORK
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset


@pytest.fixture(scope="module")
def spec(small_spec: Path) -> DatasetSpec:
    """18 views of three objects, of which those of the last have half as many examples."""
    return load_dataset(small_spec, ("splits.train.views=6", "splits.test.views=6")).dataset


def parts(spec: DatasetSpec, count: int) -> list[list[ViewUnit]]:
    found: list[list[ViewUnit]] = [[] for _ in range(count)]
    for part, unit in parts_of(spec, examples(spec), count):
        assert part.of == count
        found[part.number - 1].append(unit)
    return found


@pytest.mark.parametrize("count", [1, 2, 3, 7, 28, 100])
def test_every_view_is_in_one_part_and_parts_cost_the_same(spec: DatasetSpec, count: int) -> None:
    whole = sorted(units(examples(spec)), key=lambda unit: unit.view.name)
    found = parts(spec, count)
    assert sorted((unit for part in found for unit in part), key=lambda unit: unit.view.name) == whole
    costs = [sum(unit_seconds(spec, unit) for unit in part) for part in found]
    most = max(unit_seconds(spec, unit) for unit in whole)
    assert max(costs) - min(costs) <= 2 * most + 0.1


def test_a_part_sees_few_objects(spec: DatasetSpec) -> None:
    objects = [{(unit.view.pair.split, unit.view.pair.object) for unit in part} for part in parts(spec, 3)]
    assert sum(map(len, objects)) <= 3 + 2, "each cut divides one object at the most"


def test_a_view_with_more_examples_costs_more(spec: DatasetSpec) -> None:
    train, test = (next(unit for unit in units(examples(spec)) if unit.view.pair.split == name)
                   for name in ("train", "test"))
    assert len(train.examples) == 2 * len(test.examples)
    assert unit_seconds(spec, test) < unit_seconds(spec, train) < 2 * unit_seconds(spec, test)


def test_the_row_is_cut_by_the_middle_of_each_view(spec: DatasetSpec) -> None:
    """Three views of equal cost lie around 1/6, 1/2 and 5/6 of the row."""
    three = [ref for ref in examples(spec) if ref.view.pair.split == "train"]
    three = [ref for unit in units(three)[:3] for ref in unit.examples]
    numbers = {count: [part.number for part, _ in parts_of(spec, three, count)] for count in (1, 2, 3, 6)}
    assert numbers == {1: [1, 1, 1], 2: [1, 2, 2], 3: [1, 2, 3], 6: [2, 4, 6]}


@pytest.mark.parametrize("text", ["", "2", "0/3", "4/3", "-1/3", "1/0", "a/b", "1/2/3", "1.0/2", " 1/2", "1/9999999",
                                  "\u0661/\u0662"])
def test_what_is_no_part_is_refused(text: str) -> None:
    with pytest.raises(UserError, match=r"--part: expected k/n with k from 1 to n"):
        DatasetPart.parse(text)
    assert DatasetPart.parse("2/3") == DatasetPart(2, 3) and str(DatasetPart.parse("03/10")) == "3/10"


def test_a_damaged_record_is_none(tmp_path: Path) -> None:
    assert read_record(tmp_path) is None
    (tmp_path / WORK).mkdir()
    for text in (b"", b"{}", b'{"seal": ""}', b"\xff"):
        (tmp_path / WORK / "part.json").write_bytes(text)
        assert read_record(tmp_path) is None
    assert set(PartRecord.model_fields) >= {"spec_digest", "made_by", "examples", "rejected", "number", "of"}
