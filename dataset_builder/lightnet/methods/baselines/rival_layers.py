"""Layers that the baselines share: normalisation that works for a single value, and pictures as their networks see
them."""

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.ranges import linear_light, tone_map

BRIGHTEST = 0.999
"""Display value that networks with a bounded output can reach; about 440 times the mean light."""


class BatchNorm(nn.BatchNorm2d):
    """Batch normalisation that takes one value per channel (a batch of one at 1 x 1), which PyTorch's refuses to train
    on: a single value has no spread, and is normalised by the moments seen before."""

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """(B, C, H, W) of the same."""
        if self.training and input.numel() == input.shape[1]:
            return functional.batch_norm(input, self.running_mean, self.running_var, self.weight, self.bias,
                                         eps=self.eps)
        return super().forward(input)


class InstanceNorm(nn.InstanceNorm2d):
    """Instance normalisation without weights that takes a single pixel, of which nothing is left: it says 0."""

    def forward(self, input: torch.Tensor) -> torch.Tensor:
        """(B, C, H, W) of the same."""
        return input - input if input.shape[-2:] == (1, 1) else super().forward(input)


def signed(image: torch.Tensor) -> torch.Tensor:
    """Exposed linear light as display values in [-1, 1); black is -1."""
    return 2 * tone_map(image) - 1


def light_of(share: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Exposed linear light of what a network says in [0, 1], 0 outside; no value of `share` is cut, so that gradients
    go on everywhere."""
    return linear_light(BRIGHTEST * share, BRIGHTEST) * inside
