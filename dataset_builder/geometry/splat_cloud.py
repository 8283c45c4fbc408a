"""Gaussian splats: an object or scene as many small, coloured, half-transparent ellipsoids."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class SplatCloud:
    """N splats as Kerbl and others (2023) mean them, in plain numbers: nothing is a logarithm or a logit."""

    centres: np.ndarray
    """(N, 3) float32, metres."""
    scales: np.ndarray
    """(N, 3) float32 standard deviations along each splat's own axes, metres, above 0."""
    turns: np.ndarray
    """(N, 4) float32 unit quaternions w, x, y, z: frame from splat."""
    opacities: np.ndarray
    """(N,) float32 in the middle of each, in (0, 1]."""
    harmonics: np.ndarray
    """(N, K, 3) float32 spherical harmonics of colour, K = 1, 4, 9 or 16; colour = 0.5 + sum, at least 0."""
    srgb: bool = True
    """Whether that colour is sRGB-encoded, as trainers leave it; else linear Rec.709."""

    def __len__(self) -> int:
        return len(self.centres)
