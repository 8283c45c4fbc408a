"""The space of a scene from a file, or of a room of ours: `shell_of` gives the one that fits."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import LightPlan, RoomPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.scene.footprints import WALL_GAP, Box, Footprint, Pose, footprint, standing
from dataset_builder.planning.scene.free_floor import HEAD_ROOM, FreeFloor
from dataset_builder.planning.scene.mesh_space import Content, MeshSpace, space_of
from dataset_builder.planning.scene.opening_search import openings_of
from dataset_builder.planning.scene.shell import PARTS, Geometry, Openings, Reach, Shell
from dataset_builder.planning.scene.storeys import MIN_FLOOR, STEP
from dataset_builder.planning.scene.ways_out import BOUNCES, WaysOut, ways_out

LOOKS = 24
"""Directions and places from which walls are looked for at once."""
UNEVEN = 0.03
"""Metres by which a wall may lie further back behind some part of what stands at it."""
AWAY = 1e-3
"""Metres beyond WALL_GAP that things stand from a wall, more than rays are off by."""
LINES = 1 << 13
"""Paths that openings are found from."""
LATTICE, MOST_ACROSS = 0.1, 24
"""Metres between the points of a footprint that have floor under them, and points along a side at most."""


def shell_of(room: RoomPlan, building: Sequence[Geometry], contents: Sequence[Geometry],
             clear: tuple[Sequence[Geometry], Sequence[Geometry]] = ((), ()), parts: Sequence[str] = PARTS) -> Shell:
    """The space of a room. building: world triangles of floors, walls and ceilings; contents: of all other things of
    the scene, without the target and without what is placed by layout; clear: of both, those that are see-through and
    in neither; parts: of the building that there are. None of it matters for a procedural room.
    """
    if room.kind == "procedural":
        return BoxShell(room)
    hiding, whole = Content.of(building, contents), Content.of((*building, *clear[0]), (*contents, *clear[1]))
    return MeshShell(name=room.name, space=space_of(whole, hiding), parts=tuple(parts))


@dataclass(frozen=True, kw_only=True)
class MeshShell:
    """The space of a scene given as triangles; see `Shell`."""

    name: str
    space: MeshSpace
    parts: tuple[str, ...] = PARTS
    noun = "scene"
    larger = ("take a smaller object (`scale` says how large a mesh file is), `leave_out` what stands in the way, or "
              "let it take the place of a thing with `slot`")
    brighter = "remove parts of the building with `open`, keep lights of the scene, or put a light inside"

    @property
    def said(self) -> str:
        """How much free floor there is, in words."""
        floors = self.space.floors
        rooms = sum(floor.rooms for floor in floors)
        return (f"a scene with {sum(floor.area for floor in floors):.1f} m² of free floor "
                f"({_counted(len(floors), 'storey')}, {_counted(rooms, 'room')})")

    def _floors(self) -> tuple[FreeFloor, ...]:
        if not any(floor.area for floor in self.space.floors):
            got = "a stage without a floor" if not self.space.floors else "a floor that is covered"
            rule = (f"expected free floor to place things on, got {got}: nowhere is {MIN_FLOOR:g} m² of it clear, with "
                    f"{HEAD_ROOM:g} m of head room")
            raise PlanError([Problem(where="", path=self.name, rule=rule, hint="say with `parts` which things are "
                                     "floor, or make `things` of the scene, or a `slot`, the target")])
        return self.space.floors

    def _drawn_cell(self, extent: Box, rng: np.random.Generator, count: int) \
            -> tuple[list[FreeFloor], np.ndarray] | None:
        """Storeys, and (count, 2) points on them, about which there may be place."""
        floors = self._floors()
        cells = [floor.places(extent.size[2], min(extent.size[:2]) / 2) for floor in floors]
        ends = np.cumsum([len(own) for own in cells])
        if not ends[-1]:
            return None
        numbers = rng.integers(ends[-1], size=count)
        aside = rng.uniform(-0.5, 0.5, (count, 2)) * floors[0].grid.cell
        which = np.searchsorted(ends, numbers, side="right")
        chosen = np.array([cells[k][number - ends[k]] for k, number in zip(which, numbers, strict=True)])
        return [floors[k] for k in which], floors[0].grid.middles(chosen) + aside

    def on_floor(self, extent: Box, rng: np.random.Generator) -> Pose | None:
        """Anywhere on free floor of any storey, at any turn."""
        yaw = float(rng.uniform(-180, 180))
        drawn = self._drawn_cell(extent, rng, 1)
        return drawn and _on(drawn[0][0], extent, drawn[1][0], yaw)

    def at_wall(self, extent: Box, rng: np.random.Generator) -> Pose | None:
        """At the first wall that is upright and flat behind all of the thing, seen from free floor at random."""
        drawn = self._drawn_cell(extent, rng, LOOKS)
        if drawn is None:
            return None
        floors, points = drawn
        turns = rng.uniform(-np.pi, np.pi, LOOKS)
        ahead = np.stack([np.cos(turns), np.sin(turns), np.zeros(LOOKS)], axis=1)
        low = [floor.top[floor.grid.indices(point[None])[0]] for floor, point in zip(floors, points, strict=True)]
        eyes = np.column_stack([points, np.array(low) + min(extent.size[2] / 2, HEAD_ROOM)])
        walls = self.space.opaque_house
        distance, normals = walls.first_hit(eyes, ahead)[1], walls.normals(eyes, ahead)
        for k in np.flatnonzero(np.isfinite(distance) & (np.abs(normals[:, 2]) < 0.1)):
            inward = normals[k, :2] / np.linalg.norm(normals[k, :2])
            if (pose := self._back_to(floors[k], extent, eyes[k, :2] + ahead[k, :2] * distance[k], inward)) is not None:
                return pose
        return None

    def _back_to(self, floor: FreeFloor, extent: Box, foot: np.ndarray, inward: np.ndarray) -> Pose | None:
        """The pose with the back to a wall through `foot` (2,), None where the wall is not flat behind all of it."""
        yaw = float(np.degrees(np.arctan2(inward[0], -inward[1])))
        width, depth, height = extent.size
        out = WALL_GAP + AWAY + depth / 2
        pose = _on(floor, extent, foot + inward * out, yaw)
        if pose is None:
            return None
        aside, rise = (each.ravel() for each in np.meshgrid([-width / 2, 0.0, width / 2],
                                                            [STEP, height / 2, 0.95 * height]))
        along = foot + inward * out + aside[:, None] * np.array([-inward[1], inward[0]])
        starts = np.column_stack([along, pose[0][2] + rise])
        found = self.space.opaque_house.first_hit(starts, np.broadcast_to([*-inward, 0.0], starts.shape))[1]
        if not np.isfinite(found).all() or np.ptp(found) > UNEVEN or abs(found.min() - out) > UNEVEN:
            return None
        return _on(floor, extent, foot + inward * (2 * out - found.min()), yaw)

    def settled(self, extent: Box, pose: Pose) -> Pose:
        """On the floor next below the pose."""
        box = footprint(extent, *pose)
        heights = [height for floor in self.space.floors if (height := floor.stands_on(box)) is not None]
        below = [height for height in heights if height <= pose[0][2] + 6 * STEP]
        (x, y, z), yaw = pose
        return (x, y, max(below, default=z)), yaw

    def holds(self, box: Footprint) -> bool:
        """Whether a box stands on one storey's floor, with WALL_GAP of floor around it and nothing nearer than that."""
        floor = next((floor for floor in self.space.floors if (height := floor.stands_on(box)) is not None
                      and abs(height - box.bottom) <= STEP), None)
        return floor is not None and not floor.blocked(box) and self._has_floor(box)

    def _has_floor(self, box: Footprint) -> bool:
        """Whether there is floor, level give or take STEP, under a lattice over a footprint grown by WALL_GAP."""
        half = np.asarray(box.half) + WALL_GAP - 1e-4
        counts = np.minimum(np.ceil(2 * half / LATTICE).astype(int) + 1, MOST_ACROSS)
        x, y = np.meshgrid(*(np.linspace(-1, 1, count) for count in counts))
        points = np.asarray(box.centre) + (np.stack([x.ravel(), y.ravel()], axis=1) * half) @ box.axes
        above = np.column_stack([points, np.full(len(points), box.bottom + 4 * STEP)])
        down = self.space.ground.first_hit(above, np.tile([0.0, 0.0, -1.0], (len(above), 1)))[1]
        return bool((np.abs(down - 4 * STEP) <= STEP + 1e-4).all())

    def inside(self, point: np.ndarray, margin: float, centre: np.ndarray) -> bool:
        """See `MeshSpace.inside`."""
        return bool(self.space.inside(np.asarray(point)[None], margin, centre)[0])

    def depth(self, centre: np.ndarray, direction: np.ndarray, margin: float) -> float:
        """See `MeshSpace.depth`."""
        return self.space.depth(centre, direction, margin)

    def lets_in(self, light: LightPlan, near: np.ndarray) -> Reach:
        """Whether any path from beside the target leaves the scene, or sees the sun."""
        parallel = LIGHT_KINDS[light.kind].parallel
        found = _ways(self.space, tuple(map(float, near)), light.direction if parallel else None)
        how = "see it" if parallel else "lead out"
        return Reach(kept=found.found > 0, why=f"{found.found} of {found.paths} paths from beside the object, with at "
                     f"most {BOUNCES} bounces, {how}")

    def openings(self, opened: Sequence[str], near: np.ndarray) -> Openings:
        """See `opening_search`."""
        if there := [part for part in opened if part in self.parts]:
            verb = "is" if there == ["ceiling"] else "are"
            return Openings(portals=(), why=f"the {' and '.join(there)} {verb} removed")
        return _openings(self.space, tuple(map(float, near)))


@lru_cache(maxsize=256)
def _openings(space: MeshSpace, near: tuple[float, ...]) -> Openings:
    lines, others = (ways_out(space.everything, np.array(near), None, paths=LINES, seed=seed).leaving
                     for seed in (1, 2))
    return openings_of(space.hiding.building or space.hiding.contents, lines, others)


@lru_cache(maxsize=1024)
def _ways(space: MeshSpace, near: tuple[float, ...], direction: tuple[float, float, float] | None) -> WaysOut:
    return ways_out(space.everything, np.array(near), None if direction is None else -np.array(direction))


def _on(floor: FreeFloor, extent: Box, centre: np.ndarray, yaw: float) -> Pose | None:
    """A pose about `centre` (2,) on a storey; None where there is no floor."""
    height = floor.stands_on(footprint(extent, *standing(extent, centre, yaw)))
    return None if height is None else standing(extent, centre, yaw, height)


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
