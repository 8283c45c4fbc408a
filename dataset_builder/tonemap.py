"""Linear pictures to 8 bits for people to look at; no number of a dataset ever comes from here.

The picture is multiplied by one exposure, clipped to [0, 1] and encoded with the sRGB curve (IEC 61966-2-1). The
exposure brings the 98th percentile of the luminance of all lit pixels to white, so that a window or a lamp does not
darken the rest and the black around a cut-out object does not brighten it. Pictures to be compared share one exposure.
"""

from collections.abc import Iterable, Sequence

import numpy as np

WHITE_PERCENTILE = 98.0
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Rec.709 luminance of linear R, G, B."""


def luminance(image: np.ndarray) -> np.ndarray:
    """Luminance, (H, W) float64, of a linear (H, W, 3) or (H, W, 1) image."""
    return image[..., 0].astype(np.float64) if image.shape[2] == 1 else image.astype(np.float64) @ LUMINANCE


def exposure(images: Iterable[np.ndarray], percentile: float = WHITE_PERCENTILE) -> float:
    """Factor that brings the given percentile of the luminance of all lit pixels of `images` to 1; 1 if none is lit."""
    values = np.concatenate([luminance(image).ravel() for image in images] or [np.zeros(1)])
    lit = values[values > 0]
    return float(1 / np.percentile(lit, percentile)) if lit.size else 1.0


def srgb(linear: np.ndarray) -> np.ndarray:
    """sRGB-encoded values in [0, 1] of linear values, clipped to [0, 1] (IEC 61966-2-1)."""
    value = np.clip(linear, 0.0, 1.0)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * np.power(value, 1 / 2.4) - 0.055)


def to_8bit(image: np.ndarray, exposure: float = 1.0) -> np.ndarray:
    """(H, W, 3) uint8 of a linear (H, W, 3) or (H, W, 1) image, multiplied by `exposure` and sRGB-encoded."""
    encoded = np.rint(255 * srgb(image.astype(np.float64) * exposure)).astype(np.uint8)
    return np.ascontiguousarray(np.broadcast_to(encoded, (*image.shape[:2], 3)))


def side_by_side(images: Sequence[np.ndarray]) -> np.ndarray:
    """(H, sum of W, 3) uint8 of linear images of one height, next to each other under one exposure."""
    factor = exposure(images)
    return np.concatenate([to_8bit(image, factor) for image in images], axis=1)
