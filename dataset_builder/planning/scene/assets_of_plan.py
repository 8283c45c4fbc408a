"""From plans to geometry and materials: the assets that a plan names, changed as asked, and where they stand.

Rendering uses it too.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import lru_cache
from math import atan2, cos, degrees, radians, sin
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Asset, Material, reflectance_at
from dataset_builder.assets.mesh_file import load_mesh_file, stand
from dataset_builder.assets.procedural.furniture import FINISHES, make_furniture
from dataset_builder.assets.procedural.rooms import make_room
from dataset_builder.assets.scene_model import SceneThing
from dataset_builder.errors import PlanError, Problem
from dataset_builder.geometry.mesh import transform
from dataset_builder.geometry.shape_faults import shape_faults
from dataset_builder.label.scene_plan import MaterialChange, ObjectPlan, Param, PlacedObject, RoomPlan
from dataset_builder.planning.scene.recent import Recent, bytes_of
from dataset_builder.planning.scene.scene_models import scene_model
from dataset_builder.seeding import rng
from dataset_builder.spec.mesh_source import companions, mesh_source
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.problems import nearest, shown
from dataset_builder.spec.scene import MAX_SPECULAR, MaterialSpec

ROLE = ": "
"""Between what a material of embedded furniture is there for and what it happens to be: `top: oak`."""
TRUTHS = ("thin", "plain")
KEPT_ASSETS, KEPT_BYTES, KEPT_ROOMS = 128, 1 << 30, 16
"""Kept in memory: those of a few scenes."""
ASSETS = Recent[Asset](KEPT_ASSETS, KEPT_BYTES, lambda asset: bytes_of([asset]))


def drawn_changes(spec: Mapping[str, MaterialSpec], seed: int, path: tuple[str | int, ...]) \
        -> tuple[MaterialChange, ...]:
    """Draw the changes to an object's materials, each number from a path of its own below `path`.

    An index of refraction without `specular` brings the reflectance that belongs to it, ((n - 1) / (n + 1))^2.
    """
    return tuple(MaterialChange(name=name, values=_values(change, seed, (*path, name)))
                 for name, change in spec.items())


def _values(change: MaterialSpec, seed: int, path: tuple[str | int, ...]) -> tuple[Param, ...]:
    values: dict[str, float] = {}
    for field in MaterialSpec.model_fields:
        value = getattr(change, field)
        if isinstance(value, tuple):
            values |= {f"{field}.{k}": draw(each, rng(seed, *path, field, k)) for k, each in enumerate(value)}
        elif isinstance(value, bool):
            values |= {field: float(value)} if value or field != "plain" else {}
        elif value is not None:
            values[field] = draw(value, rng(seed, *path, field))
    if "ior" in values and "specular" not in values:
        values["specular"] = min(reflectance_at(values["ior"]), MAX_SPECULAR)
    return tuple(Param(name=name, value=value) for name, value in values.items())


def matches(name: str, material: str) -> bool:
    """Whether a change called `name` means a material: by its name, by its role, or as a pattern with * and ?."""
    return name in (material, material.partition(ROLE)[0]) or fnmatchcase(material, name)


def changed(materials: Sequence[Material], changes: Sequence[MaterialChange], where: str,
            roles: Sequence[str] = ()) -> tuple[Material, ...]:
    """The materials with all changes that mean them, in order.

    roles: what the asset's family may have besides, so that a change of it is no mistake where a draw goes without.
    Raises PlanError for changes that mean no material, with the names that there are.
    """
    known = [material.name for material in materials]
    lost = [change.name for change in changes if not any(matches(change.name, name) for name in known)
            and not (roles and _may_mean(change.name, roles))]
    _refuse(lost, [*roles, *known], where)
    return tuple(_applied(material, [change for change in changes if matches(change.name, material.name)])
                 for material in materials)


def require_roles(names: Iterable[str], roles: Sequence[str], where: str) -> None:
    """Raise PlanError for changes that no draw of a family with the materials `roles` could mean."""
    _refuse([name for name in names if not _may_mean(name, roles)], roles, where)


def _refuse(lost: Sequence[str], known: Sequence[str], where: str) -> None:
    if lost:
        raise PlanError(Problem(where=where, path=f"materials.{name}", hint=nearest(name, list(dict.fromkeys(known))),
                                rule=f"expected the name of one of the object's materials, got {shown(name)}")
                        for name in lost)


def _may_mean(name: str, roles: Sequence[str]) -> bool:
    """Whether another draw of a family may have what a change means; what a finish is drawn as varies."""
    return name.partition(ROLE)[0] in roles or any(character in name for character in "*?[")


def _applied(material: Material, changes: Sequence[MaterialChange]) -> Material:
    for change in changes:
        values = {param.name: param.value for param in change.values}
        fields: dict[str, Any] = {name: value for name, value in values.items() if "." not in name and name != "plain"}
        fields |= {name: bool(fields[name]) for name in TRUTHS if name in fields}
        for name in {key.partition(".")[0] for key in values if "." in key}:
            fields[name] = tuple(values[f"{name}.{k}"] for k in range(3))
        if values.get("plain"):
            fields["texture"] = None
        material = replace(material, **fields)
    return material


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
def room_shell(plan: RoomPlan) -> dict[str, Asset]:
    """The parts of a room without panes: what stands in light's way."""
    return make_room(width=plan.width, depth=plan.depth, height=plan.height, ceiling=plan.ceiling, windows=plan.windows,
                     skirting=plan.skirting, seed=int(plan.seed))


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
