"""Layout of a room: the target first, then furniture beside it, along walls and on the floor, without overlaps.

Pieces are oriented rectangles with a height interval.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Literal

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import RoomPlan

Place = Literal["near", "wall", "floor"]
Pose = tuple[tuple[float, float, float], float]

WALL_GAP = 0.05
"""Metres between furniture and walls: more than a skirting board is thick."""
PIECE_GAP = 0.03
NEAR_GAP = (0.1, 0.8)
FRONT_FREE = 1.0
"""Metres in front of the target that stay empty where the room allows it."""
ATTEMPTS = 80
NEAR_SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
"""Sides of the target, in its own frame, that near pieces may take: right, left and back, never its front."""
WALLS = ((0.0, 1.0, 0.0), (-1.0, 0.0, 90.0), (1.0, 0.0, -90.0), (0.0, -1.0, 180.0))
"""Outward x and y of a wall, and the yaw of furniture whose back is to it."""


@dataclass(frozen=True, kw_only=True)
class Box:
    """Axis-aligned box of an asset in its own frame, in metres."""

    low: tuple[float, float, float]
    """Low corner (x, y, z)."""
    high: tuple[float, float, float]
    """High corner (x, y, z)."""

    @property
    def size(self) -> tuple[float, float, float]:
        """Width (x), depth (y) and height (z)."""
        width, depth, height = (b - a for a, b in zip(self.low, self.high, strict=True))
        return width, depth, height


@dataclass(frozen=True, kw_only=True)
class Footprint:
    """A box turned about Z, in metres."""

    centre: tuple[float, float]
    """Its x and y."""
    half: tuple[float, float]
    """Half sizes along its own axes."""
    yaw: float
    """Degrees about Z."""
    bottom: float = 0.0
    top: float = 1.0

    @property
    def axes(self) -> np.ndarray:
        """(2, 2) rows are the rectangle's own x and y axes in the room."""
        c, s = cos(radians(self.yaw)), sin(radians(self.yaw))
        return np.array([[c, s], [-s, c]])

    def reach(self, direction: np.ndarray) -> float:
        """Half the rectangle's width along a unit `direction` (2,): its support function about the centre."""
        return float(np.abs(self.axes @ direction) @ np.asarray(self.half))

    def corners(self) -> np.ndarray:
        """(4, 2) corners, counter-clockwise."""
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return np.asarray(self.centre) + (signs * np.asarray(self.half)) @ self.axes


def footprint(extent: Box, position: tuple[float, float, float], yaw: float) -> Footprint:
    """The footprint of an asset that stands with its base point at `position`, turned by `yaw` degrees."""
    half = (extent.size[0] / 2, extent.size[1] / 2)
    middle = np.array([extent.low[0] + half[0], extent.low[1] + half[1]])
    turned = Footprint(centre=(0.0, 0.0), half=half, yaw=yaw)
    x, y = np.asarray(position[:2]) + middle @ turned.axes
    return Footprint(centre=(float(x), float(y)), half=half, yaw=yaw, bottom=position[2] + extent.low[2],
                     top=position[2] + extent.high[2])


def overlap(a: Footprint, b: Footprint, gap: float = 0.0) -> bool:
    """Whether two boxes come nearer than `gap` along every separating axis (Gottschalk et al. 1996) and in height."""
    if a.bottom >= b.top or b.bottom >= a.top:
        return False
    between = np.asarray(b.centre) - np.asarray(a.centre)
    return all(abs(between @ axis) < a.reach(axis) + b.reach(axis) + gap for axis in (*a.axes, *b.axes))


def inside_room(box: Footprint, width: float, depth: float, height: float, gap: float = 0.0) -> bool:
    """Whether a box keeps `gap` metres from the four walls of a room about the origin, and is under its ceiling."""
    reach = np.array([box.reach(np.array([1.0, 0.0])), box.reach(np.array([0.0, 1.0]))])
    room = np.array([width, depth]) / 2 - gap
    return bool((np.abs(box.centre) + reach <= room).all()) and box.top <= height


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Something to place."""

    name: str
    extent: Box
    place: Place
    rng: Callable[[], np.random.Generator]
    """Makes its own generator, so that no other piece moves its draws."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Poses (position, yaw in degrees) of all that stands in a room."""

    target: Pose
    furniture: tuple[Pose | None, ...]
    """None for a piece that did not fit."""
    notes: tuple[str, ...]


def _standing(extent: Box, centre: np.ndarray, yaw: float) -> Pose:
    """The pose that brings the middle of an asset's footprint to `centre` (2,)."""
    offset = np.asarray(footprint(extent, (0.0, 0.0, 0.0), yaw).centre)
    return (float(centre[0] - offset[0]), float(centre[1] - offset[1]), 0.0), yaw


def _on_floor(extent: Box, room: RoomPlan, rng: np.random.Generator) -> Pose:
    yaw = float(rng.uniform(-180, 180))
    box = footprint(extent, (0.0, 0.0, 0.0), yaw)
    reach = np.array([box.reach(np.array([1.0, 0.0])), box.reach(np.array([0.0, 1.0]))])
    free = np.maximum(np.array([room.width, room.depth]) / 2 - WALL_GAP - reach, 0.0)
    return _standing(extent, rng.uniform(-1, 1, 2) * free, yaw)


