"""The error of D between two passes, which the gate radiance_split allows for."""

import numpy as np
import pytest

from dataset_builder.shards.gates import sampling_error


def test_the_error_of_a_difference_of_means_by_hand() -> None:
    """(1/4 + 1/12) 4/3 = 4/9: the deviation is that of 4 samples about their own mean."""
    assert sampling_error(4, 12) == pytest.approx(2 / 3)


def test_its_mean_square_is_the_variance_of_the_difference() -> None:
    random = np.random.default_rng(2)
    first, other = random.random((20_000, 4)), random.random((20_000, 12))
    difference = first.mean(axis=1) - other.mean(axis=1)
    expected = np.mean((sampling_error(4, 12) * first.std(axis=1)) ** 2)
    assert np.mean(difference**2) == pytest.approx(expected, rel=0.05)
