"""How a method is trained, as written: one YAML file, given to `dataset-builder train --config`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from dataset_builder.errors import SpecError
from dataset_builder.spec.document import Document, validated
from dataset_builder.spec.load import overridden, read_document
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import PositiveInt

Method = Literal["lightnet", "pix2pix", "dpr", "ssvbrdf"]
Formulation = Literal["d_s", "dr_s", "dr_s_plus_alpha", "dr_alpha_s"]
"""D S, (D + R) S, (D + R) S + alpha, (D + R + alpha) S: the paper's table 3, top."""
Shading = Literal["residual", "raw", "direct"]
"""S = S' + S'_r, S = S', S = S* predicted as it is: the paper's table 3, bottom."""
VggLayer = Literal["relu3_1", "relu3_4", "pool3"]
NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]


class ModelSpec(Model):
    """Size and form of the network."""

    width: PositiveInt = 16
    """Channels at full resolution; deeper levels have 2, 4 and 8 times as many. 64 is the full size."""
    downs: Annotated[int, Field(ge=1, le=8)] = 4
    """Number of times the resolution is halved."""
    formulation: Formulation = "dr_alpha_s"
    """LighTNet only. How I_t is composed: d_s, dr_s, dr_s_plus_alpha or dr_alpha_s."""
    shading: Shading = "residual"
    """LighTNet only. residual: S = S' + S'_r; raw: S = S'; direct: S is predicted directly."""


class ObjectiveSpec(Model):
    """Weights of LighTNet's losses; 0 turns a term off."""

    dr: NotNegative = 1.0
    """Mean absolute difference of D from the truth, plus that of R."""
    fr: NotNegative = 0.05
    """VGG-19 feature reconstruction; needs `--vgg-weights`, otherwise it is off, with a notice."""
    dssim: NotNegative = 0.5
    """(1 - SSIM) / 2."""
    lab: NotNegative = 0.5
    """Angle between Lab vectors, in radians."""
    l1: NotNegative = 0.0
    """Mean absolute difference of I_t from the truth, tone-mapped."""
    noise: Literal["plain", "weighted", "two_samples"] = "plain"
    """What is made of the truth's noise: plain: nothing; weighted: pixels count by the inverse of their variance, which
    needs `i_t_se`; two_samples: the display curve's bias is taken off the truth and the noise off its SSIM, which needs
    `i_t_half`."""
    vgg_layer: VggLayer = "relu3_4"
    """Activations of the third block at which features are compared; the paper does not say which."""


class DataSpec(Model):
    """Training data and augmentation."""

    train: str = "train"
    """Split to train on; by default the first one where a dataset has no `train`."""
    held_out: str = "evaluation"
    """Split for validation; never used for training. By default the first other one where a dataset has no
    `evaluation`, and none where it has no other."""
    i_s: Literal["i_s", "i_s_clean"] = "i_s"
    """Layer that is I_s in training; i_s_clean is rendered from the mesh where i_s is a field's image. Checks and
    evaluations always take i_s."""
    crop: Annotated[int, Field(ge=16)] = 128
    """Side of the training crop around the object, in pixels; at most the image's side, and rounded down to a multiple
    that the method needs."""
    batch: PositiveInt = 8
    """Examples per step."""
    workers: Annotated[int, Field(ge=0)] = 1
    """Processes that read ahead; 0 reads in the training process. Has no effect on what is read."""
    verify: Literal["off", "size", "shard", "member"] = "member"
    """What is checked while reading, see `docs/reading.md`."""
    cache: str = ""
    """Folder that keeps what was fetched of a dataset at an address; by default one among the user's caches."""
    cache_gb: NotNegative = 4.0
    """Most that is kept there, in GB; 0 keeps nothing."""
    flips: bool = True
    """Mirror left and right, with probability 1/2."""
    exposure: NotNegative = 0.5
    """Maximum change of the target light in stops, up or down, applied to inputs and targets alike."""
    colour: Fraction = 0.1
    """Maximum relative change of each channel of the target light, applied to inputs and targets alike."""
    source_exposure: Annotated[float, Field(gt=0)] = 1.0
    """Factor for `i_s`; 1 suits a source dome of radiance 1."""
    inside: Annotated[float, Field(gt=0, le=1)] = 0.5
    """Minimum mask value of a pixel that counts as object."""

    def among(self, splits: Sequence[str]) -> "DataSpec":
        """With splits that are there in the place of defaults that are not; `held_out` is "" where no other is left."""
        asked = self.model_fields_set
        train = next(iter(name for name in (self.train, *splits) if "train" in asked or name in splits), self.train)
        others = [name for name in splits if name != train]
        held_out = next((name for name in (self.held_out, *others) if "held_out" in asked or name in others), "")
        return self.model_copy(update={"train": train, "held_out": held_out})

    def measured(self, splits: Sequence[str]) -> str:
        """The split to measure on: the one held out in training, else one that it did not see, else the first."""
        return next((name for name in (self.held_out, *splits) if name in splits and name != self.train), splits[0])


