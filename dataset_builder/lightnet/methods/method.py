"""What every trainable method offers, how it is used at any size, device and precision; and what needs no training."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields, replace
from typing import Literal

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction

Precision = Literal["float32", "bfloat16"]
IMAGES = ("i_s", "s_prime", "inside")
"""Inputs that have a height and a width."""


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
    """Height and width of inputs must be multiples of this; `predict` pads."""
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


def choose(device: str = "auto") -> torch.device:
    """The device that `auto`, `cpu` or `cuda` means here. Raises UserError where there is no such device."""
    if device not in ("auto", "cpu", "cuda"):
        raise UserError(f"--device: expected auto, cpu or cuda, got {device}")
    if device == "cuda" and not torch.cuda.is_available():
        raise UserError("--device: expected cpu, since PyTorch finds no CUDA here, got cuda (CUDA needs a CUDA build "
                        "of the pinned version and an NVIDIA driver)")
    return torch.device("cuda" if device != "cpu" and torch.cuda.is_available() else "cpu")


def precision_on(device: torch.device, asked: str) -> Precision:
    """What `precision` of a training means on a device: auto is bfloat16 on CUDA and float32 elsewhere."""
    if asked == "auto":
        return "bfloat16" if device.type == "cuda" else "float32"
    return "bfloat16" if asked == "bfloat16" else "float32"


def autocast(device: torch.device, precision: Precision) -> AbstractContextManager[object]:
    """Run what is inside in that precision; bfloat16 has float32's range, so that no scaling of losses is needed."""
    if precision == "float32":
        return nullcontext()
    return torch.autocast(device.type, dtype=torch.bfloat16)


def predict(method: Method, inputs: Inputs, precision: Precision = "float32") -> Prediction:
    """What a method says of inputs on its device, of any height and width; the method is left in the mode it was in.

    Sizes that the method cannot take are filled up with nothing at the right and the bottom, and cut again.
    bfloat16 is for CUDA.
    """
    height, width = inputs.i_s.shape[-2:]
    was_training = method.training
    method.eval()
    try:
        with torch.inference_mode(), autocast(inputs.i_s.device, precision):
            prediction = method(padded(inputs, method.multiple))
    finally:
        method.train(was_training)
    return cropped(prediction, height, width)


def padded(inputs: Inputs, multiple: int) -> Inputs:
    """The same with zeros at the right and the bottom, up to the next multiples of `multiple`."""
    height, width = inputs.i_s.shape[-2:]
    margins = (0, -width % multiple, 0, -height % multiple)
    if not any(margins):
        return inputs
    return replace(inputs, **{name: functional.pad(getattr(inputs, name), margins) for name in IMAGES})


def cropped(prediction: Prediction, height: int, width: int) -> Prediction:
    """The upper left part of every image of a prediction."""
    found = {field.name: getattr(prediction, field.name) for field in fields(Prediction)}
    return replace(prediction, **{name: image[..., :height, :width] for name, image in found.items()
                                  if image is not None})


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
