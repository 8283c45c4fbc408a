"""LighTNet's objective: a weighted sum of terms, each finite with finite gradients whatever the images.

All terms but `dr` look at tone-mapped values (`lightnet.data.ranges`); all are float32, under autocast too, none sees a
pixel outside the object.
"""

from collections.abc import Callable
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

Term = Callable[[torch.Tensor, torch.Tensor, torch.Tensor], torch.Tensor]
"""Of (B, 3, H, W) tone-mapped prediction and truth, 0 outside, and (B, 1, H, W) inside: a scalar >= 0."""


def l1(found: torch.Tensor, wanted: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Mean absolute difference."""
    return mean_inside((found - wanted).abs(), inside)


def dssim(found: torch.Tensor, wanted: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Mean of (1 - SSIM) / 2, 0 to 1. Windows that reach over the silhouette see the 0 that both sides have there."""
    return mean_inside((1 - ssim_map(found, wanted)) / 2, inside)


def angle(found: torch.Tensor, wanted: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """Mean angle between Lab vectors in radians; black pixels as `colour.lab_angle` counts them."""
    return mean_inside(lab_angle(lab(found), lab(wanted), inside), inside)


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
        found, wanted = (tone_map(inside_only(image, inside)) for image in (prediction.i_t, batch.truth.i_t))
        terms = {}
        if "dr" in self.weights and (prediction.d is not None or prediction.r is not None):
            terms["dr"] = reflectances(batch, prediction)
        if self.trunk is not None:
            terms["fr"] = (self.trunk(found) - self.trunk(wanted)).abs().mean()
        for name, term in IMAGE_TERMS.items():
            if name in self.weights:
                terms[name] = term(found, wanted, inside)
        return terms


def reflectances(batch: Batch, prediction: Prediction) -> torch.Tensor:
    """|D - D_gt| + |R - R_gt|, means over the object; without the part that the prediction lacks."""
    pairs = ((prediction.d, batch.truth.d), (prediction.r, batch.truth.r))
    inside = batch.inputs.inside
    parts = [l1(inside_only(found, inside), inside_only(wanted, inside), inside)
             for found, wanted in pairs if found is not None]
    return torch.stack(parts).sum()
