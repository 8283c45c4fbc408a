"""Metrics against values worked out by hand, and against what is known of them."""

import math

import flip_evaluator
import numpy as np
import pytest

from dataset_builder.studies.image_errors import flip, geometric_mean, psnr, relative_mse, relative_variance

EVERYWHERE = np.ones((2, 2), dtype=bool)


def grey(*values: float) -> np.ndarray:
    """(2, 2, 3) image of four greys."""
    return np.repeat(np.array(values, dtype=np.float32).reshape(2, 2, 1), 3, axis=2)


def picture(seed: int = 0, side: int = 24) -> np.ndarray:
    """A high-dynamic-range picture."""
    return np.exp(np.random.default_rng(seed).normal(size=(side, side, 3))).astype(np.float32)


def test_relative_mse_by_hand() -> None:
    # m = 2.5, so that 0.01 m^2 = 0.0625
    found = relative_mse(grey(1, 2, 3, 6), grey(1, 2, 3, 4), EVERYWHERE)
    assert found == pytest.approx((2**2 / (4**2 + 0.0625)) / 4, rel=1e-6)


def test_only_kept_pixels_count_also_in_the_mean() -> None:
    keep = np.array([[True, False], [True, False]])
    found = relative_mse(grey(1, 7, 4, 9), grey(1, 100, 3, 100), keep)
    assert found == pytest.approx((1 / (9 + 0.01 * 2**2)) / 2, rel=1e-6)


def test_errors_do_not_depend_on_the_unit() -> None:
    image, reference, keep = picture(1), picture(2), np.ones((24, 24), dtype=bool)
    for metric in (relative_mse, psnr, flip):
        assert metric(image * 1024, reference * 1024, keep) == pytest.approx(metric(image, reference, keep), rel=1e-3)


def test_noise_of_the_reference_is_what_it_adds() -> None:
    stream, truth = np.random.default_rng(3), picture(4, 64)
    deviation = (0.2 * truth).astype(np.float32)
    noisy = (truth + deviation * stream.normal(size=truth.shape)).astype(np.float32)
    keep = np.ones(truth.shape[:2], dtype=bool)
    assert relative_mse(noisy, truth, keep) == pytest.approx(relative_variance(deviation, truth, keep), rel=0.05)


def test_psnr_by_hand() -> None:
    # All white after exposure; the sRGB curve takes a quarter to 0.5371
    found = psnr(grey(0.25, 1, 1, 1), grey(1, 1, 1, 1), EVERYWHERE)
    assert found == pytest.approx(-10 * math.log10((1 - 0.537099) ** 2 / 4), abs=1e-3)
    assert psnr(grey(1, 2, 3, 4), grey(1, 2, 3, 4), EVERYWHERE) == math.inf


def test_flip_of_a_whole_picture_is_the_package_s_own() -> None:
    image, reference = picture(5), picture(6)
    _, mean, _ = flip_evaluator.evaluate(reference, image, "HDR", applyMagma=False)
    assert flip(image, reference, np.ones((24, 24), dtype=bool)) == pytest.approx(mean, rel=2e-2)


def test_flip_of_equal_of_near_and_of_black_pictures() -> None:
    image, keep = picture(7), np.ones((24, 24), dtype=bool)
    assert flip(image, image, keep) == 0
    assert 0 < flip(image * np.float32(1.02), image, keep) < flip(image * np.float32(1.5), image, keep) < 1
    assert flip(image, np.zeros_like(image), keep) == 0


def test_flip_of_a_flat_picture_does_not_end_the_process() -> None:
    one = np.ones((1, 1, 3), dtype=np.float32)
    assert flip(one * np.float32(1.5), one, np.ones((1, 1), dtype=bool)) > 0


def test_nothing_kept_is_no_error() -> None:
    nothing = np.zeros((2, 2), dtype=bool)
    image = grey(1, 2, 3, 4)
    assert relative_mse(image, image * 2, nothing) == 0 and psnr(image, image * 2, nothing) == math.inf
    assert flip(image, image * 2, nothing) == 0


def test_geometric_mean() -> None:
    assert geometric_mean([1, 10, 100]) == pytest.approx(10)
    assert math.isnan(geometric_mean([]))
