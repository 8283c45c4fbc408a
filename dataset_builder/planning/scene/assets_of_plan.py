"""From plans to geometry and materials: the assets that a plan names, and where they stand. Rendering uses it too."""

from dataclasses import replace
from functools import lru_cache
from math import cos, radians, sin
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.procedural.furniture import FINISHES, make_furniture
from dataset_builder.assets.procedural.rooms import make_panes, make_room
from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.mesh import concatenate
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.scene.material_changes import changed
from dataset_builder.spec.mesh_source import companions, mesh_source

KEPT_ASSETS, KEPT_ROOMS = 128, 16
"""Kept in memory: those of a few scenes."""


@lru_cache(maxsize=KEPT_ASSETS)
def asset_of(plan: ObjectPlan, mesh_root: Path) -> Asset:
    """The asset that a plan names, its materials changed as planned; mesh files are found below `mesh_root`. Equal
    plans share one asset.

    Raises PlanError where a mesh file, or a file that it names, is not the one that was planned, and for changes of
    materials that it does not have.
    """
    asset = _plain_asset(plan, mesh_root)
    if not plan.materials:
        return asset
    roles = FINISHES.get(plan.source, ()) if plan.kind == "procedural" else ()
    return replace(asset, materials=changed(asset.materials, plan.materials, plan.name, roles))


def _plain_asset(plan: ObjectPlan, mesh_root: Path) -> Asset:
    """The asset as its family or file has it."""
    if plan.kind == "procedural":
        return make_furniture(family=plan.source, params={param.name: param.value for param in plan.params},
                              seed=int(plan.seed), name=plan.name)
    path = mesh_root / plan.source
    if (got := _content_digest(path)) != plan.source_sha256:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected content of SHA-256 {plan.source_sha256}, "
                                 f"got {got}", hint="the file, or one that it names, changed after planning; "
                                 "plan again")])
    return load_mesh_file(path, name=plan.name, category=plan.category, licence=plan.licence, scale=plan.scale,
                          up=plan.up)


def _content_digest(path: Path) -> str:
    """The digest of a mesh file and its companions as they are now, or what keeps it from being taken."""
    try:
        return mesh_source(path, companions(path)).digest
    except (OSError, ValueError) as error:
        return str(error)


def room_parts(plan: RoomPlan) -> dict[str, Asset]:
    """The parts of a room, `floor`, `walls` and, where it has one, `ceiling`, in the room's own frame, the world.

    The panes of glazed windows belong to the walls.
    """
    shell = room_shell(plan)
    return shell if not (plan.glazing and plan.windows) else shell | {"walls": _glazed_walls(plan)}


@lru_cache(maxsize=KEPT_ROOMS)
def _glazed_walls(plan: RoomPlan) -> Asset:
    walls = room_shell(plan)["walls"]
    panes = make_panes(width=plan.width, depth=plan.depth, height=plan.height, windows=plan.windows,
                       skirting=plan.skirting)
    mesh = concatenate([walls.mesh, panes.mesh], material_offsets=[0, len(walls.materials)])
    return replace(walls, mesh=mesh, materials=(*walls.materials, *panes.materials))


@lru_cache(maxsize=KEPT_ROOMS)
def room_shell(plan: RoomPlan) -> dict[str, Asset]:
    """The parts of a room without panes: what stands in light's way."""
    return make_room(width=plan.width, depth=plan.depth, height=plan.height, ceiling=plan.ceiling, windows=plan.windows,
                     skirting=plan.skirting, seed=int(plan.seed))


def world_from_object(placed: PlacedObject) -> np.ndarray:
    """(4, 4) rigid transform: turned by `yaw` degrees about +Z, then moved to `position`."""
    c, s = cos(radians(placed.yaw)), sin(radians(placed.yaw))
    matrix = np.eye(4)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:3, 3] = placed.position
    return matrix
