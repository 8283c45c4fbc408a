"""The label of an example as a whole: its plan, and what was found while it was rendered.

The same plan gives the same record, bit for bit; wall-clock times are elsewhere (`seconds.csv`).
"""

from typing import Literal

from pydantic import ConfigDict

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.field_record import FieldRecord
from dataset_builder.label.roughness_record import RoughnessRecord
from dataset_builder.label.scene_plan import Vector
from dataset_builder.layers import Pass
from dataset_builder.spec.model import Model


class PassRecord(Model):
    """What one pass took; a pass that was not needed has zeros."""

    name: Pass
    """Of the pass; every one is listed."""
    pixels: int = 0
    """How many were traced."""
    spp: float = 0.0
    """Mean samples of a pixel."""
    spp_min: int = 0
    """Least samples of a pixel."""
    spp_max: int = 0
    """Most samples of a pixel."""
    paths: int = 0
    """Camera paths of the pass, whether or not examples of the same view share it."""


class LayerAccuracy(Model):
    """How good a layer with light became. The error of a pixel is e / sqrt(x^2 + (0.1 m)^2): e its standard error, x
    its value, m the layer's mean."""

    # A study may take one sample per pixel, whose error is not known; `encode_label` refuses it in a dataset
    model_config = ConfigDict(allow_inf_nan=True)

    name: str
    """Layer that it is about."""
    stopped: Literal["spp", "error", "cap", "time"]
    """Why sampling ended: `spp`, it was fixed; else the end of its goal that came first."""
    relative_error: float
    """Root mean square of the error over the layer's pixels and channels."""
    relative_error_95: float
    """What 95% of the layer's pixels stay below, a pixel counting by the root mean square of its channels."""
    object_relative_error: float
    """As `relative_error`, over the object's pixels."""
    object_relative_error_95: float
    """As `relative_error_95`, over the object's pixels."""
    mean_error: float = 0.0
    """Standard error of the layer's mean over that mean, widened by what its tail lets expect; 0 in datasets of earlier
    versions."""
    object_mean_error: float = 0.0
    """As `mean_error`, over the object's pixels."""
    tail: float = 0.0
    """Pareto shape k of the largest contributions to the mean: from 0.5 they have no variance, from 1 no mean."""
    top_share: float = 0.0
    """Share of the mean that the top 0.1% of the contributions hold, at least one."""
    mean_known: Literal["known", "widened", "unknown"] = "known"
    """Whether `mean_error` may be relied on: `unknown`, light that comes rarely but strongly holds too much of the
    mean, or of that of the image that the layer is a part of; most such means are low."""


class Denoised(Model):
    """How far a denoised layer may be trusted: figures over the object, measured before the build on converged
    examples of the dataset (`docs/denoising.md`). relmse_*: mean of (x - reference)^2 / (reference^2 + 0.01)."""

    layer: str
    """Layer that was denoised."""
    bias: float
    """Mean of denoised less reference, over the reference's mean."""
    bias_error: float
    """Standard error of `bias`."""
    pixel_bias: float
    """Root mean square of the part of every pixel's relative error that would stay if the noise came out otherwise;
    with `known` as `at most`, what it is below with 95% confidence."""
    relmse_raw: float
    """Of the layer as it was before."""
    relmse_denoised: float
    """Of the layer after denoising."""
    relmse_reference: float
    """Of the reference's own noise."""
    examples: int
    """Examples that were measured: those in which the object gets any light in this layer."""
    known: Literal["measured", "at most", "unknown"] = "measured"
    """Whether `pixel_bias` was measured, or is a bound since noise hid it; `unknown` where no example gave any figure,
    so that all others are 0 and say nothing. Labels of earlier versions have 0 for a pixel bias that noise hid."""


class RenderRecord(Model):
    """Figures of one example's rendering. Keys with a default were not there in datasets of earlier versions."""

    passes: tuple[PassRecord, ...]
    """One of every pass, needed or not."""
    layers: tuple[LayerAccuracy, ...]
    """One of every layer with light that the example has."""
    denoised: tuple[Denoised, ...] = ()
    """One of every layer that was denoised."""
    roughness_rms: float
    """Distance of the R3DM's vertices from the 3DM, root mean square, in bounding radii; 0 where there is no rough
    mesh, and for captures, which have no clean one."""
    roughness_max: float
    """Largest distance of the R3DM's vertices from the 3DM, in bounding radii; 0 where there is no rough mesh, and
    for captures."""
    bounding_radius: float = 0.0
    """Radius of the sphere about the 3DM's bounding box, metres; 0 where there is no rough mesh."""
    roughness: tuple[RoughnessRecord, ...] = ()
    """One of the rough mesh, where there is one and a clean mesh to measure it against: none for captures."""
    field: tuple[FieldRecord, ...] = ()
    """Figures of the field that `i_s` shows, where it shows one, then of the one that the R3DM is taken from, where
    that is another."""
    lighting_sh: tuple[Vector, ...] = ()
    """Nine coefficients of the light that arrives at the object, red, green and blue each, W/m^2/sr; see
    [layers](layers.md#light-about-the-object). 0 where no layer needs the target light."""
    lighting_sh_se: tuple[Vector, ...] = ()
    """Standard errors of `lighting_sh`."""


class LayerStatistics(Model):
    """Values of one layer as they are stored, over all pixels and channels."""

    min: float
    """Least."""
    max: float
    """Largest."""
    mean: float
    """Mean, to six digits."""


class ExampleLabel(Model):
    """What `<key>.json` holds. No key is ever null; numbers with a fraction always have a decimal point."""

    schema_version: str
    """Of the label's keys: `1`."""
    key: str
    """Eight digits, unique over all splits."""
    index: int
    """Place in the dataset over all splits, from 0."""
    split: str
    """Split that the example belongs to."""
    plan: ExamplePlan
    """Every number that the example was made from."""
    record: RenderRecord
    """What was found on the way."""
    layers: dict[str, LayerStatistics]
    """Values of each layer, by its name."""
