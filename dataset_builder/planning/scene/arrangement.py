"""The arrangement of one pair: assets made and laid out in a room, and the rays that planning casts at them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.scene_plan import ObjectPlan, PlacedObject, RoomPlan
from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.planning.scene.contents import SplitContents
from dataset_builder.planning.scene.footprints import Pose, footprint
from dataset_builder.planning.scene.layout import Piece, Place, furnish, lay_out
from dataset_builder.planning.scene.mesh_shell import shell_of
from dataset_builder.planning.scene.object_size import advice_on
from dataset_builder.planning.scene.room_parts import RoomPart, room_parts
from dataset_builder.planning.scene.shell import PARTS, Geometry, Shell
from dataset_builder.planning.scene.stage import FURNITURE_INSTANCE, TARGET_INSTANCE, extent_of, stage
from dataset_builder.planning.scene.sweep import Sweep, swept_box
from dataset_builder.seeding import rng
from dataset_builder.spec.camera_path import TurntableSpec
from dataset_builder.spec.resolve import LoadedSpec

__all__ = ["TARGET_INSTANCE", "Arrangement", "arrange", "extent_of", "geometry_of"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrangement:
    """Everything of a pair that cameras and lights are planned against."""

    room: RoomPlan
    target: PlacedObject
    furniture: tuple[PlacedObject, ...]
    geometry: tuple[Geometry, ...]
    """What hides what is behind it: of a scene from a file without see-through faces, but for the target's."""
    shell: Shell
    """The space that all of it stands in."""
    clear: tuple[Geometry, ...] = ()
    """The see-through faces of a scene from a file."""
    notes: tuple[str, ...] = ()
    """What layout had to leave out, and objects of unusual size."""
    sweep: Sweep | None = None
    """What the target sweeps where it turns from view to view; None where it stands."""
    turn: float = 0.0
    """Degrees that it is turned from how it was placed."""

    def turned(self, angle: float, mesh_root: Path) -> "Arrangement":
        """The same with the target turned by degrees in its sweep, where it has one."""
        if self.sweep is None or not angle:
            return self
        placed = self.sweep.turned(self.target, angle)
        geometry = (geometry_of(placed, mesh_root), *(part for part in self.geometry if part[2] != TARGET_INSTANCE))
        return replace(self, target=placed, geometry=geometry, turn=self.turn + angle)

    def sweeps(self, point: np.ndarray, margin: float) -> bool:
        """Whether the target comes nearer than `margin` metres to a point (3,) at some angle of its sweep."""
        return self.sweep is not None and self.sweep.holds(point, margin)

    @cached_property
    def everything(self) -> RayScene:
        """Target, room and furniture, as far as they hide what is behind them."""
        return RayScene(list(self.geometry))

    @cached_property
    def surfaces(self) -> RayScene:
        """Everything with what is see-through: what cameras and lamps keep away from."""
        return RayScene([*self.geometry, *self.clear]) if self.clear else self.everything

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
        """(3,) middle of the target's box; of one that turns, the same at every turn."""
        middle = self._target_box.mean(axis=0)
        return middle if self.sweep is None else np.array([*self.sweep.axis, middle[2]])

    @property
    def front(self) -> float:
        """Yaw of the target as it was placed, degrees: what azimuths about it count from."""
        return self.target.yaw - self.turn

    @property
    def radius(self) -> float:
        """Half the diagonal of the target's box."""
        return float(np.linalg.norm(np.diff(self._target_box, axis=0)) / 2)


def _piece(plan: ObjectPlan, place: Place, mesh_root: Path, draws: Callable[[], np.random.Generator]) -> Piece:
    return Piece(name=plan.name, extent=extent_of(asset_of(plan, mesh_root)), place=place, rng=draws)


def _placed(plan: ObjectPlan, pose: Pose, instance: int) -> PlacedObject:
    return PlacedObject(object=plan, instance=instance, position=pose[0], yaw=pose[1])


