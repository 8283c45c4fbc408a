"""Arranges a pair: makes its assets, lays them out, and turns them into world geometry."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.arrangement import (
    FURNITURE_INSTANCE,
    ROOM_INSTANCE,
    TARGET_INSTANCE,
    Arrangement,
    Geometry,
)
from dataset_builder.planning.scene.assets_of_plan import asset_of, room_shell, world_from_object
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents
from dataset_builder.planning.scene.footprint import Box
from dataset_builder.planning.scene.layout import Piece, Place, Pose, lay_out
from dataset_builder.seeding import rng


def extent_of(asset: Asset) -> Box:
    """The box of an asset in its own frame."""
    low, high = asset.mesh.bounds.tolist()
    return Box(low=tuple(low), high=tuple(high))


def _piece(plan: ObjectPlan, place: Place, mesh_root: Path, draws: Callable[[], np.random.Generator]) -> Piece:
    return Piece(name=plan.name, extent=extent_of(asset_of(plan, mesh_root)), place=place, rng=draws)


def _placed(plan: ObjectPlan, pose: Pose, instance: int) -> PlacedObject:
    return PlacedObject(object=plan, instance=instance, position=pose[0], yaw=pose[1])


def geometry_of(placed: PlacedObject, mesh_root: Path) -> Geometry:
    """A placed object's vertices in the world, its faces and its instance."""
    mesh, matrix = asset_of(placed.object, mesh_root).mesh, world_from_object(placed)
    return mesh.positions @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces, placed.instance


def _room_geometry(scene: ScenePlan) -> list[Geometry]:
    """The room without panes, which let light and sight through."""
    return [(part.mesh.positions, part.mesh.faces, ROOM_INSTANCE) for part in room_shell(scene.room).values()]


def arrange(pair: PairRef, split: SplitContents, seed: int, mesh_root: Path) -> Arrangement:
    """Room, target and furniture of a pair, laid out; furniture that does not fit is left out with a note.

    Raises PlanError where the target does not fit.
    """
    scene, target_plan = split.scenes[pair.scene], split.objects[pair.object]
    target = _piece(target_plan, scene.target, mesh_root, partial(rng, seed, *pair.path, "target", "position"))
    pieces = [_piece(piece.object, piece.place, mesh_root,
                     partial(rng, seed, *pair.path, "furniture", *piece.number, "position"))
              for piece in scene.furniture]
    layout = lay_out(target, pieces, scene.room)
    standing = [(piece.object, pose) for piece, pose in zip(scene.furniture, layout.furniture, strict=True) if pose]
    furniture = tuple(_placed(plan, pose, FURNITURE_INSTANCE + k) for k, (plan, pose) in enumerate(standing))
    placed = _placed(target_plan, layout.target, TARGET_INSTANCE)
    geometry = [geometry_of(thing, mesh_root) for thing in (placed, *furniture)] + _room_geometry(scene)
    return Arrangement(room=scene.room, target=placed, furniture=furniture, geometry=tuple(geometry),
                       notes=layout.notes)
