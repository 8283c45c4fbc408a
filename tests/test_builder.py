"""Which examples lie in which shard, which shards stay, and how much room a build needs: decided without rendering."""

from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.builder import ShardTask, decide, shard_tasks
from dataset_builder.digest import digest
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.planning.cost import expected_bytes
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.publish import whole_shards
from dataset_builder.shards.writer import writer_versions
from tests.shards.tiny_dataset import VERSIONS, build, index_path, make_spec, shard_path

MADE_BY = {**writer_versions(), **VERSIONS}


def refs(*splits: str) -> list[ExampleRef]:
    """One example per name of a split, in order of index."""
    return [ExampleRef(index=index, light=0, level=0,
                       view=ViewRef(number=index, camera=0, pair=PairRef(split=split, object=0, scene=0)))
            for index, split in enumerate(splits)]


TASKS = shard_tasks(refs("train", "train", "train", "test"), make_spec())


def indices(task: ShardTask) -> tuple[int, ...]:
    return tuple(ref.index for ref in task.examples)


def test_neighbours_share_a_shard_and_splits_do_not() -> None:
    assert [(task.slot, task.split, indices(task)) for task in TASKS] == [
        ("tiny-v1-train-000000", "train", (0, 1)), ("tiny-v1-train-000001", "train", (2,)),
        ("tiny-v1-test-000000", "test", (3,))]
    assert all(task.keep is None for task in TASKS)


@pytest.mark.parametrize(("size", "shards"), [
    (1, [(0,), (1,), (2,), (3,), (4,)]), (2, [(0, 1), (2, 3), (4,)]), (4, [(0, 1, 2, 3), (4,)]),
    (5, [(0, 1, 2, 3, 4)]), (9, [(0, 1, 2, 3, 4)])])
def test_example_i_of_a_split_lies_in_shard_i_over_size(size: int, shards: list[tuple[int, ...]]) -> None:
    storage = make_spec().storage.model_copy(update={"examples_per_shard": size})
    spec = make_spec().model_copy(update={"storage": storage})
    tasks = shard_tasks(refs(*["train"] * 5), spec)
    assert [indices(task) for task in tasks] == shards
    assert [int(task.slot[-6:]) for task in tasks] == list(range(len(shards)))


def kept(folder: Path, tasks: list[ShardTask] = TASKS, spec: str = "tiny", made_by: dict[str, str] = MADE_BY,
         rejected: dict[str, Rejected] | None = None) -> list[str]:
    """Slots of the shards that stay."""
    whole = list(whole_shards(folder))
    return [task.slot for task in decide(tasks, whole, digest(spec), made_by, rejected or {}) if task.keep]


def test_finished_shards_of_the_same_spec_and_versions_stay(tmp_path: Path) -> None:
    assert kept(tmp_path) == []
    build(tmp_path)
    assert kept(tmp_path) == [task.slot for task in TASKS]
    assert kept(tmp_path, spec="another") == kept(tmp_path, made_by={**MADE_BY, "renderer": "other"}) == []


def test_damaged_and_missing_shards_do_not(tmp_path: Path) -> None:
    build(tmp_path)
    index_path(tmp_path, TASKS[0].slot).unlink()
    path = shard_path(tmp_path, TASKS[2].slot)
    path.write_bytes(path.read_bytes()[:-1] + b"\1")
    assert kept(tmp_path) == [TASKS[1].slot]


def test_a_shard_stays_without_an_example_only_where_that_is_known_to_be_rejected(tmp_path: Path) -> None:
    build(tmp_path)
    wider = [replace(TASKS[1], examples=(*TASKS[1].examples, *refs(*["train"] * 6)[5:]))]
    assert kept(tmp_path, wider) == []
    rejected = Rejected(key="00000005", view="train/000005", gate="coverage", reason="expected more")
    assert kept(tmp_path, wider, rejected={rejected.key: rejected}) == [TASKS[1].slot]


def test_room_for_examples_grows_with_what_is_stored() -> None:
    spec = make_spec()
    assert expected_bytes(spec, 0) == 0
    assert expected_bytes(spec, 10) == pytest.approx(10 * expected_bytes(spec, 1), rel=1e-3)
    pixels, record = 8 * 6, 20_000
    # i_s and i_t on the frame; d, r, s_prime and mask on the object, which covers (0.08 + 0.6) / 2 of it
    raw = pixels * 4 * (6 + 10 * 0.34)
    assert record < expected_bytes(spec, 1) - 0.85 * raw < record + 0.1 * raw
    assert expected_bytes(spec, 1) > expected_bytes(make_spec("float16"), 1) > record
