"""Using a method: any size of picture, no gradients, at the requested precision."""

from dataclasses import fields, replace

import torch
from torch.nn import functional

from dataset_builder.lightnet.data.batch import Inputs, Prediction
from dataset_builder.lightnet.methods.device import Precision, autocast
from dataset_builder.lightnet.methods.method import Method

IMAGES = ("i_s", "s_prime", "inside")
"""Inputs that have a height and a width."""


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
