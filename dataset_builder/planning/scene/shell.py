"""What planning asks of the space that a target stands in, whatever it is made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dataset_builder.label.scene_plan import LightPlan, PortalPlan
from dataset_builder.planning.scene.footprints import Box, Footprint, Pose

PARTS = ("floor", "walls", "ceiling")
"""Of a building."""
Geometry = tuple[np.ndarray, np.ndarray, int]
"""World positions (V, 3), faces (F, 3), instance."""


def box_of(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """(3,) low and (3,) high corner of what has faces."""
    positions, faces, _ = geometry
    used = positions[np.unique(faces)]
    return used.min(axis=0), used.max(axis=0)


@dataclass(frozen=True, kw_only=True)
class Reach:
    """Whether one light is kept, and why."""

    kept: bool
    why: str


@dataclass(frozen=True, kw_only=True)
class Openings:
    """What light from outside comes in through."""

    portals: tuple[PortalPlan, ...]
    """Rectangles that cover all of it; none where rectangles do not."""
    why: str
    """Where they are, or why there are none."""
    names: tuple[str, ...] = ()
    """One of each."""


class Shell(Protocol):
    """The space about a target: where things may stand, where cameras and lamps may be, what shines in.

    Points are (3,) in the world, metres; `centre` is the middle of the target's box.
    """

    @property
    def name(self) -> str:
        """Of the room or scene."""

    @property
    def noun(self) -> str:
        """`room` or `scene`."""

    @property
    def said(self) -> str:
        """What there is of it, in words."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts of the building that there are to be taken out of a light's way."""

    @property
    def larger(self) -> str:
        """What to do where something does not fit."""

    @property
    def brighter(self) -> str:
        """What to do where no light gets in."""

    def on_floor(self, extent: Box, rng: np.random.Generator) -> Pose | None:
        """A draw of a pose on the floor, None where none was found. Raises PlanError where there is no floor."""

    def at_wall(self, extent: Box, rng: np.random.Generator) -> Pose | None:
        """A draw of a pose with the back (+Y) to a wall, WALL_GAP from it, None where none was found. Raises PlanError
        where there is no floor."""

    def settled(self, extent: Box, pose: Pose) -> Pose:
        """The pose, brought to the floor under it."""

    def holds(self, box: Footprint) -> bool:
        """Whether a box stands on the floor, fits under what is above, and keeps WALL_GAP from walls and from what the
        scene holds already."""

    def inside(self, point: np.ndarray, margin: float, centre: np.ndarray) -> bool:
        """Whether a camera or a lamp may be at a point, `margin` metres from what bounds the space."""

    def depth(self, centre: np.ndarray, direction: np.ndarray, margin: float) -> float:
        """How far from the centre, along a unit direction (3,), a point can be and still be `inside`; metres."""

    def lets_in(self, light: LightPlan, near: np.ndarray) -> Reach:
        """Whether a light from outside gets to a target that stands at `near`, with nothing taken away."""

    def openings(self, opened: Sequence[str], near: np.ndarray) -> Openings:
        """What light from outside comes in through to a target that stands at `near`, with the parts `opened` taken
        away."""
