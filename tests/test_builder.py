"""Which examples lie in which shard, which shards stay, and how much room a build needs: decided without rendering."""

from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.builder import build as build_dataset
from dataset_builder.digest import digest
from dataset_builder.engine.shard_tasks import ShardTask, decide, shard_tasks
from dataset_builder.errors import UserError
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.planning.cost import expected_bytes
from dataset_builder.shards.manifest import Rejected, shard_slot
from dataset_builder.shards.publish import whole_shards
from dataset_builder.shards.writer import writer_versions
from dataset_builder.spec.dataset import StorageSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.rough import RoughSpec
from tests.shards.tiny_dataset import SHARDS, VERSIONS, build, index_path, make_spec, shard_path

MADE_BY = {**writer_versions(), **VERSIONS}


def refs(*splits: str) -> list[ExampleRef]:
    """One example per name of a split, in order of index."""
    return [ExampleRef(index=index, light=0, level=0,
                       view=ViewRef(number=index, camera=0, pair=PairRef(split=split, object=0, scene=0)))
            for index, split in enumerate(splits)]


DIGESTS = dict.fromkeys(("train", "test"), digest("tiny"))
EXAMPLES = refs("train", "train", "train", "test")
TASKS = [ShardTask(slot=shard_slot(make_spec(), split, number), split=split, keep=None,
                   spec_digest=DIGESTS[split],
                   examples=tuple(EXAMPLES[index] for index in members)) for (split, number), members in SHARDS.items()]
"""Of the tiny dataset, which is not cut as a build would cut it."""


def indices(task: ShardTask) -> tuple[int, ...]:
    return tuple(ref.index for ref in task.examples)


def test_neighbours_share_a_shard_and_splits_do_not() -> None:
    tasks = shard_tasks(refs(*["train"] * 9, "test", "test"), make_spec(), DIGESTS)
    assert [(task.slot, task.split, indices(task)) for task in tasks] == [
        *((f"tiny-v1-train-{number:06d}", "train", members)
          for number, members in enumerate([(0, 1), (2, 3), (4, 5), (6, 7), (8,)])),
        ("tiny-v1-test-000000", "test", (9,)), ("tiny-v1-test-000001", "test", (10,))]
    assert all(task.keep is None for task in tasks)


@pytest.mark.parametrize(("most", "count", "sizes"), [
    (1, 5, [1] * 5), (2, 9, [2, 2, 2, 2, 1]), (4, 18, [4, 4, 4, 4, 2]), (9, 40, [9, 9, 9, 9, 4]),
    (16, 64, [16] * 4), (16, 16, [4] * 4), (16, 15, [3] * 5), (16, 7, [1] * 7), (16, 3, [1] * 3), (16, 1, [1]),
    (16, 30, [7, 7, 7, 7, 2])])
def test_a_split_is_cut_into_four_shards_or_more(most: int, count: int, sizes: list[int]) -> None:
    """Example i lies in shard i over size; four readers have work wherever there are four examples."""
    storage = make_spec().storage.model_copy(update={"examples_per_shard": most})
    tasks = shard_tasks(refs(*["train"] * count), make_spec().model_copy(update={"storage": storage}), DIGESTS)
    assert [index for task in tasks for index in indices(task)] == list(range(count))
    assert [len(task.examples) for task in tasks] == sizes and len(tasks) >= min(count, 4)
    assert [int(task.slot[-6:]) for task in tasks] == list(range(len(sizes)))


def kept(folder: Path, tasks: list[ShardTask] = TASKS, spec: str = "tiny", made_by: dict[str, str] = MADE_BY,
         rejected: dict[str, Rejected] | None = None) -> list[str]:
    """Slots of the shards that stay."""
    tasks = [replace(task, spec_digest=digest(spec)) for task in tasks]
    return [task.slot for task in decide(tasks, list(whole_shards(folder)), made_by, rejected or {}) if task.keep]


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
    storage = StorageSpec(examples_per_shard=2)
    levels = spec.model_copy(update={"rough": RoughSpec(sigma=(0.0, 0.1)), "storage": storage})
    splits = tuple(split.model_copy(update={"views": 4}) for split in spec.splits)
    each = levels.model_copy(update={"splits": splits})
    once = each.model_copy(update={"storage": StorageSpec(examples_per_shard=2, shared="once")})
    assert expected_bytes(once, 0, staged=5) == expected_bytes(each, 0, staged=5) == expected_bytes(each, 5)
    saved = expected_bytes(each, 1) - expected_bytes(once, 1)
    assert 0.4 * raw < saved < 0.5 * raw


@pytest.mark.parametrize("workers", [0, -1, 1.5])
def test_a_number_of_processes_that_is_none_is_refused(small_spec: Path, tmp_path: Path, workers: int) -> None:
    with pytest.raises(UserError, match="workers: expected a whole number >= 1"):
        next(build_dataset(load_dataset(small_spec), tmp_path / "out", backend="llvm", workers=workers))
    assert not (tmp_path / "out").exists()
