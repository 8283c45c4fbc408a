"""Viewpoints as written: cameras drawn at random, or a path whose views follow each other."""

from typing import Annotated, Any, Literal

from pydantic import Field, Tag, model_validator

from dataset_builder.spec.camera_path import CameraPath
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, Interval, PositiveInt, Share, Uniform, branches, interval, within
from dataset_builder.spec.problems import flow


def _clearance(value: Any) -> str | None:
    if isinstance(value, str):
        return "|auto" if value == "auto" else None
    return "|metres" if isinstance(value, (int, float)) and not isinstance(value, bool) else None


Clearance = Annotated[
    Annotated[float, Field(ge=0), Tag("|metres")] | Annotated[Literal["auto"], Tag("|auto")],
    branches(_clearance, "expected a number or auto"),
]


class CameraSpec(Model):
    """Random viewpoints from which the object is visible, or a path whose views follow each other."""

    fov: within(low=1, high=170) = 45.0  # type: ignore[valid-type]
    """Horizontal field of view in degrees."""
    elevation: within(low=-89, high=89) = Uniform(uniform=(5.0, 45.0))  # type: ignore[valid-type]
    """Degrees above the horizon, seen from the object."""
    azimuth: AnyNumber = Uniform(uniform=(-180.0, 180.0))
    """Degrees about the object, 0 in front of it."""
    path: CameraPath | None = None
    """The `views` of a pair in order, in place of `elevation` and `azimuth`: an orbit, a turntable, a spline through
    poses, or poses from a file."""
    coverage: Annotated[Interval, interval(0, 1)] = (0.08, 0.6)
    """Minimum and maximum share of the frame that the object covers; the camera distance is drawn to reach it."""
    visibility: Share = 0.6
    """Minimum share of the object's silhouette that is in the frame and not occluded."""
    clearance: Clearance = "auto"
    """Minimum distance from the camera to any surface, in metres. auto: 0.15, or half the object's bounding radius
    where that is less."""
    attempts: PositiveInt = 200
    """Maximum number of draws before planning gives up; of paths, only a turntable draws."""

    @model_validator(mode="before")
    @classmethod
    def _no_orbit(cls, data: Any) -> Any:
        if isinstance(data, dict) and "orbit" in data:
            orbit = data["orbit"]
            keys = f", {flow(orbit)[1:]}" if isinstance(orbit, dict) and orbit else "}"
            does = "leave it out" if orbit is None else f"write `path: {{kind: orbit{keys}`"
            raise broken(f"expected no `orbit`, which is a kind of `path` now: {does}", path=("orbit",))
        return data

    @model_validator(mode="after")
    def _one_way_round(self) -> "CameraSpec":
        for name in ("elevation", "azimuth"):
            if self.path is not None and name in self.model_fields_set:
                raise broken(f"expected either `path` or `{name}`, got both", path=(name,))
        if self.path is not None and self.path.kind == "poses" and "fov" in self.model_fields_set:
            raise broken("expected no `fov` beside poses, whose file has it (write `path.fov` for another)",
                         path=("fov",))
        return self
