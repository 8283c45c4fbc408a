"""Fields as written: objects that are seen through a neural field in place of their clean mesh, and meshes taken from
one."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import PositiveInt, Share

LEAST_VIEWS, MOST_VIEWS = 8, 300
"""Images below which nothing useful is fitted, and what a fit takes at most."""
MOST_HELD_OUT = 64
"""Images that a field is measured on at most."""


class FieldGatesSpec(Model):
    """What a field must meet before examples are rendered with it; all examples of an object that fails are
    rejected."""

    psnr: Annotated[float, Field(ge=0, le=100)] = 22.0
    """Minimum PSNR of held-out images inside their masks, sRGB-encoded, dB."""
    opacity_iou: Share = 0.8
    """Minimum intersection over union of opacity and mask over held-out images."""


class FieldSpec(Model):
    """How a field of an object is made: images of the object alone under the source light, from all around, and a fit
    to them."""

    field: Literal["density", "sdf"] = "density"
    """density: volume density, as NeRF has it; its mesh is pitted. sdf: signed distance, as NeuS has it; its mesh is
    smooth."""
    views: Annotated[int, Field(ge=LEAST_VIEWS, le=MOST_VIEWS)] = 100
    """Images that it is fitted to, on a full sphere."""
    held_out: Annotated[int, Field(ge=1, le=MOST_HELD_OUT)] = 16
    """Further images that it is measured on."""
    size: Annotated[int, Field(ge=16, le=2048)] = 128
    """Width and height of these images in pixels."""
    spp: PositiveInt = 64
    """Samples per pixel of these images; a multiple of 4."""
    resolution: Annotated[int, Field(ge=32, le=512)] = 128
    """Cells along a side of the field's grid."""
    steps: Annotated[int, Field(ge=10, le=100_000)] = 300
    """Steps of the fit."""
    gates: FieldGatesSpec = FieldGatesSpec()
    """What it must meet."""

    @model_validator(mode="after")
    def _batches(self) -> "FieldSpec":
        if self.spp % 4:
            raise broken(f"expected a multiple of 4, got {self.spp}", path=("spp",))
        return self


Gives = Annotated[tuple[Literal["i_s", "r3dm"], ...], Field(min_length=1)]


class SeenSpec(FieldSpec):
    """What `i_s` shows in a split, and what its rough meshes are. With `kind: field`, the keys of a field besides."""

    kind: Literal["mesh", "field"] = "mesh"
    """mesh: the clean mesh is rendered, and rough meshes are as `rough` says. field: each object is seen through a
    field of it."""
    gives: Gives = ("i_s", "r3dm")
    """What is taken from the field: its image (`i_s`), its mesh as the rough mesh in place of `rough` (`r3dm`)."""

    @model_validator(mode="after")
    def _field_asked_for(self) -> "SeenSpec":
        # A dumped spec has every key, at its default
        plain = all(getattr(self, name) == each.default for name, each in type(self).model_fields.items())
        dumped = plain and self.model_fields_set == set(type(self).model_fields)
        if self.kind == "mesh" and not dumped and (extra := sorted(self.model_fields_set - {"kind"})):
            raise broken(f"expected `kind: field` beside {', '.join(extra)}, got kind mesh", path=("kind",))
        return self

    @property
    def image(self) -> bool:
        """Whether `i_s` is a field's image."""
        return self.kind == "field" and "i_s" in self.gives

    @property
    def mesh(self) -> bool:
        """Whether the rough mesh is a field's."""
        return self.kind == "field" and "r3dm" in self.gives


def require_seen(splits: Mapping[str, SeenSpec], layers: Mapping[str, str], denoised: Sequence[str]) -> None:
    """Raise what pydantic takes for a problem where layers of a dataset cannot be had of what its splits see."""
    seen = next((name for name, source in splits.items() if source.image), None)
    if seen and layers.get("i_s") == "frame":
        raise broken(f"expected object, since i_s of split {seen} is the image of a field, got frame",
                     path=("layers", "i_s"))
    if seen and "i_s" in denoised:
        raise broken(f"expected no i_s, which is the image of a field in split {seen}",
                     path=("render", "denoise", "layers"))
    clean = layers.get("i_s_clean")
    meshes = next((name for name, source in splits.items() if not source.image), None)
    if clean and meshes and layers.get("i_s") != clean:
        raise broken(f"expected i_s beside it, of the same extent, since both are the same in split {meshes}, got "
                     f"{layers.get('i_s', 'none')} and {clean}", path=("layers", "i_s_clean"))
