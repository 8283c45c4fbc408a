"""How far an image is from its reference: relMSE, PSNR after the dataset's tone mapping, and HDR-FLIP.

All take (H, W, C) linear images and `keep`, the (H, W) pixels that count: the object's for layers of extent `object`,
the frame for others.
"""

import math
from collections.abc import Iterable

import flip_evaluator
import numpy as np

from dataset_builder.tonemap import exposure, luminance, srgb

FLOOR = 0.1
"""Share of the mean below which a reference value counts as this share: dark pixels would rule the mean otherwise."""

ACES_WHITE = 2.1189
"""Value that FLIP's ACES curve (K. Narkowicz, 2015, with its exposure of 0.6) takes to 0.85, see `_exposures`."""

DARKEST = 2.0**-10
"""Least median luminance, as a share of the largest, that FLIP's exposures follow."""


def relative_mse(image: np.ndarray, reference: np.ndarray, keep: np.ndarray) -> float:
    """mean((x - r)^2 / (r^2 + 0.01 m^2)) over the kept pixels and channels, m the mean of r over them; 0 for none.

    The denominator follows F. Rousselle et al., "Adaptive sampling and reconstruction using greedy error minimization",
    SIGGRAPH Asia 2011, whose constant 0.01 is in units of their images; here it is in units of the layer.
    """
    return _relative((image[keep].astype(np.float64) - reference[keep]) ** 2, reference[keep])


def relative_variance(deviation: np.ndarray, reference: np.ndarray, keep: np.ndarray) -> float:
    """The relMSE that noise of this standard deviation, per pixel and channel, is expected to give."""
    return _relative(deviation[keep].astype(np.float64) ** 2, reference[keep])


def _relative(squares: np.ndarray, reference: np.ndarray) -> float:
    if not squares.size:
        return 0.0
    wide = reference.astype(np.float64)
    denominator = wide**2 + (FLOOR * float(wide.mean())) ** 2
    return float(np.mean(squares / np.maximum(denominator, np.finfo(np.float64).tiny)))


def psnr(image: np.ndarray, reference: np.ndarray, keep: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of both under the reference's exposure and the sRGB curve; inf where equal.

    The exposure is `tonemap`'s over the kept pixels; the peak is 1, where that clips.
    """
    if not keep.any():
        return math.inf
    factor = exposure([np.where(keep[..., None], reference, 0)])
    pair = [srgb(values[keep].astype(np.float64) * factor) for values in (image, reference)]
    error = float(np.mean((pair[0] - pair[1]) ** 2))
    return -10 * math.log10(error) if error > 0 else math.inf


def flip(image: np.ndarray, reference: np.ndarray, keep: np.ndarray) -> float:
    """Mean HDR-FLIP over the kept pixels, in [0, 1] (P. Andersson et al., "Visualizing errors in rendered high dynamic
    range images", Eurographics 2021), at 67 pixels per degree, the others black in both; 0 where nothing is lit."""
    lit = luminance(reference)[keep]
    if not np.any(lit > 0):
        return 0.0
    pair = [_shown(values, keep) for values in (reference, image)]
    errors, _, _ = flip_evaluator.evaluate(*pair, "HDR", applyMagma=False, computeMeanError=False,
                                           parameters=_exposures(lit))
    return float(np.mean(errors[..., 0][keep]))


def _shown(values: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """(H, W, 3) float32, >= 0, contiguous and writable, as FLIP takes it."""
    kept = np.maximum(np.where(keep[..., None], values, 0), 0).astype(np.float32)
    return np.array(np.broadcast_to(kept, (*kept.shape[:2], 3)), order="C")


def _exposures(lit: np.ndarray) -> dict[str, float | int]:
    """FLIP's range of exposures (section 4.2 there): from where the largest luminance is nearly white to where the
    median is. Computed here over the kept pixels: FLIP's own ends the process where there is no range."""
    largest = float(lit.max())
    middle = max(float(np.median(lit)), DARKEST * largest)
    start, stop = (math.log2(ACES_WHITE / value) for value in (largest, middle))
    return {"startExposure": start, "stopExposure": stop, "numExposures": max(2, math.ceil(stop - start))}


def geometric_mean(values: Iterable[float]) -> float:
    """Geometric mean of the values above 0; NaN where there is none."""
    logs = [math.log(value) for value in values if value > 0 and math.isfinite(value)]
    return math.exp(math.fsum(logs) / len(logs)) if logs else math.nan
