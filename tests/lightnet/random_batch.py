"""Batches of made-up numbers that keep the identities of real ones, for tests of networks."""

from dataclasses import replace

import torch

from dataset_builder.lightnet.data.batch import Batch, Inputs, Truth


def random_batch(*, size: int = 32, examples: int = 2, seed: int = 0) -> Batch:
    """A disc of random materials: I_s = D + R, I_t = (D + R) S, S' is S times noise, and even light about it."""
    draws = torch.Generator().manual_seed(seed)
    inside = disc(size).expand(examples, -1, -1, -1)
    d, r, s, noise = (torch.rand((examples, 3, size, size), generator=draws) * inside for _ in range(4))
    d, r, s = 0.6 * d, 0.1 * r, 2 * s
    sh = torch.zeros(examples, 3, 9)
    sh[:, :, 0] = (4 * torch.pi) ** 0.5
    sh[:, :, 1:] = 0.5 * torch.randn((examples, 3, 8), generator=draws)
    inputs = Inputs(i_s=d + r, s_prime=s * (0.7 + 0.6 * noise), inside=inside, sh=sh)
    return Batch(keys=tuple(str(i) for i in range(examples)), exposure=torch.ones(examples), inputs=inputs,
                 truth=Truth(i_t=(d + r) * s, d=d, r=r))


def disc(size: int) -> torch.Tensor:
    """(1, 1, size, size) 1 within 0.4 sizes of the centre, 0 elsewhere."""
    row = torch.arange(size) + 0.5 - size / 2
    return (row[:, None].square() + row.square() < (0.4 * size) ** 2).float()[None, None]


def filled(inputs: Inputs, value: float) -> Inputs:
    """The same object with I_s and S' of one value."""
    return replace(inputs, i_s=value * inputs.inside.expand(-1, 3, -1, -1),
                   s_prime=value * inputs.inside.expand(-1, 3, -1, -1))
