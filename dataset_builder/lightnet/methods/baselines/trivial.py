"""Untrained baselines: the source picture as it is, and the formula with the true materials."""

from collections.abc import Callable

import torch

from dataset_builder.lightnet.data.batch import Batch


def copy_i_s(batch: Batch) -> torch.Tensor:
    """I_s, under whose even light of radiance 1 all shading is about 1, the mean of exposed S'."""
    return batch.inputs.i_s * batch.inputs.inside


def d_s_prime(batch: Batch) -> torch.Tensor:
    """D S' with the true D."""
    return batch.truth.d * batch.inputs.s_prime * batch.inputs.inside


def dr_s_prime(batch: Batch) -> torch.Tensor:
    """(D + R) S' with the true D and R."""
    return (batch.truth.d + batch.truth.r) * batch.inputs.s_prime * batch.inputs.inside


TRIVIAL: dict[str, Callable[[Batch], torch.Tensor]] = {
    "copy_i_s": copy_i_s, "d_s_prime": d_s_prime, "dr_s_prime": dr_s_prime,
}
"""Name -> (B, 3, H, W) exposed linear I_t of a batch."""