def _at_wall(extent: Box, room: RoomPlan, rng: np.random.Generator) -> Pose:
    x, y, yaw = WALLS[rng.integers(len(WALLS))]
    outward, along = np.array([x, y]), np.array([-y, x])
    room_half = np.array([room.width, room.depth]) / 2
    box = footprint(extent, (0.0, 0.0, 0.0), yaw)
    back = np.abs(outward) @ room_half - WALL_GAP - 1e-9 - box.reach(outward)
    free = max(np.abs(along) @ room_half - WALL_GAP - box.reach(along), 0.0)
    return _standing(extent, outward * back + along * rng.uniform(-1, 1) * free, yaw)


def _beside(extent: Box, target: Footprint, rng: np.random.Generator) -> Pose:
    """Beside the target, square to it give or take ten degrees, at a gap within NEAR_GAP."""
    outward = np.array(NEAR_SIDES[rng.integers(len(NEAR_SIDES))]) @ target.axes
    along = np.array([-outward[1], outward[0]])
    yaw = target.yaw + 90.0 * float(rng.integers(4)) + float(rng.uniform(-10, 10))
    box = footprint(extent, (0.0, 0.0, 0.0), yaw)
    away = target.reach(outward) + rng.uniform(*NEAR_GAP) + box.reach(outward)
    shift = rng.uniform(-1, 1) * target.reach(along)
    return _standing(extent, np.asarray(target.centre) + outward * away + along * shift, (yaw + 180) % 360 - 180)


def front_zone(target: Footprint) -> Footprint:
    """The rectangle in front of the target that is kept free, as wide as the target."""
    middle = np.asarray(target.centre) - target.axes[1] * (target.half[1] + FRONT_FREE / 2)
    return Footprint(centre=(float(middle[0]), float(middle[1])), half=(target.half[0], FRONT_FREE / 2),
                     yaw=target.yaw, bottom=0.0, top=max(target.top, 1.0))


def _in_room(box: Footprint, room: RoomPlan) -> bool:
    return inside_room(box, room.width, room.depth, room.height, WALL_GAP)


def place_target(piece: Piece, room: RoomPlan) -> Pose:
    """Pose of the target, `near` meaning `floor`. Its front is kept from the walls in the first half of the redraws.

    Raises PlanError, with both sizes, where the target does not fit.
    """
    rng = piece.rng()
    for attempt in range(ATTEMPTS):
        pose = (_at_wall if piece.place == "wall" else _on_floor)(piece.extent, room, rng)
        box = footprint(piece.extent, *pose)
        free = attempt >= ATTEMPTS // 2 or _in_room(front_zone(box), room)
        if free and _in_room(box, room):
            return pose
    size = " x ".join(f"{length:.2f}" for length in piece.extent.size)
    rule = (f"expected the target to fit in the room, got an object of {size} m in a room of {room.width:.2f} x "
            f"{room.depth:.2f} x {room.height:.2f} m ({ATTEMPTS} positions drawn)")
    raise PlanError([Problem(where="", path=f"{piece.name} in {room.name}", rule=rule,
                             hint="make the room larger or the object smaller; `scale` says how large a mesh file is")])


def _fits(box: Footprint, others: Sequence[Footprint], room: RoomPlan) -> bool:
    return _in_room(box, room) and not any(overlap(box, other, PIECE_GAP) for other in others)


def _place_piece(piece: Piece, target: Footprint, others: Sequence[Footprint], room: RoomPlan) -> Pose | None:
    rng, front = piece.rng(), front_zone(target)
    for attempt in range(ATTEMPTS):
        if piece.place == "near":
            pose = _beside(piece.extent, target, rng)
        else:
            pose = (_at_wall if piece.place == "wall" else _on_floor)(piece.extent, room, rng)
        box = footprint(piece.extent, *pose)
        if _fits(box, others, room) and (attempt >= ATTEMPTS // 2 or not overlap(box, front)):
            return pose
    return None


def lay_out(target: Piece, furniture: Sequence[Piece], room: RoomPlan) -> Layout:
    """Place the target, then what goes near it, then along walls, then on the floor; notes tell what did not fit.

    Raises PlanError where the target itself does not fit.
    """
    pose = place_target(target, room)
    standing = footprint(target.extent, *pose)
    boxes, poses, notes = [standing], dict[int, Pose](), list[str]()
    order = sorted(range(len(furniture)), key=lambda k: ("near", "wall", "floor").index(furniture[k].place))
    for k in order:
        piece = furniture[k]
        found = _place_piece(piece, standing, boxes, room)
        if found is None:
            notes.append(f"left out {piece.name}: no free place ({piece.place}) in {ATTEMPTS} draws")
            continue
        poses[k] = found
        boxes.append(footprint(piece.extent, *found))
    return Layout(target=pose, furniture=tuple(poses.get(k) for k in range(len(furniture))), notes=tuple(notes))
