"""Source and target illumination, as written."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Tag, model_validator

from dataset_builder.light_kinds import LampName
from dataset_builder.spec.lamp import LampSpec
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import (
    AnyNumber,
    Count,
    Interval,
    PositiveInt,
    branches,
    check_within,
    draws,
    interval,
    within,
)

MOST_LAMPS = 1024


def _number_or_lamps(value: Any) -> str | None:
    if isinstance(value, (list, tuple)):
        return "|kind"
    return None if value is None or isinstance(value, (str, bool)) else "|number"


Lights = Annotated[
    Annotated[AnyNumber, AfterValidator(lambda number: check_within(number, 1, MOST_LAMPS)), Tag("|number")]
    | Annotated[tuple[LampSpec, ...], Field(min_length=1, max_length=MOST_LAMPS), Tag("|kind")],
    branches(_number_or_lamps, "expected a number, a distribution, or a list of lamps"),
]


def _each_or_count(value: Any) -> str | None:
    if isinstance(value, str):
        return "|each" if value == "each" else None
    return "|count" if isinstance(value, int) and not isinstance(value, bool) else None


LightCount = Annotated[
    Annotated[Count, Tag("|count")] | Annotated[Literal["each"], Tag("|each")],
    branches(_each_or_count, "expected a whole number or each"),
]
"""Target lights of a view; `each` is one for each lamp."""


class SunSpec(Model):
    """A directional light; elevation above the horizon and azimuth in degrees."""

    elevation: within(low=0, high=90) = 60.0  # type: ignore[valid-type]
    """Degrees above the horizon."""
    azimuth: AnyNumber = 0.0
    """Degrees about the vertical of where it stands: 0 is -y, 90 is +x, 180 is +y, as seen from above
    counter-clockwise. With `through`, from where that window faces: 0 is straight before it."""
    through: Annotated[str, Field(pattern=r"^((window|opening)_[1-9]\d?|top)?$")] = ""
    """Window that it is to shine in through, by the name that `plan` prints: `window_1` is in the +y wall of a room.
    Planning refuses a view where nothing gets in. Empty: it stands where it stands."""
    irradiance: within(low=0) = 1.0  # type: ignore[valid-type]
    """Irradiance on a surface facing the sun; a dome of radiance 1 gives pi."""


class SourceSpec(Model):
    """Source illumination: a uniform dome and an optional sun. Parts of the room that would block it are removed."""

    dome: within(low=0) = 1.0  # type: ignore[valid-type]
    """Radiance of the dome, the same from all directions."""
    sun: SunSpec | None = None
    """No sun if omitted."""
    environment: str = ""
    """Latitude-longitude image (.exr .hdr), relative to the dataset file, that multiplies `dome`; normalised to
    mean luminance 1 over the sphere, so that `dome` sets the brightness. Empty: none."""
    turn: AnyNumber = 0.0
    """Rotation of the environment about the vertical, in degrees."""
    open: tuple[Literal["ceiling", "walls"], ...] = ("ceiling", "walls")
    """Parts of the room that are removed in the source pass."""

    @model_validator(mode="after")
    def _window_is_there(self) -> "SourceSpec":
        if self.sun is not None and self.sun.through and "walls" in self.open:
            raise broken("expected no `through` where the walls are removed, since windows go with them",
                         path=("sun", "through"))
        return self


class TargetSpec(Model):
    """Target illumination: random lights with more energy than the source's, or lamps that are placed."""

    lights: Lights = 1.0
    """Number of random lights, drawn numbers are rounded; or a list of lamps, each where it is put."""
    kinds: Annotated[tuple[LampName, ...], Field(min_length=1)] = ("area", "sphere")
    """Kinds of light, chosen with equal probability."""
    strength: within(low=0) = 2.0  # type: ignore[valid-type]
    """Unoccluded irradiance at the object in units of the source dome's (pi times its radiance). Of n random lights
    each sends 1/n of it; lamps of a list send what they say."""
    temperature: within(low=1000, high=40000) = 4500.0  # type: ignore[valid-type]
    """Colour temperature in kelvin."""
    distance: within(low=0.05) = 1.8  # type: ignore[valid-type]
    """From the object's centre, metres; positions outside the room or inside furniture are redrawn."""
    elevation: within(low=-90, high=90) = 45.0  # type: ignore[valid-type]
    """Degrees above the horizontal plane through the object's centre."""
    size: within(low=1e-4) = 0.2  # type: ignore[valid-type]
    """Side of an area light or radius of a sphere light, metres."""
    cutoff: within(low=1, high=89) = 35.0  # type: ignore[valid-type]
    """Half angle of a spot in degrees."""
    dome: within(low=0) = 0.05  # type: ignore[valid-type]
    """Radiance of the dim light from outside, through windows."""
    environment: str = ""
    """Latitude-longitude image (.exr .hdr), relative to the dataset file, that multiplies `dome`; normalised to
    mean luminance 1 over the sphere, so that `dome` sets the brightness. Empty: none."""
    turn: AnyNumber = 0.0
    """Rotation of the environment about the vertical, in degrees."""
    sun: SunSpec | None = None
    """A sun outside, which shines in through windows. No sun if omitted."""
    textures: tuple[str, ...] = ()
    """Images (.exr .png) for area lights, relative to the dataset file; each light shows one, chosen with equal
    probability and normalised to mean luminance 1, so that `strength` holds. Empty: uniform light."""
    brightness: Annotated[Interval, interval(0)] = (0.1, 20.0)
    """Minimum and maximum mean direct irradiance on the visible part of the object, in units of the source dome's."""
    attempts: PositiveInt = 200
    """Maximum number of draws before planning gives up."""

    @property
    def lamps(self) -> tuple[LampSpec, ...]:
        """Lamps that are placed; none where lights are drawn."""
        return self.lights if isinstance(self.lights, tuple) else ()

    def count_of(self, lights: LightCount) -> int:
        """How many target lights a view has of so many, or of each."""
        return len(self.alone_of(lights)) if lights == "each" else lights

    def alone_of(self, lights: LightCount) -> tuple[int, ...]:
        """The lamps that shine alone, each in its turn, by their place in the list; none where all shine together."""
        return tuple(k for k, lamp in enumerate(self.lamps) if lamp.shines) if lights == "each" else ()

    @property
    def drawn(self) -> bool:
        """Whether two draws of the light can differ: of random lights they always do."""
        lamps = [lamp for lamp in self.lamps if lamp.shines]
        shared = [key for key in ("elevation", "distance", "size", "cutoff", "strength", "temperature")
                  if any(lamp.asks(key) for lamp in lamps)]
        return not self.lamps or any(map(draws, (
            *(getattr(self, key) for key in (*shared, "dome", "turn", "sun")),
            *(value for lamp in lamps for _, value in lamp))))

    @model_validator(mode="after")
    def _lamps_are_whole(self) -> "TargetSpec":
        if self.lamps and not any(lamp.shines for lamp in self.lamps):
            raise broken("expected a lamp that is on, got none", path=("lights",))
        unsaid = any("kind" not in lamp.model_fields_set for lamp in self.lamps)
        if unsaid and self.kinds != type(self).model_fields["kinds"].default:
            raise broken("expected a `kind` of every lamp beside `kinds`, which is about random lights",
                         path=("kinds",))
        if self.lamps and self.textures:
            raise broken("expected no `textures` beside a list of lamps, each has its own `texture`",
                         path=("textures",))
        names = [lamp.name for lamp in self.lamps if lamp.name]
        for index, lamp in enumerate(self.lamps):
            if names.count(lamp.name) > 1:
                raise broken(f"expected names of lamps to differ, got {lamp.name} again",
                             path=("lights", index, "name"))
        return self
