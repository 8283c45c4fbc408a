"""Scenes from files as written: which file, how it is read, and what becomes of its things, lights and cameras."""

from typing import Annotated, Any, Literal

from pydantic import Field, Tag, model_validator

from dataset_builder.spec.licences import Licence
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import Interval, branches, interval, within

Pattern = Annotated[str, Field(min_length=1, max_length=1000)]
"""A name with * and ?; upper and lower case differ."""
EVERY_SIZE = (0.0, 1000.0)


class ThingQuery(Model):
    """Which things of a scene are meant; all that is given must hold."""

    name: Pattern = "*"
    """Name or path in the scene file, with * and ?."""
    category: str = ""
    """What it is; empty is anything."""
    size: Annotated[Interval, interval(0)] = EVERY_SIZE
    """Minimum and maximum of the longest side of its box, metres."""


def _auto_or_number(value: Any) -> str | None:
    if isinstance(value, str):
        return "|auto" if value == "auto" else None
    return "|factor" if isinstance(value, (int, float)) and not isinstance(value, bool) else None


LightScale = Annotated[
    Annotated[float, Field(gt=0, le=1e9), Tag("|factor")] | Annotated[Literal["auto"], Tag("|auto")],
    branches(_auto_or_number, "expected a number above 0 or auto"),
]


class SceneLightsSpec(Model):
    """What becomes of the lights of a scene file."""

    use: Literal["replaced", "kept", "added"] = "replaced"
    """replaced: the dataset's random target lights take their place. kept: they are the target light, and none is
    drawn. added: both."""
    dim: dict[Pattern, within(low=0, high=1e6)] = {}  # type: ignore[valid-type]
    """Factors by name of the light, with * and ?; 0 switches a light off. The last that fits holds."""
    scale: LightScale = "auto"
    """Factor of all of them. auto: such that what they send to the target together is the drawn `target.strength`,
    since files use all kinds of units."""

    @model_validator(mode="after")
    def _something_is_kept(self) -> "SceneLightsSpec":
        if self.use == "replaced" and (self.dim or self.scale != "auto"):
            raise broken("expected `kept` or `added` beside `dim` and `scale`, got replaced", path=("use",))
        return self


class SceneFileSpec(Model):
    """A scene from a file: a USD stage, a mesh file, or a scene of 3D-FRONT."""

    path: str
    """The file (.usd .usda .usdc .usdz, a mesh file, or .json), relative to this spec."""
    licence: Annotated[Licence, Field(min_length=1)]
    """SPDX identifier of the scene. In the label of every example with it."""
    roots: tuple[str, ...] = ()
    """Folders, relative to this spec, in which the scene may name files; its own folder is always one."""
    scale: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    """Factor from file units to metres; files that state their units are multiplied by it on top."""
    up: Literal["x", "y", "z"] = "y"
    """Axis of a mesh file that points up; USD states its own, and 3D-FRONT has y."""
    variants: dict[str, dict[str, str]] = {}
    """Variants of a USD stage that differ from its own choice: by path of the prim, variant set and variant."""
    models: str = ""
    """Folder of the 3D-FUTURE models, relative to this spec; for a scene of 3D-FRONT."""
    textures: str = ""
    """Folder of the 3D-FRONT textures, relative to this spec; plain colours if empty."""
    parts: dict[Literal["floor", "walls", "ceiling", "object"], tuple[Pattern, ...]] = {}
    """Which things belong to which part of the building, by name with * and ?; `object` is what is none. What is not
    named here follows from names and shapes."""
    leave_out: tuple[Pattern, ...] = ()
    """Things that are taken away, by name with * and ?."""
    slot: ThingQuery | None = None
    """Things that a target from an object file may take the place of: one is drawn, taken away, and the target stands
    there. Without it, the target stands on free floor."""
    lights: SceneLightsSpec = SceneLightsSpec()
    """Lights of the file."""
    cameras: Literal["random", "own"] = "random"
    """random: as the dataset's `camera` has them. own: those cameras of the file that see the target so."""
