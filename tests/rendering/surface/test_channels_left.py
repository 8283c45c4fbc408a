"""What a path has left of each channel, written into one number and read again."""

import mitsuba as mi
import numpy as np

from dataset_builder.rendering.surface.channels_left import BITS, kept, pack, unpack

LEVELS = 2**BITS - 1


def colours(rows):
    return mi.Color3f(*(mi.Float(column) for column in np.array(rows, np.float32).T))


def test_levels_are_in_proportion_and_never_lose_a_channel():
    left = np.random.default_rng(2).uniform(0, 1, (1000, 3)) ** 8
    left[:300, 0], left[200:400, 2] = 0, 0
    levels = np.array(unpack(pack(colours(left)))).T
    assert np.array_equal(levels > 0, left > 0)
    assert np.all(levels == np.rint(levels)) and np.all(levels.max(axis=1) == LEVELS)
    expected = left / left.max(axis=1, keepdims=True) * LEVELS
    assert np.all(levels >= expected - 1e-3) and np.all(levels < expected + 1 + 1e-3)


def test_one_channel_alone_stays_alone():
    alone = colours(np.eye(3) * [[0.01], [3], [1e-30]])
    assert np.array(unpack(pack(alone))).T.tolist() == (np.eye(3) * LEVELS).tolist()
    assert np.array(kept(pack(alone))).T.tolist() == np.eye(3).tolist()


def test_a_ray_that_says_nothing_has_all_channels():
    assert np.array(unpack(mi.Float(0))).tolist() == [[1], [1], [1]]
    assert np.array(kept(pack(colours([[0, 0, 0]])))).tolist() == [[1], [1], [1]]
