"""How good a picture is: four figures per example, SSIM among them, over the object, on tone-mapped values."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.ranges import inside_only, mean_inside, tone_map
from dataset_builder.lightnet.measures.colour import lab, lab_angle

SIGMA = 1.5
"""Standard deviation of the window in pixels."""
RADIUS = 5
"""The window is 11 x 11."""
C1, C2 = 0.01 ** 2, 0.03 ** 2
"""Constants of the paper for values whose range is 1."""
_BELL = [math.exp(-0.5 * (offset / SIGMA) ** 2) for offset in range(-RADIUS, RADIUS + 1)]
OWN = (sum(weight**2 for weight in _BELL) / sum(_BELL) ** 2) ** 2
"""Share of independent noise's variance that a window's mean keeps."""
BEST_PSNR = 100.0
"""Decibels that PSNR ends at; identical pictures would have infinitely many, and no mean could hold them."""


def ssim_map(x: torch.Tensor, y: torch.Tensor, noise: torch.Tensor | None = None, *,
             shared: bool = False) -> torch.Tensor:
    """(..., H, W) structural similarity in [-1, 1] at every pixel of two (..., H, W) images, each channel for itself.

    Gaussian window of 11 x 11 with sigma 1.5, population covariance, range 1. Beyond the border the image is its own
    mirror image (edge pixels twice): the same map as scikit-image's with `gaussian_weights=True,
    use_sample_covariance=False, data_range=1`, border included. Pictures may be smaller than the window.

    Each channel's mean is taken off before anything is squared: E[x²] - E[x]² of values near 1 would cancel.

    noise: (..., H, W) variance of what `y` has in noise, independent over pixels; its share is taken off local
    variances. shared: where x has the same noise, which is then taken off x alone and off what both have in common.
    """
    (mean_x, off_x), (mean_y, off_y) = _centred(x), _centred(y)
    extra = [] if noise is None else [(1 - OWN) * noise]
    off = torch.stack([off_x, off_y, off_x * off_x + off_y * off_y, off_x * off_y, *extra])
    local_x, local_y, squares, product, *noises = _smooth(_smooth(off, dim=-2), dim=-1).unbind()
    for local in noises:
        squares, product = squares - local, product - local if shared else product
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


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Figures of one example: see `METRICS`."""

    l1: float
    psnr: float
    ssim: float
    lab: float


@dataclass(frozen=True, kw_only=True)
class Metric:
    """What a figure is."""

    name: str
    """Its field in `Metrics`."""
    symbol: str
    """As a table's heading."""
    unit: str
    """"" for none."""
    better: Literal["low", "high"]
    definition: str


METRICS: tuple[Metric, ...] = (
    Metric(name="l1", symbol="L1", unit="", better="low",
           definition="mean absolute difference over the pixels inside and R, G, B"),
    Metric(name="psnr", symbol="PSNR", unit="dB", better="high",
           definition="10 log10(1 / mean squared difference over the pixels inside and R, G, B), at most 100"),
    Metric(name="ssim", symbol="SSIM", unit="", better="high",
           definition="mean over the pixels inside and R, G, B of SSIM with a Gaussian window of 11 x 11, sigma 1.5, "
                      "population covariance, range 1; the picture is 0 outside and mirrored at its border"),
    Metric(name="lab", symbol="Lab angle", unit="rad", better="low",
           definition="mean over the pixels inside of the angle between the CIELAB vectors (D65, L 0 to 100); pi / 2 "
                      "where one of the two is black (norm at most 1), 0 where both are"),
)
"""In the order of the paper's tables. All on tone-mapped values (`lightnet.data.ranges`) clipped to [0, 1]."""


def measure(predicted_i_t: torch.Tensor, truth_i_t: torch.Tensor, inside: torch.Tensor) -> list[Metrics]:
    """Figures of every example of (B, 3, H, W) exposed linear light over (B, 1, H, W) inside (0 or 1).

    Raises UserError where an example has no pixel inside: there is nothing to measure. A prediction that is not finite
    has figures that are not finite.
    """
    return [_measure_one(predicted_i_t[index], truth_i_t[index], inside[index], index)
            for index in range(len(predicted_i_t))]


@torch.no_grad()
def _measure_one(predicted: torch.Tensor, truth: torch.Tensor, inside: torch.Tensor, index: int) -> Metrics:
    if not bool((inside > 0).any()):
        raise UserError(f"expected an object to measure on, got no pixel inside in example {index} of the batch")
    box = box_about(inside)
    inside = inside[box]
    found, wanted = (tone_map(inside_only(image[box], inside)).clamp(0, 1) for image in (predicted, truth))
    difference = found - wanted
    squared = mean_inside(difference.square(), inside)
    return Metrics(
        l1=float(mean_inside(difference.abs(), inside)),
        psnr=psnr_of(squared),
        ssim=float(mean_inside(ssim_map(found, wanted), inside)),
        lab=float(mean_inside(lab_angle(lab(found), lab(wanted), inside), inside)))


def psnr_of(squared: torch.Tensor) -> float:
    """PSNR in decibels of a mean squared difference, at most `BEST_PSNR`."""
    return float(-10 * squared.clamp_min(10 ** (-BEST_PSNR / 10)).log10())


def box_about(inside: torch.Tensor) -> tuple[slice, slice, slice]:
    """The part of a picture, about (1, H, W) `inside`, that figures depend on: the object, and as much around it as a
    window of SSIM reaches."""
    rows, columns = ((inside > 0).any(dim=0).any(dim=dim).nonzero() for dim in (1, 0))
    high, wide = (slice(max(int(found[0]) - RADIUS, 0), int(found[-1]) + RADIUS + 1) for found in (rows, columns))
    return slice(None), high, wide


def mean_metrics(measured: Sequence[Metrics]) -> Metrics:
    """Mean of every figure over some examples, each example alike; PSNR is averaged in decibels."""
    return Metrics(**{metric.name: sum(getattr(one, metric.name) for one in measured) / len(measured)
                      for metric in METRICS})
