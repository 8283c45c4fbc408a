"""What a reader takes out of a scene file, and what it says it did not take: the same for every format."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.label.scene_plan import LightPlan, Vector

Role = Literal["object", "floor", "walls", "ceiling"]
"""`object`: furniture and whatever else stands, lies or hangs; the others are parts of the building."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneThing:
    """One thing of a scene: what may be a target, be taken away, or be opened for a light."""

    name: str
    """Unique in the scene: a prim path, a node's path, `furniture/487`."""
    category: str
    """What it is, in a word (`chair`); empty where the file does not say."""
    role: Role
    asset: Asset
    """Its repaired mesh in a frame of its own, metres, Z up, with materials; things that repeat share one object."""
    world: np.ndarray
    """(4, 4) affine world_from_thing; may scale, shear and mirror. A mirror turns the winding of faces."""
    content: str
    """SHA-256 over what it is made of: equal for equal things of different scenes."""
    licence: str = ""
    """SPDX identifier, where the file names one; else that of the scene holds."""


@dataclass(frozen=True, kw_only=True)
class SceneLight:
    """A light that the scene's author put there."""

    name: str
    """Unique in the scene."""
    light: LightPlan
    """In the world, in the units of the file; `weight` is 0, planning sets it."""


@dataclass(frozen=True, kw_only=True)
class SceneCamera:
    """A camera of the scene."""

    name: str
    """Unique in the scene."""
    position: Vector
    target: Vector
    """A point straight ahead."""
    up: Vector
    fov: float
    """Horizontal field of view, degrees."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneModel:
    """A whole scene, in metres, Z up, right-handed."""

    things: tuple[SceneThing, ...]
    """In the order of the file; each with at least one face."""
    lights: tuple[SceneLight, ...]
    cameras: tuple[SceneCamera, ...]
    contains: str
    """What the file holds and what was taken of it, for people: `14 things, 3 lights, 2 cameras, 21,300 triangles`."""
    left_out: tuple[str, ...] = ()
    """What it holds besides and is not honoured, and what was decided where it leaves a choice, in words."""
    faults: tuple[str, ...] = ()
    """What is wrong with it and was lived with: models that are missing, furniture in walls."""
