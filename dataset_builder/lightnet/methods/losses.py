"""LighTNet's objective: a weighted sum of terms, each finite with finite gradients whatever the images.

All terms but `dr` look at tone-mapped values (`lightnet.data.ranges`); all are float32, under autocast too, none sees a
pixel outside the object.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import torch
from torch import nn

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.ranges import inside_only, mean_inside, tone_map
from dataset_builder.lightnet.measures.colour import lab, lab_angle
from dataset_builder.lightnet.measures.metrics import ssim_map
from dataset_builder.lightnet.methods import vgg
from dataset_builder.lightnet.methods.method import Loss
from dataset_builder.lightnet.settings import ObjectiveSpec

Term = Callable[["PicturePair"], torch.Tensor]
"""A (B, C, H, W) picture >= 0, whose mean over the object is the term."""
FLOOR = 0.05
"""Error of display values that counts as much as noise does: what no network gets right anyhow."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PicturePair:
    """Two pictures (B, 3, H, W), tone-mapped, 0 outside, and (B, 1, H, W) inside."""

    found: torch.Tensor
    wanted: torch.Tensor
    inside: torch.Tensor
    noise: torch.Tensor | None = None
    """(B, 3, H, W) variance of what is wanted, where it is to be taken off."""


def l1(pair: PicturePair) -> torch.Tensor:
    """Absolute difference."""
    return (pair.found - pair.wanted).abs()


def dssim(pair: PicturePair) -> torch.Tensor:
    """(1 - SSIM) / 2, 0 to 1. Windows that reach over the silhouette see the 0 that both sides have there."""
    return (1 - ssim_map(pair.found, pair.wanted, pair.noise)) / 2


def angle(pair: PicturePair) -> torch.Tensor:
    """Angle between Lab vectors in radians; black pixels as `colour.lab_angle` counts them."""
    return lab_angle(lab(pair.found), lab(pair.wanted), pair.inside)


IMAGE_TERMS: MappingProxyType[str, Term] = MappingProxyType({"dssim": dssim, "lab": angle, "l1": l1})
"""Terms that need two images and nothing else, by their weight's name in `ObjectiveSpec`."""


class LightObjective(nn.Module):
    """The weighted sum of the terms that a spec gives a weight; it has nothing to train and nothing to save.

    `off` says, a sentence each, which terms the spec asks for and are left out all the same; logs must repeat it.
    """

    def __init__(self, spec: ObjectiveSpec, vgg_weights: Path | None = None, *, vgg_sha256: str = vgg.SHA256):
        """vgg_sha256: digest of a weights file that is not torchvision's.

        Raises UserError where no term is left, and for a weights file as `vgg.load_trunk` does.
        """
        super().__init__()
        weights = {name: getattr(spec, name) for name in ("dr", "fr", *IMAGE_TERMS)}
        self.off: tuple[str, ...] = ()
        if weights["fr"] and vgg_weights is None:
            self.off = (f"fr is off, its weight {weights['fr']:g} is not used: "
                        f"it needs --vgg-weights with torchvision's {vgg.FILE}",)
            weights["fr"] = 0
        self.noise = spec.noise
        self.weights = {name: float(weight) for name, weight in weights.items() if weight}
        if not self.weights:
            raise UserError(f"objective: expected a weight above 0, got none ({'; '.join(self.off) or 'set one'})")
        self.trunk = (vgg.load_trunk(vgg_weights, spec.vgg_layer, expected_sha256=vgg_sha256)
                      if vgg_weights is not None and "fr" in self.weights else None)

    def forward(self, batch: Batch, prediction: Prediction) -> Loss:
        """The loss of a prediction, with the terms that it has parts for (`dr` asks for D, and for R if there is one).

        Raises ValueError where none of the terms applies.
        """
        with torch.autocast(prediction.i_t.device.type, enabled=False):
            terms = self._terms(batch, prediction)
        if not terms:
            raise ValueError(f"expected parts for one of the terms {', '.join(self.weights)}, the prediction has none")
        total = torch.stack([self.weights[name] * value for name, value in terms.items()]).sum()
        return Loss(total=total, terms={name: value.detach() for name, value in terms.items()})

    def _terms(self, batch: Batch, prediction: Prediction) -> dict[str, torch.Tensor]:
        inside = batch.inputs.inside
        found, truth = (tone_map(inside_only(image, inside)) for image in (prediction.i_t, batch.truth.i_t))
        pair = PicturePair(found=found, wanted=truth, inside=inside)
        if self.noise == "two_samples":
            pair = two_samples(pair, batch)
        weight = inverse_variance(batch) if self.noise == "weighted" else None
        terms = {}
        if "dr" in self.weights and (prediction.d is not None or prediction.r is not None):
            terms["dr"] = reflectances(batch, prediction)
        if self.trunk is not None:
            terms["fr"] = (self.trunk(found) - self.trunk(pair.wanted)).abs().mean()
        for name, term in IMAGE_TERMS.items():
            if name in self.weights:
                terms[name] = mean_inside(term(pair) if weight is None else term(pair) * weight, inside)
        return terms


def two_samples(pair: PicturePair, batch: Batch) -> PicturePair:
    """What is wanted without the bias of the display curve, and its variance, of the two halves of the samples.

    The curve g bends, so that noise makes g(I_t) too dark. Halves have twice the variance and so twice that bias:
    2 g(I_t) - (g(one) + g(other)) / 2 has none, up to the fourth power of noise (the jackknife of Quenouille,
    Biometrika 43, 1956). Squared, half the difference of the halves is the variance of their mean.
    """
    half = batch.truth.i_t_half
    assert half is not None, "trainings ask for it"
    one, other = (tone_map(inside_only(image.clamp_min(0), pair.inside))
                  for image in (half, 2 * batch.truth.i_t - half))
    return replace(pair, wanted=2 * pair.wanted - (one + other) / 2, noise=((one - other) / 2).square())


def inverse_variance(batch: Batch) -> torch.Tensor:
    """(B, 1, H, W) weights of mean 1 inside: 1 / (v + FLOOR^2), v the mean variance of the channels' display values."""
    i_t, error, inside = batch.truth.i_t, batch.truth.i_t_se, batch.inputs.inside
    assert error is not None, "trainings ask for it"
    high, low = (tone_map(inside_only(image, inside)) for image in (i_t + error, (i_t - error).clamp_min(0)))
    weight = 1 / (((high - low) / 2).square().mean(dim=1, keepdim=True) + FLOOR**2)
    return weight / mean_inside(weight, inside).clamp_min(1e-12)


def reflectances(batch: Batch, prediction: Prediction) -> torch.Tensor:
    """|D - D_gt| + |R - R_gt|, means over the object; without the part that the prediction lacks."""
    pairs = ((prediction.d, batch.truth.d), (prediction.r, batch.truth.r))
    inside = batch.inputs.inside
    parts = [mean_inside((inside_only(found, inside) - inside_only(wanted, inside)).abs(), inside)
             for found, wanted in pairs if found is not None]
    return torch.stack(parts).sum()
