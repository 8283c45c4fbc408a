"""Where further samples pay: a prediction of every pixel's noise from its neighbours, and the split that follows.

A pixel's own samples have no say, see `rounds`. Two things make a pixel noisy: the light that arrives, which is alike
nearby, and edges inside it, which show as contrast between its neighbours.
"""

import numpy as np

from dataset_builder.rendering.moments import FLOOR, Estimate
from dataset_builder.rendering.neighbours import around

EDGE = 0.5
"""Variance of a sample per variance of the neighbours' means, where an edge runs between them."""

LEAST = 0.15
"""Deviation at least, in root mean squares over the layer: the prediction may miss something."""

SHARE = 0.95
"""Share of the pixels that a goal is to hold for."""


def predicted_deviation(found: Estimate, channels: slice, inside: np.ndarray, pixels: np.ndarray,
                        width: int) -> np.ndarray:
    """(P,) deviation of one sample of each pixel, relative as `moments.relative` means it; 0 for pixels not `inside`.

    found: what is known so far. pixels: (P,) indices row * width + column.
    """
    if not inside.any():
        return np.zeros(len(pixels))
    mean = found.mean[inside, channels]
    error = found.error[inside, channels] ** 2
    values = np.concatenate([mean, mean**2, error, error * found.spp[inside, None]], axis=1)
    of_means, squares, doubt, noise = np.split(around(values, pixels[inside], width), 4, axis=1)
    contrast = np.maximum(squares - of_means**2 - doubt, 0)
    floor = FLOOR * float(np.abs(mean).mean())
    relative = (noise + EDGE * contrast) / np.maximum(of_means**2 + floor**2, np.finfo(np.float64).tiny)
    deviation = np.sqrt(relative.mean(axis=1))
    deviation = np.maximum(deviation, LEAST * np.sqrt(np.mean(deviation**2)))
    result = np.zeros(len(pixels))
    result[inside] = deviation
    return result


def wanted(deviation: np.ndarray, error: float) -> np.ndarray:
    """(P,) samples that bring the error of SHARE of the pixels to `error`: n = (s / error)^2 sqrt(q / s), for a
    deviation s and its quantile q over the layer.

    Halfway, in the exponent of s, between the split with the smallest mean squared error, n ~ s (Neyman), and the one
    with equal errors everywhere, n ~ s^2.
    """
    inside = deviation > 0
    if not inside.any():
        return np.zeros(len(deviation))
    q = float(np.quantile(deviation[inside], SHARE))
    return deviation**1.5 * np.sqrt(q) / error**2
