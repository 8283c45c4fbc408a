"""A Gaussian field has the variance and covariance that it says, at points and not on meshes."""

import numpy as np
import pytest
from scipy.stats import kstest, norm

from dataset_builder.errors import UserError
from dataset_builder.geometry.random_fields import gaussian_field
from dataset_builder.seeding import rng

SEEDS = 6000
ERROR_RATE = 1e-6
"""Chance that a right generator fails one Z-test; the seeds are fixed, so it is drawn once."""
LIMIT = norm.ppf(1 - ERROR_RATE / 2)


def values(points, **how):
    """(SEEDS, N) first component of the fields of many seeds at (N, 3) points."""
    return np.stack([gaussian_field(rng(7, "field", seed), **how).at(np.asarray(points, float))[:, 0]
                     for seed in range(SEEDS)])


def off(products, expected):
    """Distance of the mean of independent values from what is expected, in standard errors."""
    return abs(products.mean() - expected) / (products.std(ddof=1) / np.sqrt(len(products)))


@pytest.mark.parametrize("how", [{"length": 0.3}, {"length": 0.2, "octaves": 3},
                                 {"length": 0.2, "octaves": 2, "gain": 1}])
def test_mean_zero_and_variance_one_at_a_point(how):
    at = values([(0.3, -2, 5)], **how)[:, 0]
    assert off(at, 0) < LIMIT and off(at**2, 1) < LIMIT
    assert off((1.1 * at) ** 2, 1) > LIMIT
    assert kstest(at, "norm").pvalue > ERROR_RATE


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0.6, -0.8)])
def test_covariance_falls_as_stated(direction):
    distances = np.array([0, 0.15, 0.3, 0.6])
    at = values(distances[:, None] * direction, length=0.3)
    for index, distance in enumerate(distances):
        products = at[:, 0] * at[:, index]
        assert off(products, np.exp(-((distance / 0.3) ** 2) / 2)) < LIMIT
        assert off(products, np.exp(-((distance / 0.33) ** 2) / 2) + 0.1) > LIMIT


def test_octaves_have_half_the_length_and_gain_times_the_amplitude():
    at = values([(0, 0, 0), (0.2, 0, 0)], length=0.2, octaves=2, gain=0.5)
    expected = (np.exp(-0.5) + 0.25 * np.exp(-2)) / 1.25
    assert off(at[:, 0] * at[:, 1], expected) < LIMIT
    assert off(at[:, 0] * at[:, 1], np.exp(-0.5)) > LIMIT


def test_stretched_fields_are_long_across_their_axis_alone():
    at = values([(0, 0, 0), (0.2, 0, 0), (0, 0, 0.2)], length=0.2, axis=np.array([1.0, 0, 0]), stretch=10)
    assert off(at[:, 0] * at[:, 1], np.exp(-0.5)) < LIMIT
    assert off(at[:, 0] * at[:, 2], np.exp(-0.5 / 100)) < LIMIT


def test_components_are_independent():
    at = np.stack([gaussian_field(rng(3, seed), length=0.3, components=3).at(np.zeros((1, 3)))[0]
                   for seed in range(SEEDS)])
    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert off(at[:, one] * at[:, other], 0) < LIMIT


def test_a_value_depends_on_its_point_alone():
    field = gaussian_field(rng(1), length=0.1, octaves=2, components=3)
    points = rng(2).uniform(-1, 1, (10_000, 3))
    np.testing.assert_allclose(field.at(points)[7000:7100], field.at(points[7000:7100]), atol=1e-13)
    again = gaussian_field(rng(1), length=0.1, octaves=2, components=3).at(points)
    assert again.tobytes() == field.at(points).tobytes()
    other = gaussian_field(rng(2), length=0.1, octaves=2, components=3).at(points)
    assert abs(np.corrcoef(other[:, 0], again[:, 0])[0, 1]) < 0.2


@pytest.mark.parametrize("wrong", [{"length": 0}, {"length": 1, "gain": 0}, {"length": 1, "octaves": 0},
                                   {"length": np.nan}, {"length": 1, "stretch": -1}])
def test_wrong_numbers_are_named(wrong):
    with pytest.raises(UserError, match="expected a finite number > 0"):
        gaussian_field(rng(0), **wrong)
