"""LighTNet (section 3 of the paper): estimates D and R from I_s, corrects S', and lights the object with it.

E, a U-Net, sees I_s and has a head for D and one for R. E_r encodes S', D and R to F_r; two decoders make S'_r and
alpha of it. I_t = (D + R + alpha) (S' + S'_r), in exposed linear light. A variant of the paper's table 3 has only the
networks that it uses.

The paper does not print the channels of its networks, nor the range of what they see and say. Ours: widths n, 2n, 4n,
8n, 8n, ..., two convolutions a level, skips from E to its decoder and from E_r to both of its; everything that a
network sees is tone-mapped, and the mask of the object goes with it. What the heads say is turned to quantities so
that an untrained network says I_t = I_s S', roughly: under the even source light I_s is about D + R.

- D: a sigmoid, about the value of I_s. R: a sigmoid, about the 4 % of common dielectrics.
- S'_r >= -S', so that light is never negative: h stands for S' (e^h - 1) where h < 0 and (S' + 1) h elsewhere, 1 being
  the mean of all S'. So h dims by a share, yet lights full shadow and what the rough mesh does not cover.
- S* (direct shading): a softplus, about 1, the mean of all S'.
- alpha: whatever it is, of either sign.
"""

import math

import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction
from dataset_builder.lightnet.data.ranges import tone_map
from dataset_builder.lightnet.methods.blocks import Decoder, Encoder, head, inside_levels
from dataset_builder.lightnet.methods.losses import LightObjective
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import ModelSpec

DARKEST, BRIGHTEST = 1e-3, 0.99
"""Range that I_s is cut to as the first guess of D."""
DIELECTRIC = 0.04
"""First guess of R: normal incidence at a refractive index of 1.5."""
SHADOW = 1.0
"""Light that one unit of the residual's head adds in full shadow: the mean of S'."""
DIRECT_BIAS = math.log(math.e - 1)
"""softplus of it is 1."""


class LighTNet(Method):
    """Every variant of the paper's table 3, by `spec.formulation` and `spec.shading`."""

    def __init__(self, spec: ModelSpec, objective: LightObjective):
        super().__init__()
        self.spec, self.objective, self.off = spec, objective, objective.off
        self.multiple = 2**spec.downs
        has_r, has_alpha, has_shading = spec.formulation != "d_s", "alpha" in spec.formulation, spec.shading != "raw"
        self.encoder, self.decoder = Encoder(4, spec.width, spec.downs), Decoder(spec.width, spec.downs)
        self.d_head = head(spec.width)
        self.r_head = head(spec.width, bias=math.log(DIELECTRIC / (1 - DIELECTRIC))) if has_r else None
        self.light_encoder = Encoder(10 if has_r else 7, spec.width, spec.downs) if has_alpha or has_shading else None
        self.shading = _Branch(spec, DIRECT_BIAS if spec.shading == "direct" else 0.0) if has_shading else None
        self.alpha = _Branch(spec) if has_alpha else None

    def forward(self, inputs: Inputs) -> Prediction:
        """All parts that the variant has; i_t is exactly its formula of them."""
        insides = inside_levels(inputs.inside, self.spec.downs)
        d, r = self._materials(inputs, insides)
        shading, alpha = self._light(inputs, d, r, insides)
        i_t = compose(self.spec, d=d, r=r, shading=shading, alpha=alpha) * inputs.inside
        return Prediction(i_t=i_t, d=d, r=r, shading=shading, alpha=alpha)

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        """The paper's objective, see `lightnet.methods.losses`."""
        return self.objective(batch, prediction)

    def _materials(self, inputs: Inputs, insides: list[torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor | None]:
        features = self.decoder(self.encoder(_seen(inputs.inside, inputs.i_s), insides), insides)
        guess = torch.logit(inputs.i_s.clamp(DARKEST, BRIGHTEST))
        d = torch.sigmoid(guess + self.d_head(features).float()) * inputs.inside
        if self.r_head is None:
            return d, None
        return d, torch.sigmoid(self.r_head(features).float()) * inputs.inside

    def _light(self, inputs: Inputs, d: torch.Tensor, r: torch.Tensor | None,
               insides: list[torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor | None]:
        if self.light_encoder is None:
            return inputs.s_prime, None
        materials = [d] if r is None else [d, r]
        features = self.light_encoder(_seen(inputs.inside, inputs.s_prime, *materials), insides)
        alpha = None if self.alpha is None else self.alpha(features, insides) * inputs.inside
        if self.shading is None:
            return inputs.s_prime, alpha
        said = self.shading(features, insides)
        shading = functional.softplus(said) if self.spec.shading == "direct" else mended(inputs.s_prime, said)
        return shading * inputs.inside, alpha


class _Branch(nn.Module):
    """A decoder of F_r and its head."""

    def __init__(self, spec: ModelSpec, bias: float = 0.0):
        super().__init__()
        self.decoder, self.head = Decoder(spec.width, spec.downs), head(spec.width, bias=bias)

    def forward(self, features: list[torch.Tensor], insides: list[torch.Tensor]) -> torch.Tensor:
        said: torch.Tensor = self.head(self.decoder(features, insides))
        return said.float()


def compose(spec: ModelSpec, *, d: torch.Tensor, r: torch.Tensor | None, shading: torch.Tensor,
            alpha: torch.Tensor | None) -> torch.Tensor:
    """I_t of its parts, as `spec.formulation` says; parts that it does not name are None."""
    strength = d if r is None else d + r
    if alpha is None:
        return strength * shading
    return (strength + alpha) * shading if spec.formulation == "dr_alpha_s" else strength * shading + alpha


def mended(s_prime: torch.Tensor, said: torch.Tensor) -> torch.Tensor:
    """S' + S'_r >= 0 for what the residual's head says; S' where that is 0."""
    return s_prime * (1 + functional.elu(said)) + SHADOW * functional.relu(said)


def _seen(inside: torch.Tensor, *images: torch.Tensor) -> torch.Tensor:
    """What a network sees of images that are 0 outside: display values about 0, and the mask."""
    return torch.cat([*((2 * tone_map(image) - 1) * inside for image in images), inside], dim=1)
