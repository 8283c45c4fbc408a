"""What is around in a planned scene before the spec's objects come: the parts of a room, or the things of a file."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from dataset_builder.assets.asset import Asset, see_through
from dataset_builder.assets.procedural.rooms import make_panes
from dataset_builder.label.scene_plan import RoomPlan
from dataset_builder.planning.scene.assets_of_plan import KEPT_ROOMS, room_shell
from dataset_builder.planning.scene.scene_models import scene_model

ROOM_INSTANCE = 2
"""Value in the `instance` layer of the building."""
PartOf = Literal["furniture", "floor", "walls", "ceiling"]


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomPart:
    """One asset that is around, and where it is."""

    name: str
    """As reasons name it."""
    part: PartOf
    """What of the building it belongs to; `furniture` is none of it."""
    asset: Asset
    instance: int
    """Value in the `instance` layer."""
    world: np.ndarray = field(default_factory=lambda: np.eye(4))
    """(4, 4) affine world_from_asset; a mirror turns the winding of faces."""

    @property
    def positions(self) -> np.ndarray:
        """(V, 3) its vertices in the world."""
        return self.asset.mesh.positions @ self.world[:3, :3].T + self.world[:3, 3]

    @property
    def faces(self) -> np.ndarray:
        """(F, 3) its faces, counter-clockwise seen from outside in the world."""
        faces = self.asset.mesh.faces
        return faces[:, [0, 2, 1]] if np.linalg.det(self.world[:3, :3]) < 0 else faces

    @property
    def clear(self) -> np.ndarray:
        """(F,) which of its faces let light through, straight or bent; planning looks through them."""
        return see_through(self.asset)


def room_parts(plan: RoomPlan, mesh_root: Path) -> tuple[RoomPart, ...]:
    """The floor, walls, panes and ceiling of a room in code, or all that is there of a scene file, in its order.

    Raises UserError where the scene file cannot be read, PlanError where it is not the one that was planned.
    """
    return _things(plan, mesh_root) if plan.kind != "procedural" else _procedural(plan, mesh_root)


def _procedural(plan: RoomPlan, mesh_root: Path) -> tuple[RoomPart, ...]:
    shell = room_shell(plan, mesh_root)
    parts = [RoomPart(name=name, part=name, asset=shell[name], instance=ROOM_INSTANCE)
             for name in ("floor", "walls", "ceiling") if name in shell]
    if plan.glazing and plan.windows:
        # Right after the walls, as one of which they count
        parts.insert(2, RoomPart(name="walls", part="walls", asset=_panes(plan), instance=ROOM_INSTANCE))
    return tuple(parts)


@lru_cache(maxsize=KEPT_ROOMS)
def _panes(plan: RoomPlan) -> Asset:
    return make_panes(width=plan.width, depth=plan.depth, height=plan.height, windows=plan.windows,
                      skirting=plan.skirting)


def _things(plan: RoomPlan, mesh_root: Path) -> tuple[RoomPart, ...]:
    instances, hidden = {thing.name: thing.instance for thing in plan.scene.things}, set(plan.scene.hidden)
    return tuple(RoomPart(name=thing.name, part="furniture" if thing.role == "object" else thing.role,
                          asset=thing.asset, instance=instances.get(thing.name, ROOM_INSTANCE), world=thing.world)
                 for thing in scene_model(plan, mesh_root).things if thing.name not in hidden)
