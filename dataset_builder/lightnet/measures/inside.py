"""Shared by losses and metrics: both see only the object, in float32 or better, and average over its pixels."""

import torch


def whole_precision(values: torch.Tensor) -> torch.Tensor:
    """The same numbers in float32, or in float64 where they are that already."""
    return values.to(torch.promote_types(values.dtype, torch.float32))


def inside_only(values: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """(B, C, H, W) values where (B, 1, H, W) `inside` is not 0, and 0 elsewhere, in float32 or better.

    Whatever stands outside, a NaN included, reaches neither the result nor a gradient.
    """
    return torch.where(inside > 0, whole_precision(values), 0)


def mean_inside(values: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Mean of (B, C, H, W) values over the pixels inside and the channels; all examples together, a pixel is a pixel.

    0, with a gradient of 0, where there is no pixel inside.
    """
    kept = inside_only(values, inside)
    return kept.sum() / ((inside > 0).sum() * values.shape[-3]).clamp_min(1)
