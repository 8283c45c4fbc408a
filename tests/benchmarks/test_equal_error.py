"""Error against a noisy reference, and time to equal error."""

import math

import numpy as np
import pytest

from benchmarks._equal_error import Reference, common_error, time_to

TRUTH, SPREAD = 2.0, 0.1


def noisy(seed: int, spread: float) -> np.ndarray:
    return TRUTH + spread * np.random.default_rng(seed).standard_normal((64, 64, 3))


def test_the_noise_of_the_reference_does_not_count() -> None:
    inside = np.ones((64, 64), dtype=bool)
    reference = Reference.of(noisy(1, SPREAD), noisy(2, SPREAD), inside)
    exact = SPREAD**2 / (1.01 * TRUTH**2)
    assert reference.error(noisy(3, SPREAD)) == pytest.approx(exact, rel=0.05)
    uncorrected = np.mean((noisy(3, SPREAD).reshape(-1, 3) - reference.mean) ** 2) / (1.01 * TRUTH**2)
    assert uncorrected > 1.4 * exact


def test_only_the_pixels_inside_count() -> None:
    inside = np.zeros((64, 64), dtype=bool)
    inside[:8, :8] = True
    image = np.where(inside[..., None], TRUTH + 0.2, 1e6)
    clean = np.full((64, 64, 3), TRUTH)
    assert Reference.of(clean, clean, inside).error(image) == pytest.approx(0.04 / (1.01 * TRUTH**2))


def test_the_common_error_is_one_that_both_reached() -> None:
    assert common_error([1.0, 0.1, 0.01], [4.0, 0.04]) == pytest.approx(math.sqrt(0.04 * 1.0))


def test_time_follows_the_slope_between_and_beyond_settings() -> None:
    seconds, errors = [1.0, 4.0, 16.0], [0.8, 0.2, 0.05]
    for error in (0.8, 0.4, 0.1, 0.0125):
        assert time_to(error, seconds, errors, floor=False) == pytest.approx(0.8 / error)
    assert time_to(0.01, seconds, errors, floor=True) == math.inf
    assert time_to(1.6, seconds, errors, floor=True) == pytest.approx(1.0)


def test_a_setting_that_is_slower_and_worse_does_not_matter() -> None:
    assert time_to(0.2, [1.0, 2.0, 4.0], [0.8, 0.9, 0.2], floor=False) == pytest.approx(4.0)
