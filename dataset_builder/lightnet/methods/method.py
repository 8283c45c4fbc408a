"""What every trainable method offers the training loop: a prediction, and losses by phase."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import nn

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction


@dataclass(frozen=True, kw_only=True, eq=False)
class Loss:
    """What a phase is to minimise."""

    total: torch.Tensor
    """Scalar."""
    terms: dict[str, torch.Tensor]
    """Detached, unweighted scalars by name, for people."""


class Method(nn.Module, ABC):
    """A way to transfer light from S' to I_s.

    A training step makes one prediction and then, for each phase in turn, takes the loss of that phase and moves the
    phase's parameters; most methods have a single phase, an adversary has one of its own.
    """

    phases: tuple[str, ...] = ("main",)
    multiple: int = 1
    """Height and width of inputs must be multiples of this; `lightnet.methods.predict` pads."""
    off: tuple[str, ...] = ()
    """Losses that were asked for and are off, each with the reason."""

    @abstractmethod
    def forward(self, inputs: Inputs) -> Prediction:
        """The prediction for a batch; float32 whatever the precision inside."""

    @abstractmethod
    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        """The loss of a phase, in float32. A phase must leave the graph of `prediction` intact for those after it."""

    def parameters_of(self, phase: str) -> Iterable[nn.Parameter]:
        """What a phase moves; all parameters where there is one phase."""
        return self.parameters()


def running_statistics(method: nn.Module) -> list[torch.Tensor]:
    """What normalisation keeps of the batches it has seen: buffers that checkpoints hold, themselves, not copies."""
    saved = method.state_dict()
    return [buffer for name, buffer in method.named_buffers() if name in saved]


def count_parameters(method: nn.Module) -> int:
    """Trainable numbers of a module."""
    return sum(parameter.numel() for parameter in method.parameters() if parameter.requires_grad)
