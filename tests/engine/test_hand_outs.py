"""What is handed out at a time, and what is tried after a process died: by arithmetic alone."""

from dataset_builder.engine.hand_outs import SECONDS, HandOut, after_death, grouped, reserved
from dataset_builder.errors import Problem
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef, ViewUnit
from dataset_builder.planning.cost import Cost


def unit(number: int, examples: int = 2, split: str = "train") -> ViewUnit:
    """A view with so many examples."""
    view = ViewRef(number=number, pair=PairRef(split=split, object=0, scene=0), camera=0)
    return ViewUnit(view=view, examples=tuple(ExampleRef(index=10 * number + k, view=view, light=k, level=0)
                                              for k in range(examples)))


def test_tiny_units_go_together_and_large_ones_alone() -> None:
    costs = {"train": Cost(seconds=SECONDS / 8, bytes=5), "test": Cost(seconds=SECONDS, bytes=7)}
    units = [unit(k) for k in range(10)] + [unit(k, split="test") for k in range(10, 13)]
    found = grouped(units, costs, workers=1)
    # Two examples of a training view take a quarter of the aim
    assert [len(one.units) for one in found] == [4, 4, 2, 1, 1, 1]
    assert [each for one in found for each in one.units] == units
    assert found[0].seconds == SECONDS and found[0].bytes == 40 and found[-1].bytes == 14


def test_every_worker_gets_its_share() -> None:
    units = [unit(k) for k in range(32)]
    assert [len(one.units) for one in grouped(units, {"train": Cost(seconds=1e-3)}, workers=2)] == [4] * 8
    # Nothing is known of their cost
    assert len(grouped(units, {}, workers=2)) == 32


def again(dead: HandOut) -> list[HandOut]:
    """What is tried after a death, where anything is."""
    found = after_death(dead, "why")
    assert not isinstance(found, Problem)
    return found


def test_after_a_death_comes_more_memory_then_each_example_then_the_end() -> None:
    group = HandOut(units=(unit(0), unit(1)), seconds=4.0, bytes=8.0)
    first = again(group)
    assert [one.units for one in first] == [(unit(0),), (unit(1),)]
    assert [(one.tries, one.seconds, one.bytes) for one in first] == [(1, 2.0, 4.0)] * 2
    halves = again(first[0])
    assert [[ref.index for ref in one.units[0].examples] for one in halves] == [[0], [1]]
    assert [(one.tries, one.seconds) for one in halves] == [(2, 1.0)] * 2
    end = after_death(halves[1], "why")
    assert isinstance(end, Problem) and str(end.where) == "example 00000001 (view train/000000)"
    assert end.rule == "why, 3 times"


def test_what_has_no_parts_is_tried_as_often() -> None:
    (second,) = again(HandOut(units=("a",)))
    (third,) = again(second)
    assert isinstance(end := after_death(third, "why"), Problem) and end.where == "a"


def test_memory_doubles_up_to_a_whole_machine() -> None:
    assert [reserved(tries, 3, 10) for tries in range(4)] == [3, 6, 10, 10]
