"""Using a method: where it lives, any size of picture, no gradients, at the requested precision."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, replace
from typing import Literal

import torch
from torch.nn import functional

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Inputs, Prediction
from dataset_builder.lightnet.methods.method import Method

Precision = Literal["float32", "bfloat16"]
IMAGES = ("i_s", "s_prime", "inside")
"""Inputs that have a height and a width."""


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
