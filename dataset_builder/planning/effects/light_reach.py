"""Which lights of a pass can reach the object: only those that contribute exactly nothing are left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.label.light_plan import IlluminationPlan, LightPlan
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.light_kinds import LIGHT_KINDS

WINDOW_SIDES = np.array([(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)])
"""(4, 3) outward normals of the walls, in the order in which they get windows."""


@dataclass(frozen=True, kw_only=True)
class Reach:
    """Whether one light is kept, and why."""

    kept: bool
    why: str


def reach(light: LightPlan, room: RoomPlan, opened: Sequence[str]) -> Reach:
    """Whether a light can bring anything to the inside of a room of which the parts `opened` are taken away."""
    if not any(light.radiance):
        return Reach(kept=False, why="sends nothing")
    if not LIGHT_KINDS[light.kind].outside:
        return Reach(kept=True, why="stands in the room")
    if opened:
        return Reach(kept=True, why=f"enters where the {' and '.join(opened)} {_verb(opened)} removed")
    if not room.ceiling:
        return Reach(kept=True, why="enters where there is no ceiling")
    if not room.windows:
        return Reach(kept=False, why="cannot enter a room with a ceiling and no windows")
    return _through_windows(light, room)


def _verb(parts: Sequence[str]) -> str:
    return "are" if len(parts) > 1 or parts[0].endswith("s") else "is"


def _through_windows(light: LightPlan, room: RoomPlan) -> Reach:
    """A dome comes in through all windows, a sun through those in walls that it shines at from outside."""
    sides = WINDOW_SIDES[:room.windows]
    open_to = len(sides) if LIGHT_KINDS[light.kind].all_round else int((sides @ np.asarray(light.direction) < 0).sum())
    panes = "glazed " if room.glazing else ""
    if not open_to:
        return Reach(kept=False, why=f"does not shine on a wall with one of the {len(sides)} {panes}windows")
    return Reach(kept=True, why=f"enters through {open_to} {panes}window{'s' if open_to > 1 else ''}")


def reaching(illumination: IlluminationPlan, room: RoomPlan) -> tuple[Reach, ...]:
    """For each light of a pass whether it can reach the inside of the room."""
    return tuple(reach(light, room, illumination.open) for light in illumination.lights)


def said(lights: Sequence[LightPlan], found: Sequence[Reach]) -> str:
    """The reasons in one line; lights of one kind and one fate are counted together."""
    groups: dict[tuple[str, Reach], int] = {}
    for light, each in zip(lights, found, strict=True):
        groups[light.kind, each] = groups.get((light.kind, each), 0) + 1
    return "; ".join(f"{f'{count} of kind {kind}' if count > 1 else kind}{'' if each.kept else ' left out'}: {each.why}"
                     for (kind, each), count in groups.items())
