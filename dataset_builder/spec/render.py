"""Size of the images and how their pixels are computed, as written."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, Tag, model_validator

from dataset_builder.layers import LAYERS, sampled_as
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import PositiveInt, branches

NOISY = tuple(name for name, layer in LAYERS.items() if layer.radiometric and not layer.of)
"""Layers that carry Monte Carlo noise."""


def _noisy(name: str) -> str:
    if name not in NOISY:
        raise broken("expected a layer with light in it", known=NOISY)
    return name


NoisyLayer = Annotated[str, AfterValidator(_noisy), Field(json_schema_extra={"enum": list(NOISY)})]


class ImageSpec(Model):
    """Size of every layer in pixels."""

    width: Annotated[int, Field(ge=1, le=16384)] = 128
    """Pixels."""
    height: Annotated[int, Field(ge=1, le=16384)] = 128
    """Pixels."""


def _one_or_many(value: Any) -> str:
    return "|many" if isinstance(value, list | tuple) else "|one"


MOST_SPP = 2**24
"""Beyond it, single precision no longer counts samples."""
SampleCount = Annotated[int, Field(ge=1, le=MOST_SPP)]
Spp = Annotated[
    Annotated[SampleCount, Tag("|one")] | Annotated[tuple[SampleCount, ...], Field(min_length=1), Tag("|many")],
    branches(_one_or_many, "expected a whole number or a list of them"),
]
"""Samples per pixel, or several parts of them that are taken one after the other."""


class SppSpec(Model):
    """Monte Carlo samples per pixel of each pass. `[64, 192]` takes 64, then 192 more: a number that is raised by
    appending to the list keeps the samples of an earlier build."""

    first_hit: Spp = 64
    """Light-free layers, of both meshes. The gate radiance_split goes by how `d` varies among them: with fewer than 16
    it rejects some examples by bad luck, and 1 is refused where `i_t`, `s`, `spec` or `air` is asked for."""
    source: Spp = 64
    """`i_s`."""
    target: Spp = 64
    """`i_t`, `s`, `spec`, `air`, `i_t_empty`, `i_pbr`."""
    rough: Spp = 64
    """`s_prime`."""

    @model_validator(mode="after")
    def _not_too_many(self) -> "SppSpec":
        for name in type(self).model_fields:
            if (total := self.total(name)) > MOST_SPP:
                raise broken(f"expected at most {MOST_SPP} samples in all, got {total}", path=(name,))
        return self

    def parts(self, render_pass: str) -> tuple[int, ...]:
        """The parts that the samples of a pass are taken in, one or more."""
        spp = getattr(self, sampled_as(render_pass))
        return spp if isinstance(spp, tuple) else (spp,)

    def total(self, render_pass: str) -> int:
        """Samples per pixel of a pass."""
        return sum(self.parts(render_pass))


def require_spread(spp: SppSpec, layers: Iterable[str]) -> None:
    """Raise where the gate radiance_split is asked about d, of which one sample says nothing."""
    if spp.total("first_hit") == 1 and any(LAYERS[name].render_pass == "target" for name in layers):
        raise broken("expected at least 2, since the gate radiance_split goes by how d varies within a pixel, which "
                     "one sample does not show, got 1 (take 16 or more: with fewer it rejects some examples by bad "
                     "luck)", path=("render", "spp", "first_hit"))


class GoalSpec(Model):
    """Accuracy goal of one layer: sampling continues in rounds until the goal or the cap is reached."""

    error: Annotated[float, Field(gt=0, le=1)] | None = None
    """Relative standard error that 95% of the layer's pixels must stay below, see `docs/accuracy.md`."""
    seconds: Annotated[float, Field(gt=0)] | None = None
    """Time after which no new round starts; the result then depends on the machine."""
    cap: SampleCount = 4096
    """Maximum number of samples per pixel, at least the spp of the layer's pass. A round takes at least four samples
    per batch, so fewer than that may be left unused."""

    @model_validator(mode="after")
    def _asks_for_something(self) -> "GoalSpec":
        if self.error is None and self.seconds is None:
            raise broken("expected `error`, `seconds` or both, got neither")
        return self


class DenoiseSpec(Model):
    """Layers to denoise; the record of every example lists them, with the measured bias."""

    layers: tuple[Literal["i_s", "i_t", "s", "s_prime"], ...] = ()
    """Different layers to denoise, among those that the dataset holds; none by default."""
    keep_raw: bool = False
    """Also store the noisy layer, as `<layer>_raw`."""
    examples: PositiveInt = 2
    """Number of converged examples on which the bias is measured before the build."""

    @model_validator(mode="after")
    def _distinct_layers(self) -> "DenoiseSpec":
        for index, name in enumerate(self.layers):
            if name in self.layers[:index]:
                raise broken(f"expected each layer once, got {name} again", path=("layers", index))
        return self


