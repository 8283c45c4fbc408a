"""Random weights of VGG-19 up to its third block, in a file like torchvision's; whoever reads it gives its digest."""

import math
from pathlib import Path

import torch

from dataset_builder.digest import sha256_file

CHANNELS = {0: (3, 64), 2: (64, 64), 5: (64, 128), 7: (128, 128), 10: (128, 256), 12: (256, 256), 14: (256, 256),
            16: (256, 256)}
"""Of the convolutions of configuration E in Simonyan and Zisserman 2014, by their place."""


def random_weights(seed: int = 0) -> dict[str, torch.Tensor]:
    """Weights that keep the size of activations, and biases that are not 0, by torchvision's names."""
    generator, weights = torch.Generator().manual_seed(seed), {}
    for place, (channels_in, channels_out) in CHANNELS.items():
        scale = math.sqrt(2 / (9 * channels_in))
        weights[f"features.{place}.weight"] = scale * torch.randn(channels_out, channels_in, 3, 3, generator=generator)
        weights[f"features.{place}.bias"] = 0.1 * torch.randn(channels_out, generator=generator)
    return weights


def write_weights(path: Path, weights: object = None) -> str:
    """Write weights (default: random ones) as `torch.save` does; SHA-256 of the file."""
    torch.save(random_weights() if weights is None else weights, path)
    return sha256_file(path)
