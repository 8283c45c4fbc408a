"""Batches, rounds and layers to means and errors: against closed forms, and against what simulation says they claim."""

import numpy as np
import pytest

from dataset_builder.rendering.sampling.moments import (
    Estimate,
    averaged,
    gathered,
    of_batches,
    pooled,
    quantile,
    relative,
)
from dataset_builder.rendering.sampling.pixel_noise import moderated

RNG = np.random.default_rng(3)


def normal_round(pixels: int, spp: int, batches: int = 4, mean: float = 2.0, deviation: float = 1.0) -> Estimate:
    """What batches of a normal variable would give."""
    means = RNG.normal(mean, deviation / np.sqrt(spp / batches), (pixels, batches, 1))
    return of_batches(means, spp)


def test_batches_give_mean_error_and_freedom_by_hand():
    found = of_batches(np.array([[[1.0], [3.0], [2.0], [2.0]]]), spp=16)
    assert found.mean[0, 0] == 2.0 and found.freedom[0, 0] == 3 and found.spp[0] == 16
    assert found.error[0, 0] == pytest.approx(np.sqrt(2 / 12))


def test_one_batch_claims_nothing():
    assert np.isinf(of_batches(np.ones((1, 1, 2)), spp=4).error).all()


def test_the_first_half_and_the_largest_contribution_by_hand():
    """Batches -1, 3, 2, 2 of four samples each, then 8, 0 of two: a half is independent of the other, a peak is 16."""
    a = of_batches(np.array([[[-1.0], [3.0], [2.0], [2.0]]]), spp=16)
    assert a.half[0, 0] == 1.0 and a.peak[0, 0] == 12.0
    b = of_batches(np.array([[[8.0], [0.0]]]), spp=4)
    both = pooled([a, b])
    assert both.half[0, 0] == pytest.approx((16 * 1 + 4 * 8) / 20) and both.peak[0, 0] == 16.0
    halves = averaged([a, b])
    # Half of the mean is b's, and half of that its first batch's 8: 2 of the mean, 40 of twenty samples
    assert halves.half[0, 0] == a.mean[0, 0] and halves.peak[0, 0] == pytest.approx(40)
    # The first and third of a, the first of b; where they judge each other, both first halves
    assert a.odd[0, 0] == 0.5 and b.odd[0, 0] == 8.0 and both.odd[0, 0] == pytest.approx((16 * 0.5 + 4 * 8) / 20)
    assert halves.odd[0, 0] == (1 + 8) / 2
    alone = of_batches(np.array([[[5.0]]]), spp=2)
    assert alone.half[0, 0] == 5.0 and alone.peak[0, 0] == 10.0
    exact = Estimate.exact(np.array([[-2.0]])).padded(2)
    assert exact.half.tolist() == [[-2.0, 0.0]] and exact.peak.tolist() == [[2.0, 0.0]]


def test_entries_keep_the_largest_contribution():
    entries = of_batches(np.array([[[1.0], [2.0]], [[4.0], [0.0]], [[1.0], [1.0]]]), spp=8)
    found = gathered(entries, np.array([0, 0, 2]), 3)
    assert found.peak[:, 0].tolist() == [16.0, 0.0, 4.0] and found.half[:, 0].tolist() == [2.5, 0.0, 1.0]
    assert found.odd[:, 0].tolist() == [2.5, 0.0, 1.0]


def test_rounds_weigh_by_their_samples():
    a, b = (of_batches(np.array([[[x - 1], [x + 1.0]]]), spp=n) for x, n in ((1.0, 10), (4.0, 30)))
    both = pooled([a, b])
    assert both.mean[0, 0] == pytest.approx(3.25) and both.spp[0] == 40
    assert both.error[0, 0] == pytest.approx(np.hypot(0.25 * a.error[0, 0], 0.75 * b.error[0, 0]))
    # Satterthwaite: (u + v)^2 / (u^2 / 1 + v^2 / 1) with u, v the shares of the variance
    assert both.freedom[0, 0] == pytest.approx((1 + 9) ** 2 / (1 + 81))


def test_a_round_that_skipped_a_pixel_changes_nothing():
    first = normal_round(3, 16)
    later = gathered(normal_round(1, 64), np.array([1]), 3)
    both = pooled([first, later])
    for k in (0, 2):
        assert both.mean[k] == first.mean[k] and both.error[k] == first.error[k] and both.freedom[k] == 3
    assert both.spp.tolist() == [16, 80, 16]


def test_entries_of_a_pixel_are_gathered():
    entries = normal_round(5, 16)
    found = gathered(entries, np.array([0, 2, 2, 2, 3]), 5)
    assert found.spp.tolist() == [16, 0, 48, 16, 0] and found.freedom[:, 0].tolist() == [3, 0, 9, 3, 0]
    assert found.mean[2] == pytest.approx(entries.mean[1:4].mean(axis=0))
    assert found.error[2] == pytest.approx(np.sqrt((entries.error[1:4] ** 2).sum(axis=0)) / 3)


@pytest.mark.parametrize("rounds", [((16, 4),), ((16, 4), (64, 4)), ((16, 4), (16, 4), (256, 8))])
def test_intervals_cover_as_they_claim(rounds):
    pixels = 20_000
    found = pooled([normal_round(pixels, spp, batches) for spp, batches in rounds])
    covered = np.abs(found.mean - 2.0) <= found.interval(0.95)
    # Satterthwaite's freedom is an approximation: half a per cent beside four binomial deviations
    assert abs(covered.mean() - 0.95) < 0.005 + 4 * np.sqrt(0.95 * 0.05 / pixels)


def test_relative_errors_have_a_floor():
    mean, error = np.array([[0.0], [1.0], [2.0]]), np.full((3, 1), 0.3)
    found = relative(mean, error)[:, 0]
    assert found == pytest.approx([0.3 / 0.1, 0.3 / np.hypot(1, 0.1), 0.3 / np.hypot(2, 0.1)])
    assert np.isfinite(relative(np.zeros((2, 3)), np.zeros((2, 3)))).all()


def test_quantile_of_no_pixels_is_zero():
    assert quantile(np.zeros((0, 3))) == 0.0 and quantile(np.array([[3.0, 3.0]])) == pytest.approx(3.0)


def test_halves_weigh_the_same_whatever_their_samples():
    a, b = normal_round(3, 16), normal_round(3, 400)
    both = averaged([a, b])
    assert both.mean == pytest.approx((a.mean + b.mean) / 2) and (both.spp == 416).all()
    assert both.error == pytest.approx(np.hypot(a.error, b.error) / 2)


@pytest.mark.parametrize("pixels", [[5], [5, 6], [5, 7, 9], list(range(9)), list(range(400))])
def test_moderated_intervals_cover_whatever_the_shape_of_a_mask(pixels):
    """From a pixel alone, which keeps its own error, to a frame: 92 to 98% of 95% intervals hold the truth."""
    pixels = np.array(pixels)
    found = [moderated(normal_round(len(pixels), 16), pixels, 20) for _ in range(6000 // len(pixels))]
    covered = np.mean([np.abs(one.mean - 2.0) <= one.interval() for one in found])
    assert 0.92 < covered < 0.98