def _depth(value: Any) -> str | None:
    if isinstance(value, str):
        return "|auto" if value == "auto" else None
    return "|depth" if isinstance(value, int) and not isinstance(value, bool) else None


Depth = Annotated[
    Annotated[int, Field(ge=2), Tag("|depth")] | Annotated[Literal["auto"], Tag("|auto")],
    branches(_depth, "expected a whole number or auto"),
]


Goals = Annotated[
    Annotated[GoalSpec, Tag("|one")] | Annotated[tuple[GoalSpec, ...], Field(min_length=1), Tag("|many")],
    branches(_one_or_many, "expected a goal or a list of goals"),
]
"""A goal, or several that are reached one after the other: each begins with the samples of the one before."""


def _every_pass(value: Any) -> Any:
    """One whole number, or one list of them, stands for the same spp in every pass."""
    if isinstance(value, bool) or not isinstance(value, int | list | tuple):
        return value
    if isinstance(value, int) and not 1 <= value <= MOST_SPP:
        raise ValueError(f"expected {'>= 1' if value < 1 else f'<= {MOST_SPP}'}, got {value}")
    return dict.fromkeys(SppSpec.model_fields, value)


class RenderSpec(Model):
    """How pixels are computed."""

    spp: Annotated[SppSpec, BeforeValidator(_every_pass, json_schema_input_type=Spp | SppSpec)] = SppSpec()
    """A mapping of passes, or one number for all. Where a layer of the pass has a goal, this is the first round."""
    accuracy: dict[NoisyLayer, Goals] = {}
    """Goals by layer, or a list of them that are reached one after the other; a pass continues until all of its layers
    have reached theirs. Without goals, spp is fixed."""
    batches: Annotated[int, Field(ge=2)] = 4
    """Independent batches that spp is split into; standard errors come from their spread."""
    max_depth: Depth = "auto"
    """Maximum path length in edges; 2 is direct light only. auto: planned from the materials and `bias`."""
    rr_depth: PositiveInt = 3
    """Path length from which Russian roulette may end a path."""
    bias: Annotated[float, Field(gt=0, le=0.5)] = 0.01
    """Largest share of the light that planned simplifications may leave out."""
    texture_size: PositiveInt = 4096
    """Maximum texels per side; larger textures are downsampled by averaging."""
    transport: Literal["auto", "camera", "joined"] = "auto"
    """How light that has bounced is found. camera: by paths from the camera alone. joined: by those and paths from the
    lamps, joined. auto: planned for each pass by what the scene calls for."""
    effects: Literal["planned", "all"] = "planned"
    """planned: simulate only what the scene needs. all: everything, on every pixel, for comparison."""
    denoise: DenoiseSpec = DenoiseSpec()
    """Layers to denoise."""

    @model_validator(mode="after")
    def _batches_divide_spp(self) -> "RenderSpec":
        for name in ("source", "target", "rough"):
            for spp in self.spp.parts(name):
                if spp % self.batches:
                    raise broken(f"expected a multiple of batches ({self.batches}), got {spp}", path=("spp", name))
        return self

    def goals(self, layer: str) -> tuple[GoalSpec, ...]:
        """Goals of a layer in the order that they are reached; none where its spp is fixed."""
        found = self.accuracy.get(layer, ())
        return found if isinstance(found, tuple) else (found,)

    @model_validator(mode="after")
    def _caps_allow_the_first_round(self) -> "RenderSpec":
        for name in self.accuracy:
            render_pass = LAYERS[name].render_pass
            for goal in self.goals(name):
                if goal.cap < (spp := self.spp.total(render_pass)):
                    raise broken(f"expected >= the spp of its pass, {spp} of {render_pass}, got {goal.cap}",
                                 path=("accuracy", name, "cap"))
        return self

    @model_validator(mode="after")
    def _goals_ask_for_more_and_more(self) -> "RenderSpec":
        for name in self.accuracy:
            for first, then in pairwise(self.goals(name)):
                if then.cap < first.cap or (then.error or 0.0) > (first.error or 1.0):
                    raise broken("expected goals that ask for more and more: errors that fall and caps that do not",
                                 path=("accuracy", name))
        return self
