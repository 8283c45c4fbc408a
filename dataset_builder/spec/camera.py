"""Cameras, as written."""

from typing import Annotated

from pydantic import Field

from dataset_builder.spec.model import Model
from dataset_builder.spec.numbers import AnyNumber, Interval, PositiveInt, Share, Uniform, interval, within


class CameraSpec(Model):
    """Random viewpoints from which the object is visible."""

    fov: within(low=1, high=170) = 45.0  # type: ignore[valid-type]
    """Horizontal field of view in degrees."""
    elevation: within(low=-89, high=89) = Uniform(uniform=(5.0, 45.0))  # type: ignore[valid-type]
    """Degrees above the horizon, seen from the object."""
    azimuth: AnyNumber = Uniform(uniform=(-180.0, 180.0))
    """Degrees about the object, 0 in front of it."""
    coverage: Annotated[Interval, interval(0, 1)] = (0.08, 0.6)
    """Minimum and maximum share of the frame that the object covers; the camera distance is drawn to reach it."""
    visibility: Share = 0.6
    """Minimum share of the object's silhouette that is in the frame and not occluded."""
    clearance: Annotated[float, Field(ge=0)] = 0.15
    """Minimum distance from the camera to any surface, in metres."""
    attempts: PositiveInt = 200
    """Maximum number of draws before planning gives up."""
