"""The arrangement of one pair: assets made and laid out in a room, and the rays that planning casts at them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan, Vector
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.assets_of_plan import asset_of, room_shell, world_from_object
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents
from dataset_builder.planning.scene.footprints import Box, Pose
from dataset_builder.planning.scene.layout import Piece, Place, lay_out
from dataset_builder.planning.scene.mesh_shell import shell_of
from dataset_builder.planning.scene.object_size import advice_on
from dataset_builder.planning.scene.shell import Geometry, Shell, box_of
from dataset_builder.seeding import rng

TARGET_INSTANCE = 1
ROOM_INSTANCE = 2
FURNITURE_INSTANCE = 3
"""Value in the `instance` layer of the first piece of furniture."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrangement:
    """Everything of a pair that cameras and lights are planned against."""

    room: RoomPlan
    target: PlacedObject
    furniture: tuple[PlacedObject, ...]
    geometry: tuple[Geometry, ...]
    shell: Shell
    """The space that all of it stands in."""
    notes: tuple[str, ...] = ()
    """What layout had to leave out, and objects of unusual size."""

    @cached_property
    def everything(self) -> RayScene:
        """Target, room and furniture."""
        return RayScene(list(self.geometry))

    @cached_property
    def alone(self) -> RayScene:
        """The target without anything else."""
        return RayScene([part for part in self.geometry if part[2] == TARGET_INSTANCE])

    @cached_property
    def _target_box(self) -> np.ndarray:
        own = [part for part in self.geometry if part[2] == TARGET_INSTANCE]
        corners = np.concatenate([positions[np.unique(faces)] for positions, faces, _ in own])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def centre(self) -> np.ndarray:
        """(3,) middle of the target's box."""
        return self._target_box.mean(axis=0)

    @property
    def radius(self) -> float:
        """Half the diagonal of the target's box."""
        return float(np.linalg.norm(np.diff(self._target_box, axis=0)) / 2)

    @cached_property
    def _bounds(self) -> list[np.ndarray]:
        return [corner for part in self.geometry if len(part[1]) for corner in box_of(part)]

    def diagonal(self, camera: Vector) -> float:
        """Longest way through the air of a view from `camera`, metres."""
        return self.shell.diagonal(np.array([*self._bounds, camera]))


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
    shell, building = shell_of(scene.room, (), ()), _room_geometry(scene)
    layout = lay_out(target, pieces, shell)
    standing = [(piece.object, pose) for piece, pose in zip(scene.furniture, layout.furniture, strict=True) if pose]
    furniture = tuple(_placed(plan, pose, FURNITURE_INSTANCE + k) for k, (plan, pose) in enumerate(standing))
    placed = _placed(target_plan, layout.target, TARGET_INSTANCE)
    geometry = [geometry_of(thing, mesh_root) for thing in (placed, *furniture)] + building
    return Arrangement(room=scene.room, target=placed, furniture=furniture, geometry=tuple(geometry),
                       shell=shell, notes=(*layout.notes, *_odd_sizes((placed, *furniture), mesh_root)))


def _odd_sizes(things: Iterable[PlacedObject], mesh_root: Path) -> list[str]:
    """One sentence for each object whose size is unusual."""
    found = {thing.object.name: advice_on(thing.object, mesh_root) for thing in things}
    return [f"unusual size of {name}: {advice.rule}" for name, advice in found.items() if advice]