def geometry_of(placed: PlacedObject, mesh_root: Path) -> Geometry:
    """A placed object's vertices in the world, its faces and its instance."""
    mesh, matrix = asset_of(placed.object, mesh_root).mesh, world_from_object(placed)
    return mesh.positions @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces, placed.instance


def arrange(pair: PairRef, loaded: LoadedSpec, split: SplitContents) -> Arrangement:
    """Room or scene, target and furniture of a pair, laid out; furniture that does not fit is left out with a note.

    Raises PlanError where the target does not fit, or the scene has no such thing; UserError where a file cannot be
    read.
    """
    scene, seed, mesh_root = split.scenes[pair.scene], loaded.dataset.seed, loaded.path.parent
    staged = stage(loaded, split, pair)
    around = room_parts(staged.room, mesh_root)
    building, things = (_parted([part for part in around if (part.part == "furniture") == furniture])
                        for furniture in (False, True))
    shell = shell_of(staged.room, building.hiding, things.hiding, (building.clear, things.clear),
                     [name for name in PARTS if any(part.part == name for part in around)])
    pieces = [_piece(piece.object, piece.place, mesh_root,
                     partial(rng, seed, *pair.path, "furniture", *piece.number, "position"))
              for piece in scene.furniture]
    turns = isinstance(loaded.dataset.camera_of(pair.split).path, TurntableSpec)
    if staged.placed is None:
        target = _piece(staged.target, scene.target, mesh_root, partial(rng, seed, *pair.path, "target", "position"))
        if turns:
            target = replace(target, extent=swept_box(target.extent))
        layout = lay_out(target, pieces, shell, scene.space)
        placed, poses, notes = _placed(staged.target, layout.target, TARGET_INSTANCE), layout.furniture, layout.notes
    else:
        placed = staged.placed
        extent = extent_of(asset_of(placed.object, mesh_root))
        box = footprint(swept_box(extent) if turns else extent, placed.position, placed.yaw)
        poses, notes = furnish(box, pieces, shell, scene.space)
    standing = [(piece.object, pose) for piece, pose in zip(scene.furniture, poses, strict=True) if pose]
    first = FURNITURE_INSTANCE + sum(part.part == "furniture" for part in around)
    furniture = tuple(_placed(plan, pose, first + k) for k, (plan, pose) in enumerate(standing))
    geometry = [geometry_of(thing, mesh_root) for thing in (placed, *furniture)] + things.hiding + building.hiding
    clear = (*things.clear, *building.clear) if staged.room.kind != "procedural" else ()
    sweep = Sweep.of(placed, extent_of(asset_of(placed.object, mesh_root))) if turns else None
    if sweep is not None:
        sweep.check([*geometry[1:], *clear], f"{staged.target.name} in {staged.room.name}")
    return Arrangement(room=staged.room, target=placed, furniture=furniture, geometry=tuple(geometry), shell=shell,
                       clear=clear, sweep=sweep,
                       notes=(*staged.notes, *notes, *_odd_sizes((placed, *furniture), mesh_root)))


class _Parted(NamedTuple):
    """Parts by whether faces hide what is behind them, those without any left out."""

    hiding: list[Geometry]
    clear: list[Geometry]


def _parted(parts: Iterable[RoomPart]) -> _Parted:
    found = _Parted([], [])
    for part in parts:
        positions, faces, clear = part.positions, part.faces, part.clear
        for kept, own in ((found.hiding, faces[~clear]), (found.clear, faces[clear])):
            kept += [(positions, own, part.instance)] if len(own) else []
    return found


def _odd_sizes(things: Iterable[PlacedObject], mesh_root: Path) -> list[str]:
    """One sentence for each object whose size is unusual."""
    found = {thing.object.name: advice_on(thing.object, mesh_root) for thing in things}
    return [f"unusual size of {name}: {advice.rule}" for name, advice in found.items() if advice]
