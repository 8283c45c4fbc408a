"""How different the rough mesh looks from the clean one, in images of one view."""

from collections.abc import Mapping

import numpy as np

WHOLE = 1 - 1e-6
"""Coverage of a pixel without an edge."""


def overlap(mask: np.ndarray, other: np.ndarray) -> float:
    """Intersection over union of two images of coverage in [0, 1]: sum of the lesser over sum of the larger; 1 where
    both are empty."""
    union = float(np.maximum(mask, other).sum(dtype=np.float64))
    return float(np.minimum(mask, other).sum(dtype=np.float64)) / union if union else 1.0


def relmse(images: Mapping[str, np.ndarray]) -> tuple[float, ...]:
    """Mean of (s_prime - s)^2 less their variances, over that of s^2, on pixels that `mask` and `mask_rough` cover
    whole. Of means and not of pixels: where s is noisy, a pixel that came out dark would count for many.

    images: layers by name, (H, W, C), with standard errors `s_se` and `s_prime_se`. Nothing where S or S' is not among
    them, no pixel is whole in both, S is black, or an error is not known.
    """
    if "s" not in images or "s_prime" not in images:
        return ()
    whole = ((images["mask"] >= WHOLE) & (images["mask_rough"] >= WHOLE))[..., 0]
    s, s_prime, s_se, s_prime_se = (images[name][whole].astype(np.float64)
                                    for name in ("s", "s_prime", "s_se", "s_prime_se"))
    off, scale = float(((s_prime - s) ** 2 - s_se**2 - s_prime_se**2).sum()), float((s**2).sum())
    return (off / scale,) if scale > 0 and np.isfinite(off) else ()
