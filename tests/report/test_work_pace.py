"""Rate and time left, against clocks that are made up."""

from collections.abc import Iterator

import numpy as np
import pytest

from dataset_builder.report.work_pace import POINTS, WorkPace


def finished(times: list[list[float]]) -> Iterator[float]:
    """When steps end, given what those of every process take."""
    yield from sorted(float(end) for own in times for end in np.cumsum(own))


def estimate(ends: list[float], share: float, workers: int) -> tuple[float, float]:
    """Time left as it is told after a share of the steps, and as it turns out."""
    pace, count = WorkPace(0.0, workers), round(share * len(ends))
    for end in ends[:count]:
        pace.add(end, 1.0)
    left = pace.left(ends[count - 1], len(ends) - count)
    assert left is not None
    return left, ends[-1] - ends[count - 1]


@pytest.mark.parametrize("workers", [1, 4, 16])
@pytest.mark.parametrize("step", [0.05, 3.0, 400.0])
def test_after_a_fifth_of_steady_work_the_end_is_known(workers: int, step: float) -> None:
    draw = np.random.default_rng(workers)
    own = [[5 * step + 30.0, *(step * draw.uniform(0.5, 1.5, 59))] for _ in range(workers)]
    told, true = estimate(list(finished(own)), 0.2, workers)
    assert told == pytest.approx(true, rel=0.15)


def test_a_slow_start_is_forgotten() -> None:
    """A twentieth of the steps takes twenty times as long each: half of the time."""
    ends = list(finished([[60.0] * 20 + [3.0] * 380]))
    told, true = estimate(ends, 0.2, 1)
    assert told == pytest.approx(true, rel=0.15)


def test_a_build_that_slows_down_is_noticed() -> None:
    ends = list(finished([[2.0] * 300 + [10.0] * 300]))
    told, true = estimate(ends, 0.7, 1)
    assert told == pytest.approx(true, rel=0.15)


def test_what_is_at_work_counts_in_part_and_a_stall_grows() -> None:
    pace = WorkPace(0.0)
    for end in (50.0, 60.0, 70.0):
        pace.add(end, 2.0, examples=4)
    assert pace.rate(70.0) == pytest.approx(0.4)
    assert pace.left(70.0, 20.0) == pytest.approx(100.0)
    assert pace.left(76.0, 20.0) == pytest.approx(94.0)
    assert pace.left(95.0, 20.0) == pytest.approx(90.0)
    # Nothing came for ten gaps: 4 units of work took 120 seconds
    assert pace.left(170.0, 20.0) == pytest.approx(550.0, rel=0.2)
    assert pace.left(1070.0, 20.0) > 5000.0  # type: ignore[operator]
    assert pace.left(70.0, 0.0) == 0.0


def test_nothing_is_said_before_anything_ended() -> None:
    pace = WorkPace(10.0)
    assert pace.rate(20.0) is None and pace.left(20.0, 5.0) is None
    pace.add(40.0, 1.0)
    assert pace.left(40.0, 5.0) == pytest.approx(150.0)


def test_a_million_steps_take_no_more_room() -> None:
    pace = WorkPace(0.0)
    for number in range(20_000):
        pace.add(0.01 * number, 1.0)
    assert len(pace._moments) <= POINTS + 1
    assert pace.rate(200.0) == pytest.approx(100.0, rel=0.01)
