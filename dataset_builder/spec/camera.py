"""Viewpoints as written: cameras drawn at random, or an orbit whose views follow each other."""

from typing import Annotated, Any, Literal

from pydantic import Field, Tag, model_validator

from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, Interval, PositiveInt, Share, Uniform, branches, interval, within


def _clearance(value: Any) -> str | None:
    if isinstance(value, str):
        return "|auto" if value == "auto" else None
    return "|metres" if isinstance(value, (int, float)) and not isinstance(value, bool) else None


Clearance = Annotated[
    Annotated[float, Field(ge=0), Tag("|metres")] | Annotated[Literal["auto"], Tag("|auto")],
    branches(_clearance, "expected a number or auto"),
]
STEEPEST = 89.0
"""Degrees above the horizon that a ring may be at most: straight above, all its views would be one."""


class OrbitSpec(Model):
    """The views of a pair in order, on a spiral about the object from the lowest elevation to the highest: as many on
    equal areas of the sphere, and neighbours about as far apart along the spiral as its turns are from each other."""

    elevation: Annotated[Interval, interval(-89, 90)] = (0.0, 90.0)
    """Lowest and highest elevation in degrees; the default is a semi-sphere. Two equal ones are a ring of equal
    steps."""
    azimuth: AnyNumber = Uniform(uniform=(-180.0, 180.0))
    """Where the first view is, in degrees about the object, 0 in front of it; drawn once per pair."""

    @model_validator(mode="after")
    def _no_ring_above(self) -> "OrbitSpec":
        low, high = self.elevation
        if low == high and high > STEEPEST:
            raise broken(f"expected a ring at an elevation <= {STEEPEST:g}, got {high:g}", path=("elevation",))
        return self


class CameraSpec(Model):
    """Random viewpoints from which the object is visible, or an orbit of them."""

    fov: within(low=1, high=170) = 45.0  # type: ignore[valid-type]
    """Horizontal field of view in degrees."""
    elevation: within(low=-89, high=89) = Uniform(uniform=(5.0, 45.0))  # type: ignore[valid-type]
    """Degrees above the horizon, seen from the object."""
    azimuth: AnyNumber = Uniform(uniform=(-180.0, 180.0))
    """Degrees about the object, 0 in front of it."""
    orbit: OrbitSpec | None = None
    """Views in order about the object, in place of `elevation` and `azimuth`: one `fov`, one distance and the object's
    centre in the middle for all views of a pair."""
    coverage: Annotated[Interval, interval(0, 1)] = (0.08, 0.6)
    """Minimum and maximum share of the frame that the object covers; the camera distance is drawn to reach it."""
    visibility: Share = 0.6
    """Minimum share of the object's silhouette that is in the frame and not occluded."""
    clearance: Clearance = "auto"
    """Minimum distance from the camera to any surface, in metres. auto: 0.15, or half the object's bounding radius
    where that is less."""
    attempts: PositiveInt = 200
    """Maximum number of draws before planning gives up; an orbit needs none."""

    @model_validator(mode="after")
    def _one_way_round(self) -> "CameraSpec":
        for name in ("elevation", "azimuth"):
            if self.orbit is not None and name in self.model_fields_set:
                raise broken(f"expected either `orbit` or `{name}`, got both", path=(name,))
        return self
