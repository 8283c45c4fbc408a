"""Where further samples pay: how noisy each pixel is found to be, and the split of samples that follows."""

import numpy as np

from dataset_builder.rendering.sampling.moments import Estimate, relative

MIN_DEVIATION = 0.15
"""Deviation at least, in root mean squares over the layer: few samples may have missed what makes a pixel noisy."""

SHARE = 0.95
"""Share of the pixels that a goal is to hold for."""


def deviations(found: Estimate, channels: slice, inside: np.ndarray) -> np.ndarray:
    """(P,) deviation of one sample of each pixel, relative as `moments.relative` means it, root mean square over
    channels; 0 for pixels that are not `inside`."""
    result = np.zeros(len(inside))
    if inside.any():
        errors = relative(found.mean[inside, channels], found.error[inside, channels])
        own = np.sqrt(np.mean(errors**2, axis=1) * found.spp[inside])
        result[inside] = np.maximum(own, MIN_DEVIATION * np.sqrt(np.mean(own**2)))
    return result


def expected_error(deviation: np.ndarray, spp: np.ndarray) -> float:
    """What SHARE of the pixels with a deviation stay below, if each has `spp` (P,) samples; 0 for none."""
    inside = deviation > 0
    return float(np.quantile(deviation[inside] / np.sqrt(spp[inside]), SHARE)) if inside.any() else 0.0


def wanted(deviation: np.ndarray, error: float) -> np.ndarray:
    """(P,) samples that bring the error of SHARE of the pixels to `error`: n = (s / error)^2 sqrt(q / s), for a
    deviation s and its quantile q over the layer.

    Halfway, in the exponent of s, between the split with the smallest mean squared error, n ~ s (Neyman, Journal of the
    Royal Statistical Society 97, 1934), and the one with equal errors everywhere, n ~ s^2.
    """
    inside = deviation > 0
    if not inside.any():
        return np.zeros(len(deviation))
    q = float(np.quantile(deviation[inside], SHARE))
    return deviation**1.5 * np.sqrt(q) / error**2
