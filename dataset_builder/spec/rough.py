"""How rough meshes are made, as written: plain vertex noise, a named level, or steps that follow each other.

All lengths of steps are in radii of the object's bounding sphere, so that they mean the same on a vase and on a sofa.
"""

from math import inf
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Tag, model_validator

from dataset_builder.spec.field import FieldSpec
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, PositiveInt, branches, check_within, within

Along = Literal["isotropic", "normal"]
Positive = within(low=1e-4, high=100)
"""A length or a deviation that is no 0."""
Share = within(low=0, high=1)


def _one_or_many(value: Any) -> str:
    return "|levels" if isinstance(value, (list, tuple)) else "|level"


Sigma = Annotated[AnyNumber, AfterValidator(lambda number: check_within(number, 0, inf))]
Levels = Annotated[
    Annotated[Sigma, Tag("|level")] | Annotated[tuple[Sigma, ...], Field(min_length=1), Tag("|levels")],
    branches(_one_or_many, "expected a number or a list of numbers"),
]
"""One noise level or several."""
LevelName = Literal["smooth", "light", "medium", "heavy", "extreme"]
Names = Annotated[
    Annotated[LevelName, Tag("|level")] | Annotated[tuple[LevelName, ...], Field(min_length=1), Tag("|levels")],
    branches(_one_or_many, "expected a name or a list of names"),
]
"""One named level or several."""


class WhiteStep(Model):
    """Gaussian noise that every vertex has for itself, as in the paper. It tilts the more, the shorter edges are."""

    kind: Literal["white"]
    """Which step this is."""
    sigma: Sigma = 0.004
    """Standard deviation."""
    along: Along = "isotropic"
    """Along each axis, or along normals only."""


class FieldStep(Model):
    """A Gaussian random field, sampled at vertices: neighbours move alike, whatever the mesh looks like."""

    kind: Literal["field"]
    """Which step this is."""
    sigma: Sigma = 0.006
    """Standard deviation."""
    length: Positive = 0.06  # type: ignore[valid-type]
    """Correlation length of the first octave: values at that distance have the correlation exp(-1/2)."""
    octaves: Annotated[int, Field(ge=1, le=8)] = 1
    """Fields that are added, each of half the length of the one before."""
    gain: within(low=1e-3, high=1) = 0.5  # type: ignore[valid-type]
    """Amplitude of an octave in units of the one before; `sigma` is that of all together."""
    along: Along = "isotropic"
    """Along each axis, or along normals only."""


class ScanlinesStep(Model):
    """A field that is alike along the lines of a scanner and differs between them, moving vertices along normals."""

    kind: Literal["scanlines"]
    """Which step this is."""
    sigma: Sigma = 0.003
    """Standard deviation."""
    length: Positive = 0.04  # type: ignore[valid-type]
    """Correlation length across the lines, whose direction is drawn."""
    stretch: within(low=1, high=1000) = 20.0  # type: ignore[valid-type]
    """How many times as long the field is along the lines."""


class BumpsStep(Model):
    """Outliers: single bumps and dents with a Gaussian outline, at points drawn by area on the clean surface."""

    kind: Literal["bumps"]
    """Which step this is."""
    count: within(low=0, high=10000) = 30.0  # type: ignore[valid-type]
    """How many; a drawn number is rounded."""
    height: Sigma = 0.03
    """The highest; each has between half of it and all."""
    width: Positive = 0.05  # type: ignore[valid-type]
    """Standard deviation of the outline."""
    dents: Share = 0.5  # type: ignore[valid-type]
    """Chance that one goes inwards."""


class LikeStep(Model):
    """Fields along normals with the distance and the tilt of meshes that were reconstructed from images; see
    docs/rough-meshes.md for the figures."""

    kind: Literal["like"]
    """Which step this is."""
    of: Literal["field", "smooth_field"]
    """Level sets of density, as of a NeRF, or of signed distance, as of NeuS."""


class SmoothStep(Model):
    """Taubin smoothing, which does not shrink (G. Taubin, "A Signal Processing Approach to Fair Surface Design",
    SIGGRAPH 1995)."""

    kind: Literal["smooth"]
    """Which step this is."""
    rounds: Annotated[int, Field(ge=1, le=1000)] = 10
    """Rounds of one step inwards and one outwards."""


class DecimateStep(Model):
    """Edges collapsed by quadric error until triangles are about as large as equilateral ones of an edge length."""

    kind: Literal["decimate"]
    """Which step this is."""
    edge: Positive = 0.1  # type: ignore[valid-type]
    """That edge length. A mesh that is coarser already stays."""


class VoxelsStep(Model):
    """The surface remade on a grid, as reconstructions do: thin gaps close, sharp edges go. Sheets become shells."""

    kind: Literal["voxels"]
    """Which step this is."""
    size: within(low=0.005, high=1) = 0.03  # type: ignore[valid-type]
    """Side of a cell."""


