"""Source and target illumination, as written."""

from typing import Annotated, Literal

from pydantic import Field

from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import AnyNumber, Interval, PositiveInt, interval, within


class SunSpec(Model):
    """A directional light; elevation above the horizon and azimuth in degrees."""

    elevation: within(low=0, high=90) = 60.0  # type: ignore[valid-type]
    """Degrees above the horizon."""
    azimuth: AnyNumber = 0.0
    """Degrees about the vertical."""
    irradiance: within(low=0) = 1.0  # type: ignore[valid-type]
    """On a surface that faces it; a dome of radiance 1 gives pi."""


class SourceSpec(Model):
    """Source illumination: a uniform dome, plus an optional sun, with what blocks it out of the way."""

    dome: within(low=0) = 1.0  # type: ignore[valid-type]
    """Radiance from everywhere."""
    sun: SunSpec | None = None
    """Leave it out for none."""
    environment: str = ""
    """Latitude-longitude image (.exr .hdr), relative to the dataset file, that multiplies `dome`; brought to mean
    luminance 1 over the sphere, so that `dome` says how bright it is. Empty for none."""
    turn: AnyNumber = 0.0
    """Degrees that the environment is turned about the vertical."""
    open: tuple[Literal["ceiling", "walls"], ...] = ("ceiling", "walls")
    """Parts of the room that are taken away while the source shines."""


class TargetSpec(Model):
    """Target illumination: random lights with more energy than the source's."""

    lights: within(low=1, high=1024) = 1.0  # type: ignore[valid-type]
    """How many; drawn numbers are rounded."""
    kinds: Annotated[tuple[Literal["area", "sphere", "spot", "point"], ...], Field(min_length=1)] = ("area", "sphere")
    """What each light may be, each as likely."""
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
    """Latitude-longitude image (.exr .hdr), relative to the dataset file, that multiplies `dome`; brought to mean
    luminance 1 over the sphere, so that `dome` says how bright it is. Empty for none."""
    turn: AnyNumber = 0.0
    """Degrees that the environment is turned about the vertical."""
    sun: SunSpec | None = None
    """A sun outside, which shines in through windows; leave it out for none."""
    textures: tuple[str, ...] = ()
    """Images (.exr .png), relative to the dataset file, one of which every area light shows, each as likely; brought
    to mean luminance 1, so that `strength` holds. Empty for even light."""
    brightness: Annotated[Interval, interval(0)] = (0.1, 20.0)
    """Least and largest mean direct irradiance on the visible part of the object, in units of the source dome's."""
    attempts: PositiveInt = 200
    """Redraws before planning gives up."""
