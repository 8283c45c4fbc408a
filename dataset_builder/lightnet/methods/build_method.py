"""From a training spec to a method with its first weights."""

from collections.abc import Callable
from pathlib import Path

import torch

from dataset_builder.lightnet.methods.baselines.dpr import Dpr
from dataset_builder.lightnet.methods.baselines.pix2pix import Pix2Pix
from dataset_builder.lightnet.methods.baselines.ssvbrdf import Ssvbrdf
from dataset_builder.lightnet.methods.lightnet import LighTNet
from dataset_builder.lightnet.methods.losses import LightObjective
from dataset_builder.lightnet.methods.method import Method
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.seeding import derive_seed


def build_method(spec: TrainingSpec, vgg_weights: Path | None = None) -> Method:
    """The method that a spec names, on the CPU. Its first weights depend on the spec's seed, method and model alone;
    the global random state is left as it was.

    vgg_weights: file of VGG-19, for the objective of LighTNet. Raises UserError where it is not what it should be.
    """
    # Nothing on a GPU draws weights, so the states of GPUs need not be kept
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(derive_seed(spec.seed, "weights"))
        return _BUILDERS[spec.method](spec, vgg_weights)


def _lightnet(spec: TrainingSpec, vgg_weights: Path | None) -> Method:
    return LighTNet(spec.model, LightObjective(spec.objective, vgg_weights))


_BUILDERS: dict[str, Callable[[TrainingSpec, Path | None], Method]] = {
    "lightnet": _lightnet,
    "pix2pix": lambda spec, _: Pix2Pix(spec.model),
    "dpr": lambda spec, _: Dpr(spec.model),
    "ssvbrdf": lambda spec, _: Ssvbrdf(spec.model),
}
