"""Where tensors live, and in what precision networks run there."""

from contextlib import AbstractContextManager, nullcontext
from typing import Literal

import torch

from dataset_builder.errors import UserError

Precision = Literal["float32", "bfloat16"]


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
