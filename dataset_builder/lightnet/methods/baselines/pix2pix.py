"""Pix2Pix (Isola et al. 2017), reformulated as the paper says: I_s and S' in, I_t out.

The networks are those of the public code: a U-Net with one skip a level, told true from false by a PatchGAN that sees
I_s and S' too. At width 64 and 8 downs the generator is its `unet_256`. Also kept: BatchNorm, dropout as the only
noise, normal weights of deviation 0.02, and the loss, vanilla GAN + 100 L1 with the discriminator's halved. Its
training is Adam with a rate of 2e-4 and betas of 0.5 and 0.999, to be written in the spec.

Different here: pictures are tone-mapped (`lightnet.data.ranges`), L1 is the mean over the object, the frame around it
is black on both sides, and pictures are predicted in evaluation mode, without dropout and with moments of the training.
"""

from collections.abc import Iterable

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction
from dataset_builder.lightnet.data.ranges import mean_inside
from dataset_builder.lightnet.methods.blocks import BatchNorm, light_of, signed
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import ModelSpec

L1_WEIGHT = 100.0
DEVIATION = 0.02
"""Of first weights."""
SLOPE = 0.2
"""Of LeakyReLU below 0."""
DROPOUT = 0.5
UNDROPPED = 5
"""Ups without dropout: the innermost and the outer four."""
MIN_SIZE = 32
"""Pixels a side that the discriminator has a patch for, and a multiple of what most generators need."""


class Pix2Pix(Method):
    """Generator and discriminator; a step trains the discriminator first, as the public code does."""

    phases = ("discriminator", "generator")

    def __init__(self, spec: ModelSpec):
        super().__init__()
        self.multiple = max(2**spec.downs, MIN_SIZE)
        self.generator = Generator(6, 3, spec.width, spec.downs)
        self.discriminator = discriminator(9, spec.width)
        self.apply(_first_weights)

    def forward(self, inputs: Inputs) -> Prediction:
        """I_t alone; dropout draws from PyTorch's global state while training."""
        said = self.generator(_condition(inputs)).float()
        return Prediction(i_t=light_of((said + 1) / 2, inputs.inside))

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        """The loss of one of the two."""
        condition, found, wanted = _condition(batch.inputs), signed(prediction.i_t), signed(batch.truth.i_t)
        if phase == "discriminator":
            false, true = self._says(condition, found.detach(), 0.0), self._says(condition, wanted, 1.0)
            return Loss(total=(true + false) / 2, terms={"d_true": true.detach(), "d_false": false.detach()})
        gan, l1 = self._says(condition, found, 1.0), mean_inside((found - wanted).abs(), batch.inputs.inside)
        return Loss(total=gan + L1_WEIGHT * l1, terms={"gan": gan.detach(), "l1": l1.detach()})

    def parameters_of(self, phase: str) -> Iterable[nn.Parameter]:
        """Those of the network that a phase is named after."""
        return getattr(self, phase).parameters()  # type: ignore[no-any-return]

    def _says(self, condition: torch.Tensor, image: torch.Tensor, means: float) -> torch.Tensor:
        """How far the discriminator is from saying 1 (true) or 0 (false): cross-entropy."""
        said = self.discriminator(torch.cat([condition, image], dim=1))
        return functional.binary_cross_entropy_with_logits(said, torch.full_like(said, means))


class Generator(nn.Module):
    """U-Net: 4x4 convolutions that halve, down to 1/2^downs, and transposed ones that double. Output in [-1, 1]."""

    def __init__(self, channels_in: int, channels_out: int, width: int, downs: int):
        super().__init__()
        widths = [width * min(2**level, 8) for level in range(downs)]
        last = downs - 1
        self.downs = nn.ModuleList([
            _down(before, after, first=level == 0, normed=0 < level < last)
            for level, (before, after) in enumerate(zip([channels_in, *widths], widths, strict=False))])
        self.ups = nn.ModuleList([
            _up(widths[level] * (1 if level == last else 2), widths[level - 1],
                dropped=level < last and level >= UNDROPPED - 1) for level in range(last, 0, -1)])
        self.last = nn.Sequential(
            nn.ReLU(), nn.ConvTranspose2d(widths[0] * (2 if last else 1), channels_out, 4, 2, 1), nn.Tanh())

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """(B, channels_out, H, W) of (B, channels_in, H, W)."""
        features: list[torch.Tensor] = []
        for down in self.downs:
            features.append(down(features[-1] if features else x))
        x = features.pop()
        for up in self.ups:
            x = torch.cat([features.pop(), up(x)], dim=1)
        return self.last(x)  # type: ignore[no-any-return]


def discriminator(channels_in: int, width: int) -> nn.Sequential:
    """PatchGAN: logits, one for each overlapping patch of 70 x 70 pixels, that a picture is true."""
    layers: list[nn.Module] = [nn.Conv2d(channels_in, width, 4, 2, 1), nn.LeakyReLU(SLOPE)]
    for before, after, stride in ((1, 2, 2), (2, 4, 2), (4, 8, 1)):
        layers += [nn.Conv2d(before * width, after * width, 4, stride, 1, bias=False), BatchNorm(after * width),
                   nn.LeakyReLU(SLOPE)]
    return nn.Sequential(*layers, nn.Conv2d(8 * width, 1, 4, 1, 1))


def _condition(inputs: Inputs) -> torch.Tensor:
    return torch.cat([signed(inputs.i_s), signed(inputs.s_prime)], dim=1)


def _down(before: int, after: int, *, first: bool, normed: bool) -> nn.Sequential:
    activation = [] if first else [nn.LeakyReLU(SLOPE)]
    norm = [BatchNorm(after)] if normed else []
    return nn.Sequential(*activation, nn.Conv2d(before, after, 4, 2, 1, bias=False), *norm)


def _up(before: int, after: int, *, dropped: bool) -> nn.Sequential:
    dropout = [nn.Dropout(DROPOUT)] if dropped else []
    return nn.Sequential(nn.ReLU(), nn.ConvTranspose2d(before, after, 4, 2, 1, bias=False), BatchNorm(after), *dropout)


def _first_weights(module: nn.Module) -> None:
    if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
        nn.init.normal_(module.weight, 0, DEVIATION)
    elif isinstance(module, BatchNorm):
        nn.init.normal_(module.weight, 1, DEVIATION)
    bias = getattr(module, "bias", None)
    if isinstance(bias, torch.Tensor):
        nn.init.zeros_(bias)
