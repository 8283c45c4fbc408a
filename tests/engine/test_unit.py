"""What a finished example is kept under, and what is remembered of a rejected one."""

from pathlib import Path

from dataset_builder.engine.made_by import plan_digest
from dataset_builder.engine.outcomes import Rejections
from dataset_builder.shards.manifest import Rejected
from dataset_builder.spec.dataset import DatasetSpec
from tests.plans import example_plan
from tests.shards.tiny_dataset import make_spec

MADE_BY = {"mitsuba": "3.9.1", "numpy": "2.0"}


def changed(**groups: object) -> DatasetSpec:
    """The small spec with some groups replaced."""
    return DatasetSpec.model_validate({**make_spec().model_dump(by_alias=True), **groups})


def test_the_digest_of_an_example_covers_its_plan_storage_gates_and_makers() -> None:
    known = plan_digest(example_plan(), make_spec(), MADE_BY)
    assert known == plan_digest(example_plan(), make_spec(), dict(reversed(MADE_BY.items())))
    others = [
        plan_digest(example_plan(sigma=0.0041), make_spec(), MADE_BY),
        plan_digest(example_plan(width=9), make_spec(), MADE_BY),
        plan_digest(example_plan(light=1), make_spec(), MADE_BY),
        plan_digest(example_plan(), make_spec("float16"), MADE_BY),
        plan_digest(example_plan(), changed(gates={"mask_overlap": 0.71}), MADE_BY),
        plan_digest(example_plan(), make_spec(), {**MADE_BY, "mitsuba": "3.9.2"}),
    ]
    assert len({known, *others}) == 1 + len(others)


def test_how_examples_are_cut_into_shards_does_not_make_them_others() -> None:
    cut = changed(storage={"dtype": "float32", "examples_per_shard": 5}, title="Another")
    assert plan_digest(example_plan(), cut, MADE_BY) == plan_digest(example_plan(), make_spec(), MADE_BY)


def rejected(index: int) -> Rejected:
    return Rejected(key=f"{index:08d}", view="train/000000", gate="coverage", reason="expected more")


def test_rejections_are_remembered_for_the_same_spec_and_versions(tmp_path: Path) -> None:
    first = Rejections(tmp_path, "spec", MADE_BY)
    assert first.known == {}
    first.add([rejected(1)])
    first.add([rejected(4)])
    assert Rejections(tmp_path, "spec", MADE_BY).known == {"00000001": rejected(1), "00000004": rejected(4)}
    another = Rejections(tmp_path, "another", MADE_BY)
    assert another.known == {}
    another.add([rejected(7)])
    assert Rejections(tmp_path, "spec", MADE_BY).known.keys() == {"00000001", "00000004"}
    assert Rejections(tmp_path, "spec", {**MADE_BY, "numpy": "2.1"}).known == {}


