"""Structural similarity (Wang et al. 2004), computed so that float32 keeps its digits."""

import math

import torch

SIGMA = 1.5
"""Standard deviation of the window in pixels."""
RADIUS = 5
"""The window is 11 x 11."""
C1, C2 = 0.01 ** 2, 0.03 ** 2
"""Constants of the paper for values whose range is 1."""


def ssim_map(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """(..., H, W) structural similarity in [-1, 1] at every pixel of two (..., H, W) images, each channel for itself.

    Gaussian window of 11 x 11 with sigma 1.5, population covariance, range 1. Beyond the border the image is its own
    mirror image (edge pixels twice): the same map as scikit-image's with `gaussian_weights=True,
    use_sample_covariance=False, data_range=1`, border included. Pictures may be smaller than the window.

    Each channel's mean is taken off before anything is squared: E[x²] - E[x]² of values near 1 would cancel.
    """
    (mean_x, off_x), (mean_y, off_y) = _centred(x), _centred(y)
    off = torch.stack([off_x, off_y, off_x * off_x + off_y * off_y, off_x * off_y])
    local_x, local_y, squares, product = _smooth(_smooth(off, dim=-2), dim=-1).unbind()
    # Rounding must not make them negative: C2 alone keeps the division safe
    variances = (squares - (local_x * local_x + local_y * local_y)).clamp_min(0)
    covariance = product - local_x * local_y
    mu_x, mu_y = mean_x + local_x, mean_y + local_y
    luminance = (2 * mu_x * mu_y + C1) / (mu_x * mu_x + mu_y * mu_y + C1)
    # Rounding can leave the range by an ulp, and by far where values are huge
    return (luminance * (2 * covariance + C2) / (variances + C2)).clamp(-1, 1)


def _centred(image: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean of each channel, and what is left without it. SSIM does not depend on it: it needs no gradient."""
    mean = image.detach().mean(dim=(-2, -1), keepdim=True)
    return mean, image - mean


def _smooth(values: torch.Tensor, *, dim: int) -> torch.Tensor:
    """Gaussian average along one dimension.

    Written as sums, because CUDA's convolutions may round their inputs to ten bits (TF32) unless told otherwise.
    """
    size = values.shape[dim]
    mirrored = values.index_select(dim, _mirror(size, values.device))
    shifted = [mirrored.narrow(dim, offset, size) for offset in range(2 * RADIUS + 1)]
    weights = [math.exp(-0.5 * (distance / SIGMA) ** 2) for distance in range(RADIUS + 1)]
    total = weights[0] + 2 * sum(weights[1:])
    smooth = shifted[RADIUS] * (weights[0] / total)
    for distance in range(1, RADIUS + 1):
        pair = shifted[RADIUS - distance] + shifted[RADIUS + distance]
        smooth = smooth.add(pair, alpha=weights[distance] / total)
    return smooth


def _mirror(size: int, device: torch.device) -> torch.Tensor:
    """Indices -RADIUS to size + RADIUS - 1 of a row that is mirrored at its ends: 1 0 | 0 1 2 | 2 1."""
    index = torch.arange(-RADIUS, size + RADIUS, device=device) % (2 * size)
    return torch.minimum(index, 2 * size - 1 - index)
