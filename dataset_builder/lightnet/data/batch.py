"""What flows through the trainer: inputs, truth and predictions, as tensors in exposed linear light.

Exposed means: `i_s` is multiplied by the dataset-wide source exposure, `s_prime` and `i_t` by the example's own target
exposure (`lightnet.data.ranges`), so that I_t = D S + spec still holds. Nothing is tone-mapped; whoever needs display
values maps them. Everything is 0 where the object is not (`inside` is 0). H and W are whatever the crop is.
"""

from dataclasses import dataclass, fields, replace
from typing import TypeVar

import torch

Tensors = TypeVar("Tensors", "Inputs", "Truth")


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """What a method may see."""

    i_s: torch.Tensor
    """(B, 3, H, W), linear, >= 0."""
    s_prime: torch.Tensor
    """(B, 3, H, W), linear, >= 0."""
    inside: torch.Tensor
    """(B, 1, H, W), 0 or 1."""
    sh: torch.Tensor
    """(B, 3, 9) spherical harmonics of the radiance that arrives at the object's centre under the target light, exposed
    as `s_prime`, in the camera's frame (x right, y up, z to the viewer); order of `geometry.harmonics`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """What a method is to find."""

    i_t: torch.Tensor
    """(B, 3, H, W), linear, >= 0."""
    d: torch.Tensor
    """(B, 3, H, W), in [0, 1]."""
    r: torch.Tensor
    """(B, 3, H, W), in [0, 1]."""
    i_t_se: torch.Tensor | None = None
    """(B, 3, H, W) standard error of `i_t`, exposed as it is; None where it was not asked for, as for `i_t_half`."""
    i_t_half: torch.Tensor | None = None
    """(B, 3, H, W) mean of half of the samples of `i_t`, exposed as it is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Some examples."""

    keys: tuple[str, ...]
    exposure: torch.Tensor
    """(B,) factor that `s_prime`, `i_t` and `sh` were multiplied by; where an example is varied, its gain comes on
    top."""
    inputs: Inputs
    truth: Truth

    def to(self, device: torch.device) -> "Batch":
        """The same on a device."""
        return replace(self, exposure=self.exposure.to(device), inputs=_moved(self.inputs, device),
                       truth=_moved(self.truth, device))


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What a method found; parts that it has not are None, the others are (B, 3, H, W)."""

    i_t: torch.Tensor
    """(B, 3, H, W), exposed linear light, unbounded, 0 outside the object."""
    d: torch.Tensor | None = None
    r: torch.Tensor | None = None
    shading: torch.Tensor | None = None
    alpha: torch.Tensor | None = None


def _moved(tensors: Tensors, device: torch.device) -> Tensors:
    there = {field.name: getattr(tensors, field.name) for field in fields(tensors)}
    return replace(tensors, **{name: tensor.to(device) for name, tensor in there.items() if tensor is not None})
