"""A few of many: evenly spread, all different, and the same every time."""

import pytest

from dataset_builder.spread import runs, shares, spaced, spread_indices


@pytest.mark.parametrize(("count", "wanted", "expected"), [
    (5, 0, [0, 1, 2, 3, 4]), (5, 9, [0, 1, 2, 3, 4]), (5, 5, [0, 1, 2, 3, 4]), (10, 2, [2, 7]), (9, 3, [1, 4, 7]),
    (7, 1, [3]), (0, 3, []),
])
def test_indices_are_spread_evenly(count: int, wanted: int, expected: list[int]) -> None:
    assert spread_indices(count, wanted) == expected


def test_spread_indices_differ_and_lie_within() -> None:
    for count in range(1, 40):
        for wanted in range(1, count):
            found = spread_indices(count, wanted)
            assert len(set(found)) == wanted and found == sorted(found) and found[0] >= 0 and found[-1] < count


def test_spaced_positions_hold_both_ends() -> None:
    assert spaced(10, 4).tolist() == [0, 3, 6, 9] and spaced(3, 8).tolist() == [0, 1, 2]


def test_runs_cover_everything_once() -> None:
    assert runs(10, 3) == [range(3), range(3, 6), range(6, 10)]
    assert all([place for run in runs(count, wanted) for place in run] == list(range(count))
               for count in range(20) for wanted in range(1, 20))


@pytest.mark.parametrize(("sizes", "wanted", "expected"), [
    ([8, 2], 5, [4, 1]), ([8, 2], 1, [1, 1]), ([8, 2], 100, [8, 2]), ([98, 1, 1], 10, [8, 1, 1]),
    ([5, 5, 5], 4, [2, 1, 1]),
])
def test_shares_follow_sizes_and_leave_no_group_out(sizes: list[int], wanted: int, expected: list[int]) -> None:
    assert shares(sizes, wanted) == expected
