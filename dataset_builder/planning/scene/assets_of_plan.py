"""From plans to geometry and materials: the assets that a plan names, changed as asked, and where they stand.

Rendering uses it too.
"""

from dataclasses import replace
from functools import lru_cache, partial
from math import atan2, cos, degrees, radians, sin
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.mesh_file import load_mesh_file, stand
from dataset_builder.assets.procedural.furniture import FINISHES, make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.assets.scene_model import SceneThing
from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.mesh import transform
from dataset_builder.geometry.shape_faults import shape_faults
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.scene.material_changes import changed
from dataset_builder.planning.scene.recent import Recent, bytes_of
from dataset_builder.planning.scene.room_finishes import finished
from dataset_builder.planning.scene.scene_models import scene_model
from dataset_builder.spec.mesh_source import companions, mesh_source

KEPT_ASSETS, KEPT_BYTES, KEPT_ROOMS = 128, 1 << 30, 16
"""Kept in memory: those of a few scenes."""
ASSETS = Recent[Asset](KEPT_ASSETS, KEPT_BYTES, lambda asset: bytes_of([asset]))


def asset_of(plan: ObjectPlan, mesh_root: Path) -> Asset:
    """The asset that a plan names, its materials changed as planned; files are found below `mesh_root`. Equal plans
    share one asset.

    Raises PlanError where a mesh or scene file, or a file that it names, is not the one that was planned, and for
    changes of materials that it does not have.
    """
    return ASSETS.get((plan, mesh_root), lambda: _changed_asset(plan, mesh_root))


def _changed_asset(plan: ObjectPlan, mesh_root: Path) -> Asset:
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
    if plan.kind == "thing":
        return _thing_asset(plan, mesh_root)
    path = mesh_root / plan.source
    if (got := _content_digest(path)) != plan.source_sha256:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected content of SHA-256 {plan.source_sha256}, "
                                 f"got {got}", hint="the file, or one that it names, changed after planning; "
                                 "plan again")])
    return load_mesh_file(path, name=plan.name, category=plan.category, licence=plan.licence, scale=plan.scale,
                          up=plan.up)


def _thing_asset(plan: ObjectPlan, mesh_root: Path) -> Asset:
    """A thing of a scene file, standing on z = 0 as it stands in its scene but for its turn about +Z."""
    thing = thing_of(plan, mesh_root)
    matrix = np.eye(4)
    matrix[:3, :3] = np.reshape(plan.linear, (3, 3))
    mesh, moved, flat = stand(transform(thing.asset.mesh, matrix))
    meta = {**thing.asset.meta, "licence": plan.licence, "source": plan.source,
            "contains": f"{plan.thing} of {plan.source}, {len(mesh.faces):,} triangles",
            "moved": ", ".join(f"{step:.6g} m" for step in moved),
            "shape": "; ".join(filter(None, [thing.asset.meta.get("shape", ""), *shape_faults(mesh).notes, *flat]))}
    return replace(thing.asset, name=plan.name, category=plan.category, mesh=mesh, meta=meta)


def thing_of(plan: ObjectPlan, mesh_root: Path) -> SceneThing:
    """The thing of a scene file that an object of kind `thing` is."""
    return next(each for each in scene_model(plan.scene, mesh_root).things if each.name == plan.thing)


def _content_digest(path: Path) -> str:
    """The digest of a mesh file and its companions as they are now, or what keeps it from being taken."""
    try:
        return mesh_source(path, companions(path)).digest
    except (OSError, ValueError) as error:
        return str(error)


@lru_cache(maxsize=KEPT_ROOMS)
def room_shell(plan: RoomPlan, mesh_root: Path = Path()) -> dict[str, Asset]:
    """The parts of a room without panes: what stands in light's way. Textures of its own are found below `mesh_root`.

    Raises PlanError where one of them is not the one that was planned.
    """
    return make_room(width=plan.width, depth=plan.depth, height=plan.height, ceiling=plan.ceiling, windows=plan.windows,
                     skirting=plan.skirting, seed=int(plan.seed),
                     finish=partial(finished, plan, mesh_root) if plan.materials else None)


def world_from_object(placed: PlacedObject) -> np.ndarray:
    """(4, 4) rigid transform: turned by `yaw` degrees about +Z, then moved to `position`."""
    matrix = np.eye(4)
    matrix[:3, :3] = turned_up(placed.yaw)
    matrix[:3, 3] = placed.position
    return matrix


def turned_up(yaw: float) -> np.ndarray:
    """(3, 3) rotation by degrees about +Z."""
    c, s = cos(radians(yaw)), sin(radians(yaw))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def yaw_and_rest(world: np.ndarray) -> tuple[float, np.ndarray]:
    """The (3, 3) linear part of an affine map as a turn about +Z, in degrees, after the rest of it, (3, 3)."""
    yaw = degrees(atan2(world[1, 0], world[0, 0]))
    return yaw, turned_up(yaw).T @ world[:3, :3]
