"""Views of a pair that follow each other, as written: how the camera moves, or the target before it."""

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, Tag, model_validator

from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, Interval, Uniform, branches, interval, within

STEEPEST = 89.0
"""Degrees above the horizon that a ring may be at most: straight above, all its views would be one."""
WIDEST = 3600.0
"""Degrees about the object from a key of a spline to the next."""
STEEPEST_KEY = 85.0
"""Degrees up or down that a spline may look at most: nearer to the vertical, the picture would spin about it."""
Vector3 = tuple[float, float, float]


class OrbitSpec(Model):
    """The views of a pair in order, on a spiral about the object from the lowest elevation to the highest: as many on
    equal areas of the sphere, and neighbours about as far apart along the spiral as its turns are from each other. All
    have one `fov`, one distance, and the object's centre in the middle."""

    kind: Literal["orbit"]
    """Which path this is."""
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


class TurntableSpec(Model):
    """One camera, which stays with the room and its lamps; the target turns about the vertical through the middle of
    its footprint, by as much from each view to the next. Numbers are drawn once per pair."""

    kind: Literal["turntable"]
    """Which path this is."""
    turns: within(low=0.01, high=100) = 1.0  # type: ignore[valid-type]
    """Whole turns that the views share: from each to the next it is 360 `turns` / `views` degrees."""
    start: AnyNumber = 0.0
    """Degrees that the target is turned, counter-clockwise, in the first view from how it was placed."""
    direction: Literal["counter-clockwise", "clockwise"] = "counter-clockwise"
    """Which way it turns, seen from above."""
    elevation: within(low=-89, high=89) = Uniform(uniform=(5.0, 45.0))  # type: ignore[valid-type]
    """Of the camera, degrees above the horizon, seen from the object."""
    azimuth: AnyNumber = Uniform(uniform=(-180.0, 180.0))
    """Of the camera, degrees about the object as it was placed, 0 in front of it."""


def _look_at(value: Any) -> str | None:
    if isinstance(value, str):
        return "|object" if value == "object" else None
    return "|point" if isinstance(value, (list, tuple)) else None


class PathKeySpec(Model):
    """One pose that a spline goes through: about the object (`azimuth`, `elevation`, `distance`), or in the room
    (`position`, `look_at`)."""

    azimuth: float | None = None
    """Degrees about the object, 0 in front of it. 0, 180, 360 goes once round; at most 3600 from the key before."""
    elevation: Annotated[float, Field(ge=-STEEPEST_KEY, le=STEEPEST_KEY)] = 0.0
    """Degrees above the horizon, seen from the object's centre."""
    distance: Annotated[float, Field(ge=1e-3, le=1e4)] | None = None
    """Metres from the object's centre; if omitted, found as that of an orbit."""
    position: Vector3 | None = None
    """In the room, metres, in place of the three above."""
    look_at: Annotated[
        Annotated[Literal["object"], Tag("|object")] | Annotated[Vector3, Tag("|point")],
        branches(_look_at, "expected object or three numbers"),
    ] = "object"
    """What is in the middle of the frame: the object's centre, or a point in the room."""
    fov: Annotated[float, Field(ge=1, le=170)] | None = None
    """Horizontal field of view in degrees; if omitted, that of the camera."""

    @model_validator(mode="after")
    def _one_frame(self) -> "PathKeySpec":
        about = [name for name in ("azimuth", "elevation", "distance") if name in self.model_fields_set
                 and getattr(self, name) != type(self).model_fields[name].default]
        if (self.azimuth is None) == (self.position is None):
            got = "neither" if self.position is None else "both"
            raise broken(f"expected exactly one of `azimuth` and `position`, got {got}")
        if self.position is not None and about:
            raise broken(f"expected no `{about[0]}` beside `position`", path=(about[0],))
        if self.azimuth is not None and self.look_at != "object":
            raise broken("expected `position` beside `look_at`, got a key about the object", path=("look_at",))
        if self.position is not None and self.look_at == self.position:
            raise broken("expected a point other than `position`", path=("look_at",))
        return self


class SplineSpec(Model):
    """A smooth path through poses, with views at equal lengths of it. The camera keeps its horizon."""

    kind: Literal["spline"]
    """Which path this is."""
    keys: Annotated[tuple[PathKeySpec, ...], Field(min_length=2, max_length=1000)]
    """What it goes through, in order. Where all are about the object, the path is drawn in their three numbers, else
    in the room."""
    closed: bool = False
    """Whether it goes on from the last key to the first: the first view then follows the last. Otherwise the first
    view is at the first key, and the last at the last."""

    @model_validator(mode="after")
    def _distinct(self) -> "SplineSpec":
        kept = [key.model_dump(exclude={"fov"}) for key in self.keys]
        pairs = list(enumerate(pairwise(kept), start=1))
        pairs += [(0, (kept[-1], kept[0]))] if self.closed else []
        for number, (before, after) in pairs:
            if before == after:
                raise broken("expected a key that differs from the one before", path=("keys", number))
            away = abs((after["azimuth"] or 0.0) - (before["azimuth"] or 0.0))
            if number and away > WIDEST and None not in (after["azimuth"], before["azimuth"]):
                raise broken(f"expected at most {WIDEST:g} degrees from the key before, got {away:g}",
                             path=("keys", number, "azimuth"))
        return self


class PosesSpec(Model):
    """Cameras from a file, in its order: `transforms.json` as NeRF has it, or a COLMAP model."""

    kind: Literal["poses"]
    """Which path this is."""
    file: Annotated[str, Field(min_length=1)]
    """A .json file, or a folder that holds `transforms.json` or COLMAP's `cameras` and `images` (.bin .txt), relative
    to the dataset file. Only poses and lenses are read: photographs need not be there."""
    about: Literal["object", "room"] = "object"
    """Where the file's origin is: at the object's centre, its axes turned with the object, or at the room's origin."""
    scale: Annotated[float, Field(ge=1e-6, le=1e6)] = 1.0
    """Metres per unit of the file."""
    fov: Annotated[float, Field(ge=1, le=170)] | None = None
    """Horizontal field of view in degrees; if omitted, that of each pose in the file."""
    up: Vector3 = (0.0, 0.0, 1.0)
    """What points up in the file; it is turned to +Z the shortest way. [0, -1, 0] for models of COLMAP that were not
    turned upright."""

    @model_validator(mode="after")
    def _some_way(self) -> "PosesSpec":
        if not any(self.up):
            raise broken("expected a direction, got [0, 0, 0]", path=("up",))
        return self


PATHS: dict[str, type[Model]] = {"orbit": OrbitSpec, "turntable": TurntableSpec, "spline": SplineSpec,
                                 "poses": PosesSpec}


def _kind(value: Any) -> str | None:
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return f"|{kind}" if kind in PATHS else None


CameraPath = Annotated[
    Annotated[OrbitSpec, Tag("|orbit")] | Annotated[TurntableSpec, Tag("|turntable")]
    | Annotated[SplineSpec, Tag("|spline")] | Annotated[PosesSpec, Tag("|poses")],
    branches(_kind, f"expected a mapping whose kind is one of {', '.join(PATHS)}"),
]
