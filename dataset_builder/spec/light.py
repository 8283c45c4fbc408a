"""Source and target illumination, as written."""

from typing import Annotated, Literal

from pydantic import Field

from dataset_builder.light_kinds import LampName
from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import AnyNumber, Interval, PositiveInt, interval, within


class SunSpec(Model):
    """A directional light; elevation above the horizon and azimuth in degrees."""

    elevation: within(low=0, high=90) = 60.0  # type: ignore[valid-type]
    """Degrees above the horizon."""
    azimuth: AnyNumber = 0.0
    """Degrees about the vertical."""
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


class TargetSpec(Model):
    """Target illumination: random lights with more energy than the source's."""

    lights: within(low=1, high=1024) = 1.0  # type: ignore[valid-type]
    """Number of lights; drawn numbers are rounded."""
    kinds: Annotated[tuple[LampName, ...], Field(min_length=1)] = ("area", "sphere")
    """Kinds of light, chosen with equal probability."""
    strength: within(low=0) = 2.0  # type: ignore[valid-type]
    """Unoccluded irradiance at the object in units of the source dome's (pi times its radiance)."""
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
