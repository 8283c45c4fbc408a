"""The comparison of pictures that were exported and read back, on noise made here."""

import numpy as np

from benchmarks.round_trip import FAILURES, verdict
from dataset_builder.seeding import rng


def noise(name: str, mean: float = 1.0) -> np.ndarray:
    return rng(1, name).normal(mean, 0.1, (16, 12, 13, 3))


def test_equal_pictures_pass_and_brighter_ones_do_not() -> None:
    equal = verdict("i_t", noise("first"), noise("second"))
    assert equal.p > FAILURES and abs(equal.ratio - 1) < 0.01
    assert verdict("i_t", noise("first"), noise("second", 1.05)).p < FAILURES


def test_a_single_block_shows() -> None:
    second = noise("second")
    second[:, 4:8, 4:8] += 0.1
    assert verdict("i_t", noise("first"), second).p < FAILURES


def test_what_has_no_noise_is_left_out() -> None:
    first, second = noise("first"), noise("second")
    first[:, :4], second[:, :4] = 1, 1
    assert verdict("i_t", first, second).p > FAILURES
