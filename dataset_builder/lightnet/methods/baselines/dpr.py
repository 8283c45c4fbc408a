"""DPR, deep single-image portrait relighting (Zhou et al. 2019), reformulated as the paper says: I_s and the target
light in, I_t out; S' is not seen. The light is what the renderer finds at the object, as spherical harmonics.

The network is that of the public code in colour: an hourglass in whose bottleneck the first channels mean the source
light, and are replaced by features of the target light. Three channels in and out instead of the lightness, 27 numbers
of light instead of 9, all skips from the start, and none of the biases that a BatchNorm undoes: 689,970 parameters at
width 16 and 4 downs.

Losses: L1 of the picture and of its gradients, and the squared error of the source light, which is the same even light
in every example here, so that its head has little to learn. Left out: the loss of bottleneck features, which needs two
pictures of an object in one batch, and the adversary. Pictures are tone-mapped (`lightnet.data.ranges`). Nine numbers a
channel for the whole object know of no cast shadow.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction
from dataset_builder.lightnet.data.ranges import inside_only, mean_inside, tone_map
from dataset_builder.lightnet.methods.blocks import BatchNorm, InstanceNorm, light_of
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import ModelSpec

LIGHT = 27
"""Numbers of a light: 9 functions in each of 3 channels, and as many channels of the bottleneck."""
HIDDEN = 128
"""Channels between a light and its features."""
UNIT = math.sqrt(4 * math.pi)
"""First coefficient of an even light of radiance 1; lights are seen in units of it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DprPrediction(Prediction):
    """A prediction, with the source light that was found."""

    source: torch.Tensor
    """(B, 27) as the network sees it in I_s, channel by channel, in units of an even light."""


class Dpr(Method):
    """Hourglass; `spec.downs` levels, of which the public code has 4."""

    def __init__(self, spec: ModelSpec):
        super().__init__()
        self.multiple = 2**spec.downs
        width = spec.width
        widths = [width, *(width * min(2**level, 8) for level in range(spec.downs))]
        widths[-1] += LIGHT
        self.before = nn.Sequential(nn.Conv2d(3, width, 5, padding=2, bias=False), BatchNorm(width), nn.ReLU())
        self.levels = nn.ModuleList([_Level(here, below) for here, below in pairwise(widths)])
        self.source_light = _light_layers(last=None)
        self.target_light = _light_layers(last=nn.ReLU())
        self.after = nn.Sequential(
            *_conv_norm_relu(width, 3), *_conv_norm_relu(width, 1), *_conv_norm_relu(width, 1), nn.Conv2d(width, 3, 1))

    def forward(self, inputs: Inputs) -> DprPrediction:
        """I_t, and the source light."""
        target = (inputs.sh / UNIT).flatten(1)[:, :, None, None]
        features, source = self._hourglass(self.before(tone_map(inputs.i_s)), target, 0)
        said = torch.sigmoid(self.after(features).float())
        return DprPrediction(i_t=light_of(said, inputs.inside), source=source.float())

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        """L1 of the picture and of its gradients, and, while training, the squared error of the source light."""
        inside = batch.inputs.inside
        found, wanted = (tone_map(inside_only(image, inside)) for image in (prediction.i_t, batch.truth.i_t))
        terms = {"l1": mean_inside((found - wanted).abs(), inside), "gradient": gradient_l1(found - wanted, inside)}
        if isinstance(prediction, DprPrediction):
            terms["source"] = (prediction.source - _even_light(prediction.source)).square().mean()
        total = torch.stack(list(terms.values())).sum()
        return Loss(total=total, terms={name: term.detach() for name, term in terms.items()})

    def _hourglass(self, x: torch.Tensor, target: torch.Tensor, level: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Features of a level and below; at the bottom the target light takes the place of the source light."""
        if level == len(self.levels):
            source = self.source_light(x[:, :LIGHT].mean(dim=(2, 3), keepdim=True))
            light = self.target_light(target).expand(-1, -1, *x.shape[2:])
            # A write into a part of x, as in the public code, would destroy what the gradient needs
            return torch.cat([light, x[:, LIGHT:]], dim=1), source.flatten(1)
        here = self.levels[level]
        below, source = self._hourglass(here.down(x), target, level + 1)  # type: ignore[operator]
        return here.join(x, below), source  # type: ignore[operator]


class _Level(nn.Module):
    """One level of the hourglass: what it hands down to half the resolution, and what it makes of what comes back."""

    def __init__(self, width: int, below: int):
        super().__init__()
        self.beside = _Block(width, width, InstanceNorm)
        self.lower = _Block(width, below, BatchNorm)
        self.upper = _Block(below, width, InstanceNorm)

    def down(self, x: torch.Tensor) -> torch.Tensor:
        """(B, below, H / 2, W / 2) of (B, width, H, W)."""
        return self.lower(functional.max_pool2d(x, 2))  # type: ignore[no-any-return]

    def join(self, x: torch.Tensor, below: torch.Tensor) -> torch.Tensor:
        """(B, width, H, W) of what was handed down and what became of it."""
        enlarged = functional.interpolate(self.upper(below), scale_factor=2.0, mode="nearest")
        return self.beside(x) + enlarged  # type: ignore[no-any-return]


class _Block(nn.Module):
    """Residual block of two convolutions; the way around has one of its own where widths differ."""

    def __init__(self, before: int, after: int, norm: Callable[[int], nn.Module]):
        super().__init__()
        self.residual = nn.Sequential(nn.Conv2d(before, after, 3, padding=1, bias=False), norm(after), nn.ReLU(),
                                      nn.Conv2d(after, after, 3, padding=1, bias=False), norm(after))
        self.around = nn.Identity() if before == after else nn.Conv2d(before, after, 1, bias=False)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(B, after, H, W) of (B, before, H, W)."""
        return functional.relu(self.residual(x) + self.around(x))


def gradient_l1(difference: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Mean absolute difference of neighbours, down and to the right, both of which are inside."""
    return torch.stack([mean_inside(difference.diff(dim=dim).abs(),
                                    torch.minimum(inside.narrow(dim, 1, inside.shape[dim] - 1),
                                                  inside.narrow(dim, 0, inside.shape[dim] - 1)))
                        for dim in (-2, -1)]).sum()


def _even_light(like: torch.Tensor) -> torch.Tensor:
    """(B, 27) light of radiance 1 from everywhere."""
    light = torch.zeros_like(like)
    light[:, ::LIGHT // 3] = 1
    return light


def _light_layers(*, last: nn.Module | None) -> nn.Sequential:
    layers: list[nn.Module] = [nn.Conv2d(LIGHT, HIDDEN, 1, bias=False), nn.PReLU(),
                               nn.Conv2d(HIDDEN, LIGHT, 1, bias=False)]
    return nn.Sequential(*layers, *([] if last is None else [last]))


def _conv_norm_relu(width: int, size: int) -> list[nn.Module]:
    return [nn.Conv2d(width, width, size, padding=size // 2, bias=False), BatchNorm(width), nn.ReLU()]
