"""Size of the images and how their pixels are computed, as written."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import PositiveInt


class ImageSpec(Model):
    """Size of every layer in pixels."""

    width: Annotated[int, Field(ge=1, le=16384)] = 128
    """Pixels."""
    height: Annotated[int, Field(ge=1, le=16384)] = 128
    """Pixels."""


class SppSpec(Model):
    """Monte Carlo samples per pixel of each pass."""

    first_hit: PositiveInt = 64
    """Light-free layers, of both meshes."""
    source: PositiveInt = 64
    """`i_s`."""
    target: PositiveInt = 64
    """`i_t`, `s`, `spec`."""
    rough: PositiveInt = 64
    """`s_prime`."""


def _every_pass(value: Any) -> Any:
    """One whole number stands for the same spp in every pass."""
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    if value < 1:
        raise ValueError(f"expected >= 1, got {value}")
    return dict.fromkeys(SppSpec.model_fields, value)


class RenderSpec(Model):
    """How pixels are computed."""

    spp: Annotated[SppSpec, BeforeValidator(_every_pass, json_schema_input_type=PositiveInt | SppSpec)] = SppSpec()
    """A mapping of passes, or one number for all."""
    batches: Annotated[int, Field(ge=2)] = 4
    """Independent batches that spp is split into; standard errors come from their spread."""
    max_depth: PositiveInt = 12
    """Longest path in edges; 2 is direct light only."""
    rr_depth: PositiveInt = 3
    """Path length from which Russian roulette may end a path."""

    @model_validator(mode="after")
    def _batches_divide_spp(self) -> "RenderSpec":
        for name in ("source", "target", "rough"):
            spp = getattr(self.spp, name)
            if spp % self.batches:
                raise broken(f"expected a multiple of batches ({self.batches}), got {spp}", path=("spp", name))
        return self
