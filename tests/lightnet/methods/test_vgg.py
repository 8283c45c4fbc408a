"""The trunk is VGG-19's, and no file but the right one gets in."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from dataset_builder.digest import sha256_file
from dataset_builder.errors import UserError
from dataset_builder.lightnet.methods import vgg
from dataset_builder.lightnet.methods.vgg import VggTrunk, load_trunk
from dataset_builder.lightnet.settings import VggLayer
from tests.lightnet.vgg_weights import random_weights, write_weights

LAYERS: dict[VggLayer, int] = {"relu3_1": 12, "relu3_4": 18, "pool3": 19}


@pytest.fixture(scope="module")
def weights() -> dict[str, torch.Tensor]:
    return random_weights()


def by_the_book(weights: dict[str, torch.Tensor], length: int) -> nn.Sequential:
    """Configuration E without batch normalisation, as torchvision numbers it."""
    parts: list[nn.Module] = []
    channels = 3
    for width in (64, 64, "M", 128, 128, "M", 256, 256, 256, 256, "M"):
        if isinstance(width, str):
            parts.append(nn.MaxPool2d(2, 2))
        else:
            parts += [nn.Conv2d(channels, width, 3, padding=1), nn.ReLU()]
            channels = width
    nn.ModuleDict({"features": nn.Sequential(*parts)}).load_state_dict(weights)
    return nn.Sequential(*parts[:length])


@pytest.mark.parametrize(("layer", "length"), LAYERS.items())
def test_features_are_those_of_vgg_19(layer: VggLayer, length: int, weights: dict[str, torch.Tensor]) -> None:
    image = torch.rand(2, 3, 24, 32, generator=torch.Generator().manual_seed(1))
    mean, deviation = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    wanted = by_the_book(weights, length)((image - mean[:, None, None]) / deviation[:, None, None])
    found = VggTrunk(layer, weights)(image)
    assert found.shape == ((2, 256, 3, 4) if layer == "pool3" else (2, 256, 6, 8))
    assert (found - wanted).abs().max() < 1e-5 and found.max() > 0.1


def test_the_trunk_is_frozen_and_not_saved(weights: dict[str, torch.Tensor]) -> None:
    trunk = VggTrunk("relu3_4", weights)
    assert not list(trunk.parameters()) and not trunk.state_dict()
    assert sum(buffer.numel() for buffer in trunk.buffers()) == 2_325_568
    assert not any(buffer.requires_grad for buffer in trunk.buffers())
    image = torch.rand(1, 3, 16, 16, requires_grad=True)
    trunk(image).sum().backward()
    assert image.grad.any()


@pytest.mark.parametrize("old_format", [False, True])
@pytest.mark.parametrize("layer", LAYERS)
def test_a_file_is_read(layer: VggLayer, old_format: bool, tmp_path: Path, weights: dict[str, torch.Tensor]) -> None:
    """torchvision's file has the format of PyTorch before 1.6, and the whole network in it."""
    path = tmp_path / "vgg.pth"
    whole = {**weights, "features.19.weight": torch.ones(2), "classifier.0.bias": torch.ones(3)}
    torch.save(whole, path, _use_new_zipfile_serialization=not old_format)
    trunk = load_trunk(path, layer, expected_sha256=sha256_file(path))
    image = torch.rand(1, 3, 16, 16)
    assert torch.equal(trunk(image), VggTrunk(layer, weights)(image))


def test_a_layer_needs_no_weights_behind_it(tmp_path: Path, weights: dict[str, torch.Tensor]) -> None:
    first = {name: tensor for name, tensor in weights.items() if int(name.split(".")[1]) <= 10}
    digest = write_weights(tmp_path / "cut.pth", first)
    assert load_trunk(tmp_path / "cut.pth", "relu3_1", expected_sha256=digest)
    with pytest.raises(UserError) as caught:
        load_trunk(tmp_path / "cut.pth", "relu3_4", expected_sha256=digest)
    assert [problem.path for problem in caught.value.problems] == [
        f"features.{place}.{kind}" for place in (12, 14, 16) for kind in ("weight", "bias")]


def test_the_known_file_is_told_by_size_then_digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / vgg.FILE
    write_weights(path)
    with pytest.raises(UserError, match=r"expected 574673361 bytes, got \d+ .*vgg19-dcbb9e9d.pth"):
        load_trunk(path, "relu3_4")
    monkeypatch.setattr(vgg, "BYTES", path.stat().st_size)
    with pytest.raises(UserError, match=f"expected SHA-256 {vgg.SHA256}, got"):
        load_trunk(path, "relu3_4")
    assert vgg.SHA256.startswith(vgg.FILE.removeprefix("vgg19-").removesuffix(".pth")) and len(vgg.SHA256) == 64


@pytest.mark.parametrize(("change", "rule"), [
    (lambda weights: {}, "features.0.weight: expected a tensor of shape (64, 3, 3, 3), found none"),
    (lambda weights: {**weights, "features.5.weight": torch.ones(128, 64, 1, 1)},
     "features.5.weight: expected shape (128, 64, 3, 3), got (128, 64, 1, 1)"),
    (lambda weights: {**weights, "features.7.bias": torch.full((128,), torch.nan)},
     "features.7.bias: expected finite numbers"),
    (lambda weights: {**weights, "features.7.bias": torch.ones(128, dtype=torch.int64)},
     "features.7.bias: expected finite numbers"),
    (lambda weights: {**weights, "features.2.bias": [0.0] * 64}, "features.2.bias: expected a tensor of shape (64,)"),
    (lambda weights: list(weights.values()), "expected a dictionary of weights by name, got list"),
    (lambda weights: pickle.PickleBuffer, "expected weights that PyTorch can load"),
])
def test_wrong_contents_are_refused(change: Callable[[dict[str, torch.Tensor]], Any], rule: str, tmp_path: Path,
                                    weights: dict[str, torch.Tensor]) -> None:
    """A class in the file would have to be imported to be loaded: that is refused, not done."""
    digest = write_weights(tmp_path / "other.pth", change(weights))
    with pytest.raises(UserError) as caught:
        load_trunk(tmp_path / "other.pth", "relu3_4", expected_sha256=digest)
    assert rule in str(caught.value) and str(tmp_path / "other.pth") in str(caught.value)
    assert "--vgg-weights" in str(caught.value)


@pytest.mark.parametrize("data", [b"", b"no weights", b"PK\x03\x04 cut", b"\x80\x02}q\x00."])
def test_other_files_are_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.pth"
    path.write_bytes(data)
    with pytest.raises(UserError, match=r"other\.pth: expected"):
        load_trunk(path, "relu3_4", expected_sha256=sha256_file(path))


def test_no_file_no_trunk(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "missing.pth"):
        with pytest.raises(UserError, match="expected a file, found none"):
            load_trunk(path, "relu3_4")
