"""Notes of a build: seconds by example and step, sums, and what they cost."""

import csv
from pathlib import Path
from time import process_time

from dataset_builder.engine.field_tasks import FieldNews
from dataset_builder.engine.outcomes import Tally, Timings
from dataset_builder.engine.shard_tasks import OpenShards, ShardTask
from dataset_builder.engine.unit import Outcome
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.shards.folder import SECONDS, next_of
from dataset_builder.shards.manifest import Rejected

VIEW = ViewRef(number=0, camera=0, pair=PairRef(split="train", object=0, scene=0))


def ref(index: int) -> ExampleRef:
    return ExampleRef(index=index, view=VIEW, light=0, level=0)


def outcome(index: int, *, kept: bool = False, rejected: bool = False, **seconds: float) -> Outcome:
    why = Rejected(key=f"{index:08d}", view=VIEW.name, gate="coverage", reason="expected more") if rejected else None
    return Outcome(ref=ref(index), kept=kept, rejected=why, paths=10, seconds=seconds, recalled=("source",))


def rows(folder: Path) -> list[list[str]]:
    with (next_of(folder) / SECONDS).open(newline="") as stream:
        return list(csv.reader(stream))


def test_seconds_of_what_was_rendered_replace_earlier_ones(tmp_path: Path) -> None:
    timings = Timings(tmp_path)
    timings.add([outcome(2, target=1.5, plan=0.25), outcome(1, plan=1.0)])
    timings.write()
    timings = Timings(tmp_path)
    timings.add([outcome(2, rough=2.0), outcome(1, kept=True, plan=9.0), outcome(3)])
    timings.write()
    assert rows(tmp_path) == [["key", "step", "seconds"], ["00000001", "plan", "1.0000"],
                              ["00000002", "rough", "2.0000"]]


def test_seconds_of_an_objects_fields_stand_side_by_side(tmp_path: Path) -> None:
    timings = Timings(tmp_path)
    for key, seconds in (("aaaaaaaabb", 1.0), ("ccccccccdd", 2.0), ("aaaaaaaabb", 3.0)):
        timings.add_field(FieldNews(object='chair, "old"', kind="density", key=key, seconds={"fit": seconds}))
    timings.write()
    Timings(tmp_path).write()
    assert rows(tmp_path)[1:] == [['chair, "old"', "fit of density aaaaaaaa", "3.0000"],
                                  ['chair, "old"', "fit of density cccccccc", "2.0000"]]


def test_sums_over_outcomes() -> None:
    tally = Tally()
    for outcomes in ([outcome(0, plan=1.0, target=2.0)], [outcome(1, target=0.5), outcome(2, rejected=True)]):
        tally.add(outcomes)
    assert (tally.examples, tally.paths, tally.recalled) == (3, 30, 3)
    assert tally.seconds == {"plan": 1.0, "target": 2.5} and tally.runs == {"plan": 1, "target": 2}
    assert [item.key for item in tally.rejected] == ["00000002"]


def tasks(count: int, size: int) -> list[ShardTask]:
    return [ShardTask(slot=f"s-{first}", split="train", spec_digest="", keep=None,
                      examples=tuple(map(ref, range(first, first + size)))) for first in range(0, count, size)]


def test_a_shard_is_complete_with_its_last_example() -> None:
    opened = OpenShards(tasks(9, 3), {"00000004"})
    assert [[task.slot for task in opened.settle([ref(index)])] for index in (8, 0, 3, 1, 5, 2, 7, 6)] == [
        [], [], [], [], ["s-3"], ["s-0"], [], ["s-6"]]
    assert list(opened.settle([])) == []


def test_an_outcome_costs_the_same_in_a_large_build(tmp_path: Path) -> None:
    """Seconds of the processor for 2,000 outcomes among ten times as many: at most twice those among 2,000."""
    def spent(count: int) -> float:
        timings, opened = Timings(tmp_path), OpenShards(tasks(count, 10), ())
        timings.add([outcome(index, plan=1.0) for index in range(count - 2000)])
        last = [outcome(index, plan=1.0, target=2.0) for index in range(count - 2000, count)]
        begin = process_time()
        for each in last:
            timings.add([each])
            list(opened.settle([each.ref]))
        return process_time() - begin

    assert min(spent(20_000) for _ in range(3)) < 2 * max(min(spent(2000) for _ in range(3)), 0.01)