class ThinStep(Model):
    """Parts thinner than a thickness are lost, as in reconstructions; what is left is open where they were."""

    kind: Literal["thin"]
    """Which step this is."""
    thickness: Positive = 0.05  # type: ignore[valid-type]
    """Length of a ray into the body, from the middle of a face to where it leaves."""
    share: Share = 1.0  # type: ignore[valid-type]
    """Share of space, in patches of a few thicknesses, where thin parts are lost."""


class CloseHolesStep(Model):
    """Holes closed by a fan about the middle of their boundary."""

    kind: Literal["close_holes"]
    """Which step this is."""
    radius: Positive = 0.1  # type: ignore[valid-type]
    """Largest hole that is closed, as the radius of a circle as long as its boundary."""


STEPS: dict[str, type[Model]] = {
    "white": WhiteStep, "field": FieldStep, "scanlines": ScanlinesStep, "bumps": BumpsStep, "like": LikeStep,
    "smooth": SmoothStep, "decimate": DecimateStep, "voxels": VoxelsStep, "thin": ThinStep,
    "close_holes": CloseHolesStep,
}


def _kind(value: Any) -> str | None:
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return f"|{kind}" if kind in STEPS else None


Step = Annotated[
    Annotated[WhiteStep, Tag("|white")] | Annotated[FieldStep, Tag("|field")]
    | Annotated[ScanlinesStep, Tag("|scanlines")] | Annotated[BumpsStep, Tag("|bumps")]
    | Annotated[LikeStep, Tag("|like")] | Annotated[SmoothStep, Tag("|smooth")]
    | Annotated[DecimateStep, Tag("|decimate")] | Annotated[VoxelsStep, Tag("|voxels")]
    | Annotated[ThinStep, Tag("|thin")] | Annotated[CloseHolesStep, Tag("|close_holes")],
    branches(_kind, f"expected a mapping whose kind is one of {', '.join(STEPS)}"),
]
Level = AnyNumber | str | tuple[Step, ...] | FieldSpec
"""A sigma, the name of a level, steps, or a field that the mesh is taken from."""


class RoughSpec(Model):
    """How rough meshes are made. One of `sigma`, `level` and `steps` says how."""

    sigma: Levels | None = 0.004
    """Standard deviation of vertex noise in bounding-sphere radii; a list gives several noise levels, each as a
    separate example."""
    level: Names | None = None
    """Named level in place of `sigma`: the same fields on every object, each twice as rough as the one before; a list
    gives several."""
    steps: tuple[Step, ...] | None = None
    """Steps in place of `sigma`, one after the other; their lengths are in bounding-sphere radii."""
    fields: tuple[FieldSpec, ...] = ()
    """Neural fields whose meshes are rough meshes, each as a level after those of `sigma`, `level` or `steps`; with
    `sigma: null` they are all there is."""
    edge_length: within(low=1e-4) = 0.04  # type: ignore[valid-type]
    """Target edge length in metres; levels and steps take their shortest correlation length or width where that is
    less."""
    edge: within(low=1e-3, high=1) | None = None  # type: ignore[valid-type]
    """Target edge length in bounding-sphere radii, in place of `edge_length`."""
    coarsen: bool = True
    """Whether scans finer than that are decimated to it before white noise, which would shred them; not beyond 0.08
    bounding-sphere radii, nor where the surface would stray by more than 0.002."""
    triangles: PositiveInt = 4_000_000
    """Maximum number of triangles; more are refused."""
    rounds: Annotated[int, Field(ge=0, le=6)] = 1
    """Loop rounds; edges are split to `edge_length * 2**rounds` before. Levels and steps without white noise do fewer
    where the mesh is finer already."""
    crease_angle: Annotated[float, Field(ge=0, le=180)] = 30.0
    """Edges whose faces meet at more than this angle, in degrees, stay sharp."""
    direction: Along = "isotropic"
    """Vertices move independently along each axis, or along their normal only; for `sigma`, as steps have their own."""

    @model_validator(mode="after")
    def _one_way(self) -> "RoughSpec":
        ways = [name for name in ("sigma", "level", "steps") if getattr(self, name) is not None
                and (name != "sigma" or name in self.model_fields_set)]
        if len(ways) > 1 or (self.sigma is None and not ways and not self.fields):
            raise broken(f"expected one of sigma, level and steps, got {' and '.join(ways) or 'none'} (null takes "
                         "one out)", path=(ways[-1] if ways else "sigma",))
        return self

    @model_validator(mode="after")
    def _different_fields(self) -> "RoughSpec":
        made = [field.model_dump(exclude={"gates"}) for field in self.fields]
        for number, each in enumerate(made):
            if each in made[:number]:
                raise broken("expected fields that differ in more than their gates, since equal ones give equal "
                             f"examples, got the field of fields[{made.index(each)}]", path=("fields", number))
        return self

    @property
    def levels(self) -> tuple[Level, ...]:
        """The noise levels, one or more."""
        if self.steps is not None:
            return (self.steps, *self.fields)
        asked: Any = self.sigma if self.level is None else self.level
        return (*(asked if isinstance(asked, tuple) else () if asked is None else (asked,)), *self.fields)
