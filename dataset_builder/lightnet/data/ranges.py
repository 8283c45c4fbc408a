"""From scene-referred light to the range of networks: one exposure per example, one tone mapping for all.

Exposure. S' and the mask are known wherever LighTNet is used, I_t is not. So the target exposure brings the mean
luminance of S' over the object to 1, and multiplies S', I_t and everything else under the target light. The source
light is the same through a dataset, so that one factor serves all of its I_s; a factor by example would hide how bright
a material is. D and R are reflectances and stay.

Tone mapping. x / (1 + x), then the sRGB curve (IEC 61966-2-1): smooth, [0, inf) to [0, 1), never clipped, with a slope
of 12.92 at 0 that continues below 0. Inputs, losses and metrics see tone-mapped values; composition is linear.
Losses and metrics see only the object, in float32 or better, and average over its pixels.
"""

import torch

from dataset_builder.tonemap import LUMINANCE

DARKEST = 1e-6
"""Least mean luminance that is exposed for; darker examples stay dark."""
KNEE, SLOPE, GAMMA, OFFSET = 0.0031308, 12.92, 2.4, 0.055


def luminance(image: torch.Tensor) -> torch.Tensor:
    """(..., 1, H, W) Rec.709 luminance of (..., 3, H, W) linear light."""
    return (image * image.new_tensor(LUMINANCE)[:, None, None]).sum(dim=-3, keepdim=True)


def target_exposure(s_prime: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """(...) factor that brings the mean luminance of (..., 3, H, W) `s_prime` over (..., 1, H, W) `inside` to 1."""
    weight = inside.sum(dim=(-3, -2, -1)).clamp_min(1)
    mean = (luminance(s_prime) * inside).sum(dim=(-3, -2, -1)) / weight
    return 1 / mean.clamp_min(DARKEST)


def tone_map(linear: torch.Tensor) -> torch.Tensor:
    """Display values in [0, 1) of exposed linear light >= 0; below 0 they go on straight, with slope 12.92."""
    positive = linear.clamp_min(0)
    compressed = positive / (1 + positive)
    # The power's own branch never sees the values near 0, whose gradients would be infinite
    curved = (1 + OFFSET) * compressed.clamp_min(KNEE) ** (1 / GAMMA) - OFFSET
    mapped = torch.where(compressed <= KNEE, SLOPE * compressed, curved)
    return torch.where(linear < 0, SLOPE * linear, mapped)


def linear_light(display: torch.Tensor, brightest: float = 0.999) -> torch.Tensor:
    """Exposed linear light of display values: the inverse of `tone_map`, display values above `brightest` cut."""
    value = display.clamp(0, brightest)
    curved = ((value.clamp_min(SLOPE * KNEE) + OFFSET) / (1 + OFFSET)) ** GAMMA
    compressed = torch.where(value <= SLOPE * KNEE, value / SLOPE, curved)
    return torch.where(display < 0, display / SLOPE, compressed / (1 - compressed))


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
