"""From plans to geometry and materials: the assets that a plan names, and where they stand. Rendering uses it too."""

from functools import lru_cache
from math import cos, radians, sin
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.procedural.furniture import make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError, Problem
from dataset_builder.planning.example_plan import ObjectPlan, PlacedObject, RoomPlan

KEPT_ASSETS, KEPT_ROOMS = 64, 8
"""Kept in memory: those of a few scenes."""


@lru_cache(maxsize=KEPT_ASSETS)
def asset_of(plan: ObjectPlan, mesh_root: Path) -> Asset:
    """The asset that a plan names; mesh files are found below `mesh_root`. Equal plans share one asset.

    Raises PlanError where a mesh file is not the one that was planned (its SHA-256 differs).
    """
    if plan.kind == "procedural":
        return make_furniture(family=plan.source, params={param.name: param.value for param in plan.params},
                              seed=int(plan.seed), name=plan.name)
    path = mesh_root / plan.source
    if (got := sha256_file(path)) != plan.source_sha256:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected SHA-256 {plan.source_sha256}, got {got}",
                                 hint="the file changed after planning; plan again")])
    return load_mesh_file(path, name=plan.name, category=plan.category, licence=plan.licence, scale=plan.scale,
                          up=plan.up)


@lru_cache(maxsize=KEPT_ROOMS)
def room_parts(plan: RoomPlan) -> dict[str, Asset]:
    """The parts of a room, `floor`, `walls` and, where it has one, `ceiling`, in the room's own frame, the world."""
    return make_room(width=plan.width, depth=plan.depth, height=plan.height, ceiling=plan.ceiling, windows=plan.windows,
                     skirting=plan.skirting, seed=int(plan.seed))


def world_from_object(placed: PlacedObject) -> np.ndarray:
    """(4, 4) rigid transform: turned by `yaw` degrees about +Z, then moved to `position`."""
    c, s = cos(radians(placed.yaw)), sin(radians(placed.yaw))
    matrix = np.eye(4)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:3, 3] = placed.position
    return matrix
