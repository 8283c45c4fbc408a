"""How good a picture is: four figures per example, over the object, on tone-mapped values."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.ranges import tone_map
from dataset_builder.lightnet.measures.colour import lab, lab_angle
from dataset_builder.lightnet.measures.inside import inside_only, mean_inside
from dataset_builder.lightnet.measures.ssim import RADIUS, ssim_map

BEST_PSNR = 100.0
"""Decibels that PSNR ends at; identical pictures would have infinitely many, and no mean could hold them."""


@dataclass(frozen=True, kw_only=True)
class Metrics:
    """Figures of one example: see `METRICS`."""

    l1: float
    psnr: float
    ssim: float
    lab: float


@dataclass(frozen=True, kw_only=True)
class Metric:
    """What a figure is. name: its field in `Metrics`; symbol: as a table's heading; unit: "" for none."""

    name: str
    symbol: str
    unit: str
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
    box = _box(inside)
    inside = inside[box]
    found, wanted = (tone_map(inside_only(image[box], inside)).clamp(0, 1) for image in (predicted, truth))
    difference = found - wanted
    squared = mean_inside(difference.square(), inside)
    return Metrics(
        l1=float(mean_inside(difference.abs(), inside)),
        psnr=float(-10 * squared.clamp_min(10 ** (-BEST_PSNR / 10)).log10()),
        ssim=float(mean_inside(ssim_map(found, wanted), inside)),
        lab=float(mean_inside(lab_angle(lab(found), lab(wanted), inside), inside)))


def _box(inside: torch.Tensor) -> tuple[slice, slice, slice]:
    """The part of a picture that figures depend on: the object, and as much around it as a window of SSIM reaches."""
    rows, columns = ((inside > 0).any(dim=0).any(dim=dim).nonzero() for dim in (1, 0))
    high, wide = (slice(max(int(found[0]) - RADIUS, 0), int(found[-1]) + RADIUS + 1) for found in (rows, columns))
    return slice(None), high, wide


def mean_metrics(measured: Sequence[Metrics]) -> Metrics:
    """Mean of every figure over some examples, each example alike; PSNR is averaged in decibels."""
    return Metrics(**{metric.name: sum(getattr(one, metric.name) for one in measured) / len(measured)
                      for metric in METRICS})