class OptimiserSpec(Model):
    """Adam and its learning-rate schedule."""

    rate: Annotated[float, Field(gt=0)] = 1e-3
    """Peak learning rate."""
    betas: tuple[Fraction, Fraction] = (0.9, 0.999)
    """Decay rates of the moments."""
    schedule: Literal["constant", "cosine"] = "cosine"
    """cosine: from `rate` to a hundredth of it at the last step."""
    warm_up: Annotated[int, Field(ge=0)] = 20
    """Warm-up steps, over which the rate rises from 0."""
    clip: NotNegative = 1.0
    """Maximum gradient norm; 0 turns clipping off."""


class CheckSpec(Model):
    """Checks during training."""

    every: PositiveInt = 100
    """Steps between checks on the held-out split, with a checkpoint each."""
    examples: Annotated[int, Field(ge=0)] = 32
    """Held-out examples per check, spread evenly; 0 is all."""
    patience: Annotated[int, Field(ge=0)] = 0
    """Checks without a better PSNR before training stops early; 0 turns early stopping off."""


class TrainingSpec(Model):
    """Training configuration of one method."""

    method: Method = "lightnet"
    """lightnet, or a baseline reformulated as in the paper: pix2pix, dpr, ssvbrdf."""
    seed: Annotated[int, Field(ge=0, lt=2**64)] = 0
    """Seed of the weights, the order of examples, their augmentation and dropout."""
    steps: PositiveInt = 1000
    """Batches to train on."""
    model: ModelSpec = ModelSpec()
    """Network."""
    objective: ObjectiveSpec = ObjectiveSpec()
    """LighTNet's losses; baselines use those of their papers."""
    data: DataSpec = DataSpec()
    """Examples."""
    optimiser: OptimiserSpec = OptimiserSpec()
    """Optimiser."""
    check: CheckSpec = CheckSpec()
    """Checks during training."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Precision of the network; losses are always float32. auto: bfloat16 on CUDA, float32 on the CPU."""
    most_bad_steps: Annotated[int, Field(ge=0)] = 10
    """Number of steps with a non-finite loss or gradient that are skipped before training stops."""

    @property
    def extra(self) -> tuple[str, ...]:
        """Layers that its losses need beyond those of every training."""
        needed = {"weighted": ("i_t_se",), "two_samples": ("i_t_half",)}
        return needed.get(self.objective.noise, ()) if self.method == "lightnet" else ()

    @model_validator(mode="after")
    def _splits_differ(self) -> "TrainingSpec":
        if self.data.train == self.data.held_out and "held_out" in self.data.model_fields_set:
            raise broken(f"expected another split than train's, got {self.data.held_out}", path=("data", "held_out"))
        return self


def load_training(path: Path | str | None = None, overrides: Sequence[str] = ()) -> TrainingSpec:
    """How a method is trained: the file at `path`, or all defaults, with `key.path=value` overrides applied in order.

    Raises SpecError with every broken rule at once.
    """
    document = read_document(Path(path), str(path)) if path else Document(name="defaults", data={}, places={})
    document, problems = overridden(document, overrides)
    spec = validated(document, TrainingSpec)
    if isinstance(spec, list) or problems:
        raise SpecError([*problems, *(spec if isinstance(spec, list) else ())])
    return spec


def differences(first: Model, second: Model) -> dict[str, tuple[Any, Any]]:
    """Dotted keys in which two specs of one kind differ, with both values."""
    one, two = flat(first), flat(second)
    return {key: (one[key], two[key]) for key in one if one[key] != two[key]}


def flat(spec: Model) -> dict[str, Any]:
    """Values by dotted key, as JSON has them."""
    return _flat(spec.model_dump(mode="json"))


def _flat(plain: Mapping[str, Any], path: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in plain.items():
        found |= _flat(value, f"{path}{key}.") if isinstance(value, dict) else {f"{path}{key}": value}
    return found
