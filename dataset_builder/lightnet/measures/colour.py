"""CIELAB, and the angle between two of its colours, with gradients that are right near black and near equality."""

import math

import torch

from dataset_builder.lightnet.data.ranges import whole_precision

XYZ_FROM_RGB = ((0.412453, 0.357580, 0.180423), (0.212671, 0.715160, 0.072169), (0.019334, 0.119193, 0.950227))
"""Linear sRGB to CIE XYZ; numbers as in scikit-image and kornia."""
WHITE = (0.95047, 1.0, 1.08883)
"""XYZ of D65 (2 degrees). The matrix has a white of its own, 7e-5 away: greys have |a|, |b| below 0.005."""
DELTA = 6 / 29
"""CIE 15: the cube root gives way to a line below DELTA cubed."""
DARK = 1.0
"""Norm, in units of Lab, up to which a colour counts as black: L = 1 is 0.0011 of white, 3.6 of 255 on a display."""
SLOPE, GAMMA, OFFSET, KNEE = 12.92, 2.4, 0.055, 0.04045


def lab(display: torch.Tensor) -> torch.Tensor:
    """(..., 3, H, W) CIELAB, L 0 to 100 and a, b about -110 to 110, of sRGB-encoded (..., 3, H, W) values in [0, 1].

    White is D65. Values below 0 and above 1 are converted by the same formulas. Half types are converted in float32.
    The matrix product is written out, so that no setting of CUDA (TF32) makes it coarse.
    """
    red, green, blue = (_linear(channel) for channel in whole_precision(display).unbind(dim=-3))
    x, y, z = (_compressed((kr * red + kg * green + kb * blue) / white)
               for (kr, kg, kb), white in zip(XYZ_FROM_RGB, WHITE, strict=True))
    return torch.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], dim=-3)


def lab_angle(x: torch.Tensor, y: torch.Tensor, inside: torch.Tensor | None = None, *,
              dark: float = DARK) -> torch.Tensor:
    """(..., 1, H, W) angle in radians, 0 to pi, between (..., 3, H, W) colours of Lab: arccos of <x, y> / (|x| |y|).

    An angle needs two directions. Where one of the norms is at most `dark` and the other is not, it counts as pi / 2;
    where both are, and outside the (..., 1, H, W) `inside`, as 0. Such pixels have no gradient: they are replaced
    before they reach the formula, whose gradient there would be huge or NaN. Elsewhere its norm is 1 / |x|.

    Computed as 2 atan2(|u - v|, |u + v|) with u, v of norm 1 (W. Kahan, "How Futile are Mindless Assessments of
    Roundoff in Floating-Point Computation?", 2006, "Mangled Angles"): exactly 0 with gradient 0 where x is y, where
    the gradient of arccos is NaN.
    """
    light_x, light_y = (torch.linalg.vector_norm(colour, dim=-3, keepdim=True) > dark for colour in (x, y))
    here = torch.ones_like(light_x) if inside is None else inside > 0
    u, v = _unit(x, here & light_x & light_y), _unit(y, here & light_x & light_y)
    angle = 2 * torch.atan2(torch.linalg.vector_norm(u - v, dim=-3, keepdim=True),
                            torch.linalg.vector_norm(u + v, dim=-3, keepdim=True))
    return torch.where(here & (light_x ^ light_y), math.pi / 2, angle)


def _unit(colour: torch.Tensor, kept: torch.Tensor) -> torch.Tensor:
    """Colours of norm 1; white's direction where they are not kept, on both sides, so that their angle is 0."""
    white = torch.eye(3, 1, dtype=colour.dtype, device=colour.device)[..., None]
    safe = torch.where(kept, colour, white)
    return safe / torch.linalg.vector_norm(safe, dim=-3, keepdim=True)


# Both curves clamp inside the power: the branch that `where` does not take would give a NaN gradient otherwise

def _linear(display: torch.Tensor) -> torch.Tensor:
    """sRGB (IEC 61966-2-1) undone."""
    curved = ((display.clamp_min(KNEE) + OFFSET) / (1 + OFFSET)) ** GAMMA
    return torch.where(display <= KNEE, display / SLOPE, curved)


def _compressed(ratio: torch.Tensor) -> torch.Tensor:
    """CIE's f of a ratio to white."""
    root = ratio.clamp_min(DELTA ** 3) ** (1 / 3)
    return torch.where(ratio <= DELTA ** 3, ratio / (3 * DELTA ** 2) + 4 / 29, root)
