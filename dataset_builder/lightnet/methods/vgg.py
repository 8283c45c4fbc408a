"""Features of VGG-19 up to its third block, from the weights file that torchvision publishes; never trained here."""

import pickle
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem, UserError
from dataset_builder.lightnet.settings import VggLayer

FILE = "vgg19-dcbb9e9d.pth"
"""torchvision's name of VGG-19 without batch normalisation, trained on ImageNet (IMAGENET1K_V1)."""
SHA256 = "dcbb9e9dad569fff7a846263a77324fc34978fea2bfb039c012d710e1776ae44"
BYTES = 574_673_361
"""Digest and size of that file."""
CONVOLUTIONS = {0: (3, 64), 2: (64, 64), 5: (64, 128), 7: (128, 128),
                10: (128, 256), 12: (256, 256), 14: (256, 256), 16: (256, 256)}
"""Channels in and out of the 3x3 convolutions, by their place in torchvision's `features`; a ReLU follows each."""
POOLS = (4, 9, 18)
"""Places of the 2x2 maxima."""
LENGTHS: dict[VggLayer, int] = {"relu3_1": 12, "relu3_4": 18, "pool3": 19}
"""How many places are run through for a layer's features."""
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of the RGB values in [0, 1] that the weights were trained on."""


class VggTrunk(nn.Module):
    """(B, 3, H, W) RGB in [0, 1] to features: (B, 256, H/4, W/4), or (B, 256, H/8, W/8) for pool3; H, W >= 8.

    Weights are buffers that are not saved with a state: whatever holds a trunk has no parameters from it to train, and
    its checkpoints can be loaded without the weights file.
    """

    def __init__(self, layer: VggLayer, weights: dict[str, torch.Tensor]):
        super().__init__()
        self.length = LENGTHS[layer]
        for name in _needed(layer):
            self.register_buffer(name.replace(".", "_"), weights[name].detach().float().clone(), persistent=False)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        """Activations of the layer. Values outside [0, 1] go through as they are."""
        mean, deviation = (image.new_tensor(numbers)[:, None, None] for numbers in (MEAN, DEVIATION))
        values = (image - mean) / deviation
        for place in range(self.length):
            if place in CONVOLUTIONS:
                weight, bias = (self.get_buffer(f"features_{place}_{kind}") for kind in ("weight", "bias"))
                values = functional.relu(functional.conv2d(values, weight, bias, padding=1))
            elif place in POOLS:
                values = functional.max_pool2d(values, kernel_size=2)
        return values


def load_trunk(path: Path, layer: VggLayer, *, expected_sha256: str = SHA256) -> VggTrunk:
    """The trunk with the weights of a file: torchvision's, or one whose digest is given.

    Raises UserError where there is no such file, where its size or digest is another's, or where it does not hold all
    weights that are needed, finite and of the right shapes. Nothing in the file is executed (`weights_only`).
    """
    check_file(path, expected_sha256)
    weights = _read(path)
    if problems := [problem for name, shape in _needed(layer).items()
                    for problem in _problems(path, name, shape, weights.get(name))]:
        raise UserError(problems)
    return VggTrunk(layer, weights)


def check_file(path: Path, expected_sha256: str = SHA256) -> None:
    """Raise UserError where a file is not torchvision's, or the one whose digest is given."""
    # A cut download is told at once, not after its half gigabyte was hashed
    if expected_sha256 == SHA256 and path.is_file() and (size := path.stat().st_size) != BYTES:
        raise _wrong(path, f"expected {BYTES} bytes, got {size}")
    if (found := file_digest(path)) != expected_sha256:
        raise _wrong(path, f"expected SHA-256 {expected_sha256}, got {found}")


def file_digest(path: Path) -> str:
    """SHA-256 of a weights file. Raises UserError where there is none, or none that can be read."""
    if not path.is_file():
        raise _wrong(path, "expected a file, found none")
    try:
        return sha256_file(path)
    except OSError as error:
        raise _wrong(path, f"expected a file that can be read, got: {error.strerror}") from error


def _needed(layer: VggLayer) -> dict[str, tuple[int, ...]]:
    """Shape of every tensor that a layer needs, by torchvision's name."""
    shapes: dict[str, tuple[int, ...]] = {}
    for place, (channels_in, channels_out) in CONVOLUTIONS.items():
        if place < LENGTHS[layer]:
            shapes[f"features.{place}.weight"] = (channels_out, channels_in, 3, 3)
            shapes[f"features.{place}.bias"] = (channels_out,)
    return shapes




def _read(path: Path) -> dict[str, torch.Tensor]:
    """The file's dictionary. PyTorch tells broken files by a handful of exception types."""
    try:
        weights = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, OSError, ValueError, KeyError, TypeError,
            AttributeError) as error:
        said = (str(error).splitlines() or [type(error).__name__])[0]
        raise _wrong(path, f"expected weights that PyTorch can load, got: {said}") from error
    if not isinstance(weights, dict):
        raise _wrong(path, f"expected a dictionary of weights by name, got {type(weights).__name__}")
    return weights


def _problems(path: Path, name: str, shape: tuple[int, ...], tensor: object) -> list[Problem]:
    """What is wrong with one tensor: nothing, or one problem."""
    if not isinstance(tensor, torch.Tensor):
        return [_problem(path, f"expected a tensor of shape {shape}, found none", at=name)]
    if tuple(tensor.shape) != shape:
        return [_problem(path, f"expected shape {shape}, got {tuple(tensor.shape)}", at=name)]
    if not tensor.is_floating_point() or not bool(torch.isfinite(tensor).all()):
        return [_problem(path, "expected finite numbers", at=name)]
    return []


def _wrong(path: Path, rule: str) -> UserError:
    return UserError([_problem(path, rule)])


def _problem(path: Path, rule: str, *, at: str = "") -> Problem:
    return Problem(where=str(path), path=at, rule=rule,
                   hint=f"--vgg-weights takes torchvision's {FILE}, VGG-19 without batch normalisation")
