"""Layout of a room: the target first, then furniture beside it, along walls and on the floor, without overlaps.

Pieces are oriented rectangles with a height interval.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.planning.scene.footprints import Box, Footprint, Pose, footprint, overlap, standing
from dataset_builder.planning.scene.shell import Shell

Place = Literal["near", "wall", "floor"]

PIECE_GAP = 0.03
NEAR_GAP = (0.1, 0.8)
FRONT_FREE = 1.0
"""Metres in front of the target that stay empty where the room allows it."""
ATTEMPTS = 80
NEAR_SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0))
"""Sides of the target, in its own frame, that near pieces may take: right, left and back, never its front."""


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
    """Poses (position, yaw in degrees) of all that was placed in a scene."""

    target: Pose
    furniture: tuple[Pose | None, ...]
    """None for a piece that did not fit."""
    notes: tuple[str, ...]


def _beside(extent: Box, target: Footprint, rng: np.random.Generator) -> Pose:
    """Beside the target, square to it give or take ten degrees, at a gap within NEAR_GAP."""
    outward = np.array(NEAR_SIDES[rng.integers(len(NEAR_SIDES))]) @ target.axes
    along = np.array([-outward[1], outward[0]])
    yaw = target.yaw + 90.0 * float(rng.integers(4)) + float(rng.uniform(-10, 10))
    box = footprint(extent, (0.0, 0.0, 0.0), yaw)
    away = target.reach(outward) + rng.uniform(*NEAR_GAP) + box.reach(outward)
    shift = rng.uniform(-1, 1) * target.reach(along)
    return standing(extent, np.asarray(target.centre) + outward * away + along * shift, (yaw + 180) % 360 - 180,
                    target.bottom)


def front_zone(target: Footprint) -> Footprint:
    """The rectangle in front of the target that is kept free, as wide as the target."""
    middle = np.asarray(target.centre) - target.axes[1] * (target.half[1] + FRONT_FREE / 2)
    return Footprint(centre=(float(middle[0]), float(middle[1])), half=(target.half[0], FRONT_FREE / 2),
                     yaw=target.yaw, bottom=target.bottom, top=max(target.top, target.bottom + 1.0))


def _drawn(piece: Piece, shell: Shell, rng: np.random.Generator) -> Pose | None:
    return (shell.at_wall if piece.place == "wall" else shell.on_floor)(piece.extent, rng)


def place_target(piece: Piece, shell: Shell, space: float = 0.0) -> Pose:
    """Pose of the target, `near` meaning `floor`, with `space` metres of floor on all its sides. Its front is kept from
    the walls in the first half of the redraws.

    Raises PlanError, with both sizes, where the target does not fit, and where the scene has no floor.
    """
    rng = piece.rng()
    for attempt in range(ATTEMPTS):
        pose = _drawn(piece, shell, rng)
        if pose is None:
            continue
        box = footprint(piece.extent, *pose)
        free = attempt >= ATTEMPTS // 2 or shell.holds(front_zone(box))
        if free and shell.holds(box.grown(space)):
            return pose
    size = " x ".join(f"{length:.2f}" for length in piece.extent.size)
    about = f" with {space:g} m of free floor about it" if space else ""
    rule = (f"expected the target to fit in the {shell.noun}, got an object of {size} m{about} in {shell.said} "
            f"({ATTEMPTS} positions drawn)")
    raise PlanError([Problem(where="", path=f"{piece.name} in {shell.name}", rule=rule,
                             hint=shell.larger + ", or lower `space` of the scene" * bool(space))])


def _fits(box: Footprint, others: Sequence[Footprint], shell: Shell) -> bool:
    return shell.holds(box) and not any(overlap(box, other, PIECE_GAP) for other in others)


def _place_piece(piece: Piece, target: Footprint, others: Sequence[Footprint], shell: Shell) -> Pose | None:
    rng, front = piece.rng(), front_zone(target)
    for attempt in range(ATTEMPTS):
        if piece.place == "near":
            pose: Pose | None = shell.settled(piece.extent, _beside(piece.extent, target, rng))
        else:
            pose = _drawn(piece, shell, rng)
        if pose is None:
            continue
        box = footprint(piece.extent, *pose)
        if _fits(box, others, shell) and (attempt >= ATTEMPTS // 2 or not overlap(box, front)):
            return pose
    return None


def lay_out(target: Piece, furniture: Sequence[Piece], shell: Shell, space: float = 0.0) -> Layout:
    """Place the target with `space` metres of floor about it, then furniture as `furnish` does.

    Raises PlanError where the target itself does not fit, and where something needs a floor and there is none.
    """
    pose = place_target(target, shell, space)
    poses, notes = furnish(footprint(target.extent, *pose), furniture, shell, space)
    return Layout(target=pose, furniture=poses, notes=notes)


def furnish(target: Footprint, furniture: Sequence[Piece], shell: Shell, space: float = 0.0) \
        -> tuple[tuple[Pose | None, ...], tuple[str, ...]]:
    """Poses of furniture about a target that stands, None for what did not fit, and notes that tell of that: first what
    goes near it, then along walls, then on the floor; none within `space` metres of it. Raises PlanError where the
    scene has no floor."""
    boxes, poses, notes = [target.grown(space)], dict[int, Pose](), list[str]()
    order = sorted(range(len(furniture)), key=lambda k: ("near", "wall", "floor").index(furniture[k].place))
    for k in order:
        piece = furniture[k]
        found = _place_piece(piece, target, boxes, shell)
        if found is None:
            notes.append(f"left out {piece.name}: no free place ({piece.place}) in {ATTEMPTS} draws")
            continue
        poses[k] = found
        boxes.append(footprint(piece.extent, *found))
    return tuple(poses.get(k) for k in range(len(furniture))), tuple(notes)
