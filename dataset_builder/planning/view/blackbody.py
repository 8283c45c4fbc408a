"""The colour of a black body: Planck's law seen by the CIE 1931 observer, as linear Rec.709."""

from functools import lru_cache

import numpy as np

PLANCK_FIRST = 3.741771852e-16
"""First radiation constant 2 pi h c^2 in W m^2 (CODATA 2018)."""
PLANCK_SECOND = 1.438776877e-2
"""Second radiation constant h c / k in m K (CODATA 2018)."""
WAVELENGTHS = np.arange(380.0, 780.1, 2.0)
"""Nanometres."""

_LOBES = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)
REC709_FROM_XYZ = np.array([[3.2409699419, -1.5373831776, -0.4986107603],
                            [-0.9692436363, 1.8759675015, 0.0415550574],
                            [0.0556300797, -0.2039769589, 1.0569715142]])
"""ITU-R BT.709 primaries, white point D65."""
LUMINANCE = np.array([0.2126390059, 0.7151686788, 0.0721923154])
"""Relative luminance of the Rec.709 primaries: second row of the inverse of REC709_FROM_XYZ."""


def _lobe(wavelength: np.ndarray, weight: float, mean: float, below: float, above: float) -> np.ndarray:
    deviation = np.where(wavelength < mean, below, above)
    return weight * np.exp(-0.5 * ((wavelength - mean) / deviation) ** 2)


def matching_functions(wavelength: np.ndarray) -> np.ndarray:
    """(N, 3) CIE 1931 colour-matching functions x, y, z at wavelengths (N,) in nanometres.

    Multi-lobe fit of Wyman, Sloan and Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching
    Functions", JCGT 2(2), 2013, table 1.
    """
    return np.stack([sum(_lobe(wavelength, *lobe) for lobe in lobes) for lobes in _LOBES], axis=-1)


def planck(wavelength: np.ndarray, temperature: float) -> np.ndarray:
    """(N,) spectral exitance in W/m^3 of a black body at `temperature` kelvin, wavelengths (N,) in nanometres."""
    metres = wavelength * 1e-9
    return PLANCK_FIRST / metres**5 / np.expm1(PLANCK_SECOND / (metres * temperature))


def chromaticity(temperature: float) -> tuple[float, float]:
    """CIE 1931 (x, y) of a black body at `temperature` kelvin."""
    x, y, z = planck(WAVELENGTHS, temperature) @ matching_functions(WAVELENGTHS)
    return float(x / (x + y + z)), float(y / (x + y + z))


@lru_cache(maxsize=4096)
def colour(temperature: float) -> tuple[float, float, float]:
    """Linear Rec.709 of luminance 1 of a black body at `temperature` kelvin; what lies outside the gamut is clipped."""
    x, y = chromaticity(temperature)
    inside = np.maximum(REC709_FROM_XYZ @ np.array([x / y, 1.0, (1 - x - y) / y]), 0.0)
    red, green, blue = (float(channel) for channel in inside / (LUMINANCE @ inside))
    return red, green, blue
