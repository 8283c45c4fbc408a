"""Rooms, objects and scenes as written: one YAML file each."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, within


class RoomSpec(Model):
    """A room of drawn size, in metres."""

    width: within(low=1, high=100) = 5.0  # type: ignore[valid-type]
    """Metres along x."""
    depth: within(low=1, high=100) = 4.0  # type: ignore[valid-type]
    """Metres along y."""
    height: within(low=1.5, high=30) = 2.7  # type: ignore[valid-type]
    """Metres from floor to ceiling."""
    ceiling: bool = True
    """Whether there is one."""
    windows: within(low=0, high=4) = 1.0  # type: ignore[valid-type]
    """How many, at most one in each wall; drawn numbers are rounded."""
    skirting: within(low=0, high=0.5) = 0.08  # type: ignore[valid-type]
    """Height of the skirting boards in metres; 0 is none."""


class ObjectSpec(Model):
    """A piece of furniture: a family with parameters, or a mesh file."""

    family: str | None = None
    """Name of an embedded family; see `dataset-builder families`."""
    params: dict[str, AnyNumber] = {}
    """Parameters of the family that differ from its own distributions."""
    file: str | None = None
    """Mesh file (.glb .gltf .obj .ply), relative to this spec."""
    category: str = ""
    """Filled from the family where it is empty."""
    licence: str = "CC0-1.0"
    """SPDX identifier; written into the label of every example with this object."""
    scale: Annotated[float, Field(gt=0)] = 1.0
    """Factor from file units to metres."""
    up: Literal["x", "y", "z"] = "y"
    """Axis of the file that points up; glTF files have y."""

    @model_validator(mode="after")
    def _one_source(self) -> "ObjectSpec":
        if (self.family is None) == (self.file is None):
            got = "neither" if self.file is None else "both"
            raise broken(f"expected exactly one of `family` and `file`, got {got}")
        if self.file is not None and self.params:
            raise broken("expected no parameters beside `file`, they belong to families", path=("params",))
        return self


class FurnitureSpec(Model):
    """Some pieces of furniture of a scene, beside the target object."""

    object: str
    """Object file, relative to the scene file."""
    count: within(low=0, high=50) = 1.0  # type: ignore[valid-type]
    """How many; drawn numbers are rounded."""
    place: Literal["near", "wall", "floor"] = "floor"
    """near: within reach of the target, to cast shadows on it. wall: back to a wall. floor: anywhere."""


class SceneSpec(Model):
    """A room and what stands in it."""

    room: str
    """Room file, relative to the scene file."""
    furniture: tuple[FurnitureSpec, ...] = ()
    """What else stands there; pieces that find no free place are left out, with a note in the plan."""
    target: Literal["near", "wall", "floor"] = "floor"
    """Where the target object stands; `near` is `floor`."""
