"""Parts of the networks: convolutions that see only the object, encoders, decoders; and layers of the baselines.

An object fills a part of the frame, larger or smaller by chance. So features are 0 outside the object after every
layer, exactly as convolutions pad them, and normalisation takes its moments over the object. The result on an object
then has nothing to do with how much empty frame there is around it, be it a crop, a whole picture or padding.
"""

from itertools import pairwise
from math import gcd

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.ranges import linear_light, tone_map

MAX_GROUPS = 8
"""Channels are normalised in this many groups at most."""
EPSILON = 1e-5
"""Added to variances, so that constants are normalised to 0."""
BRIGHTEST = 0.999
"""Display value that networks with a bounded output can reach; about 440 times the mean light."""


class ObjectNorm(nn.Module):
    """Group normalisation (Wu and He 2018) with moments over the object instead of the frame, then ReLU.

    A batch of one and an object of one pixel are nothing special.
    """

    def __init__(self, channels: int):
        super().__init__()
        self.groups = gcd(channels, MAX_GROUPS)
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))

    def forward(self, x: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
        """(B, C, H, W) float32, >= 0, 0 where (B, 1, H, W) `inside` is 0."""
        x = x.float() * inside
        per_group = len(self.weight) // self.groups
        pixels = inside.sum(dim=(1, 2, 3)).clamp_min(1)[:, None] * per_group
        # Sums by hand, for torch.var_mean takes longer than the convolution on a CPU
        mean = x.sum(dim=(2, 3)).unflatten(1, (self.groups, -1)).sum(dim=-1) / pixels
        squares = torch.linalg.vector_norm(x, dim=(2, 3)).square().unflatten(1, (self.groups, -1)).sum(dim=-1) / pixels
        scale = ((squares - mean.square()).clamp_min(0) + EPSILON).rsqrt()
        scale, mean = (each.repeat_interleave(per_group, dim=1) for each in (scale, mean))
        scale = scale * self.weight
        shift = self.bias - mean * scale
        return torch.addcmul(shift[:, :, None, None] * inside, x, scale[:, :, None, None]).relu_()


class Block(nn.Module):
    """Twice: 3x3 convolution, `ObjectNorm`."""

    def __init__(self, channels_in: int, channels: int):
        super().__init__()
        self.first = nn.Conv2d(channels_in, channels, 3, padding=1, bias=False)
        self.first_norm = ObjectNorm(channels)
        self.second = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.second_norm = ObjectNorm(channels)

    def forward(self, x: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
        """(B, channels, H, W) of (B, channels_in, H, W), 0 outside."""
        x = self.first_norm(self.first(x), inside)
        return self.second_norm(self.second(x), inside)


class Encoder(nn.Module):
    """Blocks, with the mean of 2 x 2 pixels between them: `downs` + 1 levels."""

    def __init__(self, channels_in: int, width: int, downs: int):
        super().__init__()
        widths = (channels_in, *level_widths(width, downs))
        self.blocks = nn.ModuleList([Block(before, after) for before, after in pairwise(widths)])

    def forward(self, x: torch.Tensor, insides: list[torch.Tensor]) -> list[torch.Tensor]:
        """Features of every level, the finest first; `insides` as `inside_levels` makes them."""
        features: list[torch.Tensor] = []
        for block, inside in zip(self.blocks, insides, strict=True):
            features.append(block(functional.avg_pool2d(features[-1], 2) if features else x, inside))
        return features


class Decoder(nn.Module):
    """Back to full resolution: nearest neighbours twice as large, an encoder's features beside them, a block.

    A block after plain enlargement has no checkerboard, which transposed convolutions have (Odena et al. 2016).
    """

    def __init__(self, width: int, downs: int):
        super().__init__()
        widths = level_widths(width, downs)
        self.blocks = nn.ModuleList([Block(coarse + fine, fine) for fine, coarse in pairwise(widths)])

    def forward(self, features: list[torch.Tensor], insides: list[torch.Tensor]) -> torch.Tensor:
        """(B, width, H, W) of an encoder's features, 0 outside."""
        x = features[-1]
        for level in reversed(range(len(self.blocks))):
            x = functional.interpolate(x, scale_factor=2.0, mode="nearest")
            x = self.blocks[level](torch.cat([x, features[level]], dim=1), insides[level])
        return x


def level_widths(width: int, downs: int) -> tuple[int, ...]:
    """Channels of every level: width, 2 width, 4 width, and 8 width from there on."""
    return tuple(width * min(2**level, 8) for level in range(downs + 1))


def inside_levels(inside: torch.Tensor, downs: int) -> list[torch.Tensor]:
    """(B, 1, H / 2^l, W / 2^l) for l up to `downs`: 1 where any of the pixels below is inside."""
    levels = [inside]
    for _ in range(downs):
        levels.append(functional.max_pool2d(levels[-1], 2))
    return levels


def head(width: int, *, bias: float = 0.0) -> nn.Conv2d:
    """1x1 convolution to 3 channels that yields `bias` whatever it is given, until it is trained."""
    last = nn.Conv2d(width, 3, 1)
    nn.init.zeros_(last.weight)
    nn.init.constant_(last.bias, bias)  # type: ignore[arg-type]
    return last


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
