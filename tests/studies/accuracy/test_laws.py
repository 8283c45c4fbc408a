"""Laws of rows that obey them, intervals that hold the truth as often as they say, and ratios of equal error."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.studies.accuracy.laws import equal_error, interval, laws, scatter
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.straight_line import straight_line
from tests.studies.accuracy.made_rows import jittered, sampled, study, uniform


def test_a_line_without_noise_is_found() -> None:
    found = straight_line(np.array([1.0, 2, 4, 8]), np.array([5.0, 7, 11, 19]))
    assert (found.slope, found.rest) == pytest.approx((2, 3))
    assert found.slope_within < 0.1 and found.at(10) == pytest.approx(23)


def test_neither_part_is_below_zero() -> None:
    falling = straight_line(np.array([1.0, 2, 3]), np.array([3.0, 2, 1]))
    assert falling.slope == 0 and falling.rest > 0
    steep = straight_line(np.array([1.0, 2, 4]), np.array([1.0, 4, 16]))
    assert steep.rest == 0 and steep.slope > 0 and steep.rest_within > 0


def test_one_point_is_no_line() -> None:
    with pytest.raises(ValueError, match="two points"):
        straight_line(np.ones(1), np.ones(1))


def test_intervals_hold_the_truth_in_19_of_20() -> None:
    """400 fits of 12 points that scatter by a tenth: 95% of 400 is 380 with a deviation of 4.4."""
    random, across = np.random.default_rng(5), np.repeat([4.0, 16, 64, 256], 3)
    held = np.zeros(2)
    for _ in range(400):
        found = straight_line(across, (0.01 * across + 0.5) * (1 + 0.1 * random.standard_normal(len(across))))
        held += abs(found.slope - 0.01) <= found.slope_within, abs(found.rest - 0.5) <= found.rest_within
    assert held.min() >= 360 and held.max() <= 396


def test_what_all_points_share_widens_the_rest_alone() -> None:
    across, up = np.array([1.0, 2, 4]), np.array([3.1, 4.9, 9.0])
    plain, shared = straight_line(across, up), straight_line(across, up, shared=1.0)
    assert shared.slope_se == plain.slope_se and shared.rest_se == pytest.approx(math.hypot(plain.rest_se, 1))


def test_the_law_of_known_rows() -> None:
    law, = laws(uniform(fixed=0.5, gain=4, bias=0.001), "seconds")
    assert (law.error.slope, law.error.rest) == pytest.approx((0.25, 0.001))
    assert (law.time.slope, law.time.rest) == pytest.approx((0.01, 0.5))
    assert (law.least, law.most) == (16, 1024)


def test_goals_end_in_proportion_and_first_rounds_do_not_count() -> None:
    rows = [sampled("adaptive", 100 / goal**2, value=goal, gain=1 / 25, spread=1) for goal in (0.2, 0.1)]
    law, = laws([*rows, sampled("adaptive", 16, value=0.9), sampled("adaptive", 16, value=0.8)], "seconds")
    # relMSE is 25 / n with n = 100 / g^2, so a quarter of the squared goal
    assert law.error.slope == pytest.approx(0.25) and law.error.rest == 0


def test_the_noise_of_the_reference_is_no_floor_but_widens_it() -> None:
    sharp, = laws(uniform(), "seconds")
    dull, = laws(uniform(floor=0.01), "seconds")
    assert dull.error.slope == pytest.approx(1) and dull.error.rest == pytest.approx(0, abs=1e-9)
    assert dull.error.rest_within > 0.2 * 0.01 > sharp.error.rest_within


def test_equal_error_of_a_method_twice_as_good() -> None:
    rows = uniform() + [sampled("adaptive", spp, gain=2, spread=1) for spp in (4, 40, 400)]
    found = equal_error(rows, laws(rows, "seconds"), "adaptive", "seconds")
    assert [ratio.seconds for ratio in found] == pytest.approx([0.5] * 3)
    assert [ratio.paths for ratio in found] == pytest.approx([0.5] * 3)


@pytest.mark.parametrize("row", [sampled("adaptive", 1e5, spread=1), sampled("adaptive", 16, spread=1, example="1"),
                                 sampled("adaptive", 16, spread=1, floor=1.0), sampled("adaptive", 16)])
def test_equal_error_leaves_out_what_cannot_be_told(row: AccuracyRow) -> None:
    rows = [*uniform(), row]
    assert equal_error(rows, laws(rows, "seconds"), "adaptive", "seconds") == []


def test_scatter_is_that_of_runs_of_one_setting() -> None:
    rows = study(runs=8)
    assert scatter(rows, "cpu_seconds") == pytest.approx(0, abs=1e-12)
    restless = [replace(row, cpu_seconds=row.cpu_seconds / 2) for row in jittered(rows, 0.3, 1)]
    assert 0.2 < scatter(restless, "seconds") < 0.4
    assert math.isnan(scatter(rows[:1], "seconds"))


def test_an_interval_of_ratios_by_hand() -> None:
    # Logarithms -1, 0, 1: deviation 1, t(0.975, 2) = 4.3027
    middle, low, high = interval([math.exp(-1), 1.0, math.e])
    assert middle == pytest.approx(1) and math.log(high) == pytest.approx(4.30265 / math.sqrt(3), rel=1e-4)
    assert low * high == pytest.approx(1) and interval([2.0])[1:] == (0, math.inf)
