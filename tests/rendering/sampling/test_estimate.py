"""Means and standard errors: honest on integrands whose answer is known."""

import drjit as dr
import numpy as np
import pytest
from scipy import stats

from dataset_builder.rendering.sampling.estimate import estimate, stratified

SIZE = 24


def run(integrand, spp=64, batches=4, seed=1, pixels=None, size=SIZE):
    pixels = np.arange(size * size) if pixels is None else pixels
    return estimate(integrand, pixels, width=size, height=size, spp=spp, batches=batches, seed=seed)


def noisy(samplers, position):
    """Expectation 1/3 in every pixel, with variance that stratification cannot remove."""
    return [dr.square(samplers.rest.next_1d())]


def ramp(samplers, position):
    """Film position: its mean over a pixel is the pixel's centre."""
    return [position.x, position.y]


def test_pixels_cover_their_area():
    found = run(ramp, spp=256)
    row, column = np.divmod(np.arange(SIZE * SIZE), SIZE)
    assert np.allclose(found.mean, np.stack([column + 0.5, row + 0.5], axis=1) / SIZE, atol=2e-3 / SIZE)


def test_pixel_lists_are_the_frame_where_asked():
    pixels = np.array([3, 50, 51, 400])
    found = run(ramp, pixels=pixels)
    row, column = np.divmod(pixels, SIZE)
    assert np.allclose(found.mean[:, 0] * SIZE, column + 0.5, atol=0.05)
    assert np.allclose(found.mean[:, 1] * SIZE, row + 0.5, atol=0.05)


def test_standard_errors_cover_the_truth():
    found = run(noisy, spp=64, batches=16)
    t = (found.mean[:, 0] - 1 / 3) / found.error[:, 0]
    inside = np.abs(t) < stats.t.ppf(0.975, df=15)
    # 95% of 576 pixels, give or take four binomial deviations.
    assert abs(inside.mean() - 0.95) < 4 * np.sqrt(0.95 * 0.05 / inside.size)
    total = (found.mean[:, 0].mean() - 1 / 3) / (np.sqrt(np.mean(found.error[:, 0] ** 2)) / SIZE)
    assert abs(total) < 4


def test_errors_do_not_count_what_stratification_removes():
    found = run(ramp, spp=64, batches=16)
    plain = 1 / SIZE / np.sqrt(12) / np.sqrt(64)
    assert found.error.mean() < 0.5 * plain


def test_spp_grows_until_batches_are_equal_and_fill_their_grids():
    assert stratified(64, 4) == (1, 4, 16)
    assert stratified(36, 4) == (1, 4, 9)
    assert stratified(22, 4) == (1, 4, 6)
    assert stratified(9000, 4)[0] == 3
    repetitions, batches, each = stratified(4 * 23, 4)
    assert repetitions * batches * each == 4 * 24
    assert stratified(1, 4) == (1, 1, 1)


@pytest.mark.parametrize("spp", [2, 8, 16, 24, 36, 48, 64, 100])
def test_numbers_of_different_calls_are_unrelated(spp):
    """Products of nine numbers, film position included, over 36,864 pixels: |z| < 4.5 each, one false alarm in 4,000.
    Batches of 9 and 25 are of `multijitter`, whose correlations may be 0.01; in batches of 4 it has 0.08."""
    tolerated = 0.01 / 12 if spp in (36, 100) else 0
    def products(samplers, position):
        drawn = [axis - 0.5 for _ in range(3) for axis in samplers.strata.next_2d()]
        drawn += [samplers.strata.next_1d() - 0.5, *(dr.fma(position, 192, 0.5) - dr.floor(position * 192) - 1)]
        return [drawn[i] * drawn[j] for i in range(len(drawn)) for j in range(i)]

    found = run(products, spp=spp, pixels=np.arange(192 * 192), size=192)
    error = np.sqrt(np.mean(found.error**2, axis=0) / len(found.mean))
    assert (np.abs(found.mean.mean(axis=0)) < 4.5 * error + tolerated).all()


def test_chunks_of_a_large_list_differ_and_repeat(monkeypatch):
    monkeypatch.setattr("dataset_builder.rendering.sampling.estimate.LANES", 64 * 100)
    first, second = run(noisy), run(noisy)
    assert np.array_equal(first.mean, second.mean)
    assert len(np.unique(first.mean)) > 0.95 * first.mean.size
