"""The space of a procedural room: a box about the origin with four walls, answered by formulas."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.procedural.rooms import SIDES, window_holes
from dataset_builder.label.scene_plan import LightPlan, PortalPlan, RoomPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.scene.footprints import WALL_GAP, Box, Footprint, Pose, footprint, standing
from dataset_builder.planning.scene.shell import PARTS, Openings, Reach

WALLS = ((0.0, 1.0, 0.0), (-1.0, 0.0, 90.0), (1.0, 0.0, -90.0), (0.0, -1.0, 180.0))
"""Outward x and y of a wall, and the yaw of furniture whose back is to it."""
WINDOW_SIDES = np.array([(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)])
"""(4, 3) outward normals of the walls, in the order in which they get windows."""
GRAZING = 1e-9
"""Cosine up to which a sun is taken to shine along a wall: what rounding leaves of a right angle."""
AXES = (np.array([1.0, 0.0]), np.array([0.0, 1.0]))


@dataclass(frozen=True)
class BoxShell:
    """The space of a procedural room; see `Shell`."""

    room: RoomPlan
    noun = "room"
    parts = PARTS
    larger = "make the room larger or the object smaller; `scale` says how large a mesh file is"
    brighter = "remove parts of the room with `open`, add windows, remove the ceiling, or put a light inside"

    @property
    def name(self) -> str:
        """Of the room."""
        return self.room.name

    @property
    def said(self) -> str:
        """Its size in words."""
        return f"a room of {self.room.width:.2f} x {self.room.depth:.2f} x {self.room.height:.2f} m"

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) low and (3,) high corner."""
        return np.array([*-self._half, 0.0]), np.array([*self._half, self.room.height])

    @property
    def _half(self) -> np.ndarray:
        return np.array([self.room.width, self.room.depth]) / 2

    def on_floor(self, extent: Box, rng: np.random.Generator) -> Pose:
        """Anywhere between the walls, at any turn."""
        yaw = float(rng.uniform(-180, 180))
        box = footprint(extent, (0.0, 0.0, 0.0), yaw)
        free = np.maximum(self._half - WALL_GAP - np.array([box.reach(axis) for axis in AXES]), 0.0)
        return standing(extent, rng.uniform(-1, 1, 2) * free, yaw)

    def at_wall(self, extent: Box, rng: np.random.Generator) -> Pose:
        """Anywhere along one of the four walls."""
        x, y, yaw = WALLS[rng.integers(len(WALLS))]
        outward, along = np.array([x, y]), np.array([-y, x])
        box = footprint(extent, (0.0, 0.0, 0.0), yaw)
        back = np.abs(outward) @ self._half - WALL_GAP - 1e-9 - box.reach(outward)
        free = max(np.abs(along) @ self._half - WALL_GAP - box.reach(along), 0.0)
        return standing(extent, outward * back + along * rng.uniform(-1, 1) * free, yaw)

    def settled(self, extent: Box, pose: Pose) -> Pose:
        """On the floor, z = 0."""
        (x, y, _), yaw = pose
        return (x, y, 0.0), yaw

    def holds(self, box: Footprint) -> bool:
        """Whether a box keeps WALL_GAP from the four walls, and is under the ceiling."""
        reach = np.array([box.reach(axis) for axis in AXES])
        return bool((np.abs(box.centre) + reach <= self._half - WALL_GAP).all()) and box.top <= self.room.height

    def inside(self, point: np.ndarray, margin: float, centre: np.ndarray) -> bool:
        """Whether a point keeps the margin from the six planes; `centre` does not matter."""
        low, high = self.extent
        return bool((point >= low + margin).all() and (point <= high - margin).all())

    def depth(self, centre: np.ndarray, direction: np.ndarray, margin: float) -> float:
        """Way to the first of the planes ahead, less the margin."""
        low, high = self.extent
        bound = np.where(direction > 0, high - margin, low + margin) - centre
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(direction == 0, np.inf, bound / direction)
        return float(steps.min())

    def lets_in(self, light: LightPlan, near: np.ndarray) -> Reach:
        """A dome comes in through all windows, a sun through those in walls that it shines at from outside."""
        if not self.room.ceiling:
            return Reach(kept=True, why="enters where there is no ceiling")
        if not self.room.windows:
            return Reach(kept=False, why="cannot enter a room with a ceiling and no windows")
        sides = WINDOW_SIDES[:self.room.windows]
        shone_at = (sides @ np.asarray(light.direction) < -GRAZING) | LIGHT_KINDS[light.kind].all_round
        said = [name for name, shone in zip(self._windows.values(), shone_at, strict=True) if shone]
        panes = "glazed " if self.room.glazing else ""
        if not said:
            return Reach(kept=False, why=f"does not shine on a wall with one of the {len(sides)} {panes}windows: "
                         f"{', '.join(self._windows.values())}")
        return Reach(kept=True, why=f"enters through {len(said)} {panes}window{'s' if len(said) > 1 else ''}: "
                     f"{', '.join(said)}")

    @property
    def _windows(self) -> dict[str, str]:
        """Windows by name, and in words with their walls."""
        return {f"window_{k}": f"window_{k} ({side})" for k, (side, _) in enumerate(SIDES[:self.room.windows], start=1)}

    def openings(self, opened: Sequence[str], near: np.ndarray) -> Openings:
        """The windows, where walls end outside, and the whole of a ceiling that is not there."""
        if "walls" in opened:
            return Openings(portals=(), why="the walls are removed")
        holes = window_holes(width=self.room.width, depth=self.room.depth, height=self.room.height,
                             windows=self.room.windows, skirting=self.room.skirting)
        named = self._windows
        said = [f"{len(named)} window{'s' if len(named) > 1 else ''}: {', '.join(named.values())}"] * bool(holes)
        names = [*named]
        if not self.room.ceiling or "ceiling" in opened:
            low, high = self.extent
            # Seen from inside, so that right x up points down
            holes.append(np.array([(high[0], low[1], high[2]), (low[0] - high[0], 0, 0), (0, high[1] - low[1], 0)]))
            said.append("the open top")
            names.append("top")
        return Openings(portals=tuple(map(_portal, holes)), why=" and ".join(said) or "there is no opening",
                        names=tuple(names))


def _portal(hole: np.ndarray) -> PortalPlan:
    corner, right, up = ((float(x), float(y), float(z)) for x, y, z in hole)
    return PortalPlan(corner=corner, right=right, up=up)
