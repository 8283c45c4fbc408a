import numpy as np
import pytest

from dataset_builder.tonemap import exposure, srgb, to_8bit


def test_srgb_is_the_curve_of_the_standard() -> None:
    assert srgb(np.array([0.0, 0.0031308, 0.5, 1.0])) == pytest.approx([0, 0.04044994, 0.73535698, 1], abs=1e-7)
    assert srgb(np.array([-3.0, 7.0])) == pytest.approx([0, 1])


def test_exposure_brings_the_percentile_of_lit_pixels_to_white() -> None:
    image = np.zeros((10, 20, 3), np.float32)
    image[:5] = np.linspace(0.01, 1, 100, dtype=np.float32).reshape(5, 20, 1)
    assert exposure([image], percentile=50) == pytest.approx(1 / 0.505, rel=1e-6)
    assert exposure([image * 8], percentile=50) == pytest.approx(exposure([image], percentile=50) / 8)


def test_exposure_of_black_is_one() -> None:
    assert exposure([np.zeros((2, 2, 3), np.float32)]) == exposure([]) == 1.0


def test_green_counts_most() -> None:
    red, green = np.zeros((2, 1, 1, 3), np.float32)
    red[..., 0], green[..., 1] = 1, 1
    assert 1 / exposure([red]) == pytest.approx(0.2126)
    assert 1 / exposure([green]) == pytest.approx(0.7152)


def test_8_bit_is_grey_for_scalars_and_white_at_one() -> None:
    pixels = to_8bit(np.array([[[0.0], [0.5], [2.0]]], np.float32))
    assert pixels.shape == (1, 3, 3) and pixels.dtype == np.uint8
    assert pixels[0, :, 0].tolist() == pixels[0, :, 2].tolist() == [0, 188, 255]
