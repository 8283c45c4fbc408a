"""SSVBRDF, shape and reflectance from a single picture (Li et al. 2018), reformulated as the paper says: I_s and the
mask in; albedo and normals are found, and lit by the target light that the renderer finds at the object, as spherical
harmonics. S' is not seen.

The encoder and the decoders are those of the public code's first cascade, with its channels at width 32 and 6 downs.
I_t is albedo times the irradiance of the light over pi (Ramamoorthi and Hanrahan 2001), at least 0, with normals in the
camera's frame. Losses are masked squared errors of I_t (tone-mapped) and of the albedo against D, as there weighted 1.
Normals have no truth of their own here and learn from I_t; they start out facing the viewer.

Left out: the decoders of roughness and depth and the head of the environment, which that picture does not depend on;
further bounces and cascades. A light that is one for the whole object knows of no cast shadow.
"""

from itertools import pairwise

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.geometry.harmonics import COSINE, basis
from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction
from dataset_builder.lightnet.data.ranges import inside_only, mean_inside, tone_map
from dataset_builder.lightnet.methods.blocks import BatchNorm
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import ModelSpec

MIN_LENGTH = 1e-3
"""Of a normal, before it is made one long: shorter ones have no direction."""


class Ssvbrdf(Method):
    """An encoder, a decoder for albedo and one for normals."""

    def __init__(self, spec: ModelSpec):
        super().__init__()
        self.multiple = 2**spec.downs
        self.encoder = SvbrdfEncoder(4, spec.width, spec.downs)
        self.albedo, self.normal = SvbrdfDecoder(spec.width, spec.downs), SvbrdfDecoder(spec.width, spec.downs)
        self.normal.face_viewer()

    def forward(self, inputs: Inputs) -> Prediction:
        """I_t, D and the shading of which I_t is the product."""
        seen = torch.cat([(2 * tone_map(inputs.i_s) - 1) * inputs.inside, inputs.inside], dim=1)
        features = self.encoder(seen)
        d = (self.albedo(features).float() + 1) / 2 * inputs.inside
        normal = functional.normalize(self.normal(features).float(), dim=1, eps=MIN_LENGTH)
        shading = lit(normal, inputs.sh) * inputs.inside
        return Prediction(i_t=d * shading, d=d, shading=shading)

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        """Squared errors over the object."""
        inside = batch.inputs.inside
        pairs = {"render": (tone_map(prediction.i_t), tone_map(batch.truth.i_t)),
                 "albedo": (prediction.d, batch.truth.d)}
        terms = {name: mean_inside((inside_only(found, inside) - inside_only(wanted, inside)).square(), inside)
                 for name, (found, wanted) in pairs.items() if found is not None}
        return Loss(total=torch.stack(list(terms.values())).sum(),
                    terms={name: term.detach() for name, term in terms.items()})


class SvbrdfEncoder(nn.Module):
    """Convolutions that halve, the first 6x6 and the others 4x4, to 16 `width` channels at 1/2^6."""

    def __init__(self, channels_in: int, width: int, downs: int):
        super().__init__()
        self.layers = nn.ModuleList([
            _conv_norm_relu(nn.Conv2d(before, after, *((6, 2, 2) if level == 0 else (4, 2, 1)), bias=False), after)
            for level, (before, after) in enumerate(pairwise([channels_in, *encoder_widths(width, downs)]))])

    def forward(self, x: torch.Tensor) -> list[torch.Tensor]:
        """Features of every level, the finest first."""
        features: list[torch.Tensor] = []
        for layer in self.layers:
            features.append(layer(features[-1] if features else x))
        return features


class SvbrdfDecoder(nn.Module):
    """Transposed convolutions that double, each but the last beside the encoder's features; 3 channels in [-1, 1]."""

    def __init__(self, width: int, downs: int):
        super().__init__()
        *skips, inner = encoder_widths(width, downs)
        befores, afters = [inner, *(2 * skip for skip in reversed(skips))], [*reversed(skips), 2 * width]
        self.layers = nn.ModuleList([
            _conv_norm_relu(nn.ConvTranspose2d(before, after, 4, 2, 1, bias=False), after)
            for before, after in zip(befores, afters, strict=True)])
        self.last = nn.Conv2d(2 * width, 3, 5, padding=2)

    def forward(self, features: list[torch.Tensor]) -> torch.Tensor:
        """(B, 3, H, W) of an encoder's features."""
        *skips, x = features
        for layer in self.layers:
            x = layer(x)
            if skips:
                x = torch.cat([x, skips.pop()], dim=1)
        return torch.tanh(self.last(x))

    def face_viewer(self) -> None:
        """Let the three channels be about the view axis to begin with."""
        with torch.no_grad():
            self.last.bias.copy_(torch.tensor([0.0, 0.0, 1.0]))  # type: ignore[union-attr]


def encoder_widths(width: int, downs: int) -> list[int]:
    """Channels of every level: 1, 2, 4, 8, 8, ... times `width`, and twice the last but one at the last."""
    widths = [width * min(2**level, 8) for level in range(downs)]
    return [*widths[:-1], 2 * widths[-2]] if downs > 1 else widths


def lit(normal: torch.Tensor, sh: torch.Tensor) -> torch.Tensor:
    """(B, 3, H, W) what a white Lambertian surface sends back: irradiance / pi >= 0, of (B, 3, 9) radiance `sh` and
    (B, 3, H, W) unit normals in its frame."""
    functions = torch.stack(basis(*normal.unbind(dim=1)), dim=1)
    damped = sh * sh.new_tensor(COSINE / COSINE[0])
    # A matrix product to PyTorch, which would round it to bfloat16 with the network's
    with torch.autocast(normal.device.type, enabled=False):
        return torch.einsum("bck,bkhw->bchw", damped, functions).clamp_min(0)


def _conv_norm_relu(conv: nn.Module, channels: int) -> nn.Sequential:
    return nn.Sequential(conv, BatchNorm(channels), nn.ReLU())
