"""Light paths of two scenes in one order, and random numbers that belong to lanes."""

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import stats

from dataset_builder.rendering.transport.lane_numbers import LaneNumbers
from dataset_builder.rendering.transport.light_paths import BRIGHT, EDGES, FLUX, WIDTH, LightVertices
from dataset_builder.rendering.transport.side_by_side import beside
from dataset_builder.seeding import rng

PATHS = 40


def vertices(seed: int, lengths: np.ndarray, shared: np.ndarray) -> LightVertices:
    """Paths of so many vertices, of which the first `shared` are the same for every seed."""
    rows, path = [], []
    for number, (length, same) in enumerate(zip(lengths, shared, strict=True)):
        for edge in range(length):
            row = rng(0 if edge < same else seed, number, edge).uniform(0.1, 1, WIDTH).astype(np.float32)
            row[EDGES] = edge + 1
            rows.append(row)
            path.append(number)
    return LightVertices(paths=PATHS // 2, sets=2, values=np.array(rows), prim=np.arange(len(rows), dtype=np.uint32),
                         path=np.array(path, dtype=np.uint32))


def test_both_have_the_same_places_and_the_others_are_dark() -> None:
    stream = rng(3, "lengths")
    shared, more, less = (stream.integers(0, 4, PATHS) for _ in range(3))
    one, other = vertices(1, shared + more, shared), vertices(2, shared + less, shared)
    ours, theirs = beside(one, other), beside(other, one)
    assert len(ours.values) == shared.sum() + more.sum() + less.sum() == len(theirs.values)
    kept = np.ones(WIDTH, dtype=bool)
    kept[BRIGHT] = kept[FLUX] = False
    assert np.array_equal(ours.values[:, kept], theirs.values[:, kept]) and np.array_equal(ours.path, theirs.path)
    for found, own in ((ours, one), (theirs, other)):
        lit = found.values[:, BRIGHT] > 0
        order, before = (np.lexsort((each.values[:, EDGES], each.path)) for each in (found, own))
        of_own = order[lit[order]]
        assert np.array_equal(found.values[of_own], own.values[before])
        assert np.array_equal(found.prim[of_own], own.prim[before])
        assert not found.values[~lit, FLUX].any()
    both = (ours.values[:, BRIGHT] > 0) & (theirs.values[:, BRIGHT] > 0)
    assert both.sum() == shared.sum()


def test_paths_of_one_scene_beside_themselves_stay_as_they_are() -> None:
    lengths = rng(4, "lengths").integers(0, 5, PATHS)
    one = vertices(1, lengths, lengths)
    same = beside(one, one)
    assert np.array_equal(same.values, one.values) and np.array_equal(same.prim, one.prim)
    nothing = vertices(1, np.zeros(PATHS, dtype=int), lengths)
    empty = LightVertices(paths=nothing.paths, sets=2, values=np.zeros((0, WIDTH), np.float32),
                          prim=np.zeros(0, np.uint32), path=np.zeros(0, np.uint32))
    assert beside(one, empty).values[:, BRIGHT].min() > 0 and not beside(empty, one).values[:, BRIGHT].any()


def test_numbers_of_a_lane_are_its_own() -> None:
    """The same beside others and alone; uniform, and unrelated to those of the next lane and of another seed."""
    lanes, few = mi.UInt32(np.arange(20000)), mi.UInt32([7, 4999, 13])
    whole, part, other = (LaneNumbers.of(each, seed) for each, seed in ((lanes, 5), (few, 5), (lanes, 6)))
    first, pair = np.array(whole.next_1d()), np.array(whole.next_2d())
    assert np.array_equal(first[[7, 4999, 13]], np.array(part.next_1d()))
    assert np.array_equal(pair[:, [7, 4999, 13]], np.array(part.next_2d()))
    assert first.min() >= 0 and first.max() < 1 and stats.kstest(first, "uniform").pvalue > 1e-3
    limit = stats.norm.isf(1e-3) / np.sqrt(len(first))
    for second in (pair[0], pair[1], np.roll(first, 1), np.array(other.next_1d())):
        assert abs(np.corrcoef(first, second)[0, 1]) < limit
    assert dr.width(whole.state.state) == 20000
