import numpy as np
import pytest

from dataset_builder.planning.view.blackbody import LUMINANCE, REC709_FROM_XYZ, chromaticity, colour


@pytest.mark.parametrize(("temperature", "x", "y"), [
    (2856, 0.4476, 0.4074),  # CIE illuminant A is a black body
    (6500, 0.3135, 0.3237),  # Planckian locus, Wyszecki and Stiles, table 1(3.11)
    (4000, 0.3805, 0.3768),
    (10000, 0.2807, 0.2884),
])
def test_the_chromaticity_is_the_tabulated_one(temperature: float, x: float, y: float) -> None:
    assert chromaticity(temperature) == pytest.approx((x, y), abs=2e-3)


@pytest.mark.parametrize("temperature", [1000.0, 1900.0, 2856.0, 6504.0, 40000.0])
def test_colours_have_luminance_one_and_no_negative_channel(temperature: float) -> None:
    assert LUMINANCE @ np.array(colour(temperature)) == pytest.approx(1)
    assert min(colour(temperature)) >= 0


def test_hotter_is_bluer() -> None:
    ratios = [colour(t)[2] / colour(t)[0] for t in (1500, 2500, 4000, 6500, 9000, 20000)]
    assert ratios == sorted(ratios)


def test_daylight_is_almost_white() -> None:
    assert colour(6504.0) == pytest.approx((1, 1, 1), abs=0.06)


def test_the_luminance_of_the_primaries_is_a_row_of_the_inverse_matrix() -> None:
    assert np.linalg.inv(REC709_FROM_XYZ)[1] == pytest.approx(LUMINANCE, abs=1e-9)
