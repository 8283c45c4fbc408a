"""A scene of 3D-FRONT to its entry of the index, and to a plan of its floors seen from above."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.scene_readers.front3d_building import front_role
from dataset_builder.assets.scene_readers.front3d_json import (
    FrontChild,
    FrontFurniture,
    FrontRoom,
    FrontScene,
    read_front3d,
)
from dataset_builder.assets.scene_readers.front3d_models import CENTIMETRE, LONGEST
from dataset_builder.assets.scene_readers.front3d_values import SceneFault
from dataset_builder.errors import UserError
from dataset_builder.importing.scene_index import FurniturePiece, RoomIndex, SceneIndex

FLOOR_CUT, WALL_CUT = 0.3, 1.3
"""Heights above the floor, metres: below all sills, so that only doors are open; and through windows."""
LEVEL = 0.5
"""Least vertical part of the normal of a face that can be stood on."""


def read_scene(path: Path, sha256: str) -> tuple[SceneIndex, tuple[SceneFault, ...]]:
    """What the index keeps of a scene, and its faults. A file that cannot be read is a scene that is broken."""
    size = path.stat().st_size
    try:
        scene = read_front3d(path)
    except UserError as error:
        broken = "; ".join(f"{problem.path}: {problem.rule}" if problem.path else problem.rule
                           for problem in error.problems)
        return SceneIndex(file=path.name, sha256=sha256, size=size, broken=broken), ()
    rooms = tuple(_room(scene, room) for room in scene.rooms)
    faults = (*scene.faults, *_faults(scene, rooms))
    return SceneIndex(file=path.name, sha256=sha256, size=size, uid=scene.uid, rooms=rooms,
                      faults=dict(sorted(Counter(fault.kind for fault in faults).items()))), faults


def _faults(scene: FrontScene, rooms: Sequence[RoomIndex]) -> Iterator[SceneFault]:
    """What the reader of whole scenes finds without models, in its words."""
    for room, indexed in zip(scene.rooms, rooms, strict=True):
        for child in room.children:
            entry = scene.furniture.get(child.ref)
            if entry is not None and not entry.valid:
                said = "not described" if entry.valid is None else "valid is false"
                yield SceneFault("pieces of furniture that were not published, left out", child.name,
                                 f"{child.ref}, {said}")
        if not indexed.area:
            yield SceneFault("rooms without a floor", room.name, room.kind)


def _room(scene: FrontScene, room: FrontRoom) -> RoomIndex:
    floors = [_flat(triangles) for triangles in _surfaces(scene, room, _is_floor)]
    pieces = tuple(_piece(entry, scene.matrix @ room.matrix @ child.matrix)
                   for child, entry in _furniture(scene, room))
    return RoomIndex(name=room.name, kind=room.kind, area=round(sum(map(_area, floors)), 2), pieces=pieces)


def _piece(entry: FrontFurniture, matrix: np.ndarray) -> FurniturePiece:
    return FurniturePiece(jid=entry.jid, category=entry.category, valid=bool(entry.valid), sizes=entry.sizes,
                          bottom=round(float(matrix[1, 3]), 2))


def _furniture(scene: FrontScene, room: FrontRoom) -> Iterator[tuple[FrontChild, FrontFurniture]]:
    """Pieces that may have a model."""
    for child in room.children:
        entry = scene.furniture.get(child.ref)
        if entry is not None and entry.jid:
            yield child, entry


def _is_floor(kind: str) -> bool:
    return front_role(kind) == "floor"


def _is_wall(kind: str) -> bool:
    return "wall" in kind.lower()


def _is_door(kind: str) -> bool:
    return "door" in kind.lower()


def _surfaces(scene: FrontScene, room: FrontRoom, wanted: Callable[[str], bool]) -> Iterator[np.ndarray]:
    """(F, 3, 3) triangles in the world, in the file's axes, of each mesh whose type is wanted."""
    for child in room.children:
        mesh = scene.meshes.get(child.ref)
        if mesh is not None and wanted(mesh.kind):
            matrix = scene.matrix @ room.matrix @ child.matrix
            yield (mesh.positions @ matrix[:3, :3].T + matrix[:3, 3])[mesh.faces]


def _flat(triangles: np.ndarray) -> np.ndarray:
    """(F, 3, 2) of the faces that can be stood on, seen from above; a slab's lower side is the same again."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    up = normals[:, 1] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    chosen = up > LEVEL if (up > LEVEL).any() else up < -LEVEL
    return triangles[chosen][:, :, (0, 2)] * (1, -1)


def _area(triangles: np.ndarray) -> float:
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return float(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class FurnitureBox:
    """A piece of furniture, seen from above."""

    jid: str
    category: str
    valid: bool
    corners: np.ndarray
    """(4, 2) metres, the front between the first two; without a declared size, a square of 20 cm."""
    top: float
    """Height, metres, so that lamps are drawn over tables."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomOutline:
    """A room, seen from above: x to the right and y upwards as in the builder's world, metres."""

    name: str
    kind: str
    floor: np.ndarray
    """(F, 3, 2) triangles."""
    furniture: tuple[FurnitureBox, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorPlan:
    """A scene, seen from above."""

    file: str
    rooms: tuple[RoomOutline, ...]
    low_walls: np.ndarray
    """(N, 2, 2) segments of walls just above the floor, with gaps at doors."""
    walls: np.ndarray
    """(N, 2, 2) the same at the height of windows, with gaps at these, too."""
    doors: np.ndarray
    """(N, 2, 2) segments of leaves of doors."""


def floor_plan(path: Path) -> FloorPlan | str:
    """What a picture of a scene needs, or why there is none."""
    try:
        scene = read_front3d(path)
    except UserError as error:
        return str(error)
    rooms = tuple(_outline(scene, room) for room in scene.rooms)
    walls = [triangles for room in scene.rooms for triangles in _surfaces(scene, room, _is_wall)]
    doors = [triangles for room in scene.rooms for triangles in _surfaces(scene, room, _is_door)]
    low, high, leaves = (_joined([_cut(each, height) for each in of], (0, 2, 2))
                         for of, height in ((walls, FLOOR_CUT), (walls, WALL_CUT), (doors, WALL_CUT)))
    return FloorPlan(file=path.name, rooms=rooms, low_walls=low, walls=high, doors=leaves)


def _outline(scene: FrontScene, room: FrontRoom) -> RoomOutline:
    floors = [_flat(triangles) for triangles in _surfaces(scene, room, _is_floor)]
    boxes = tuple(_box(entry, scene.matrix @ room.matrix @ child.matrix) for child, entry in _furniture(scene, room))
    return RoomOutline(name=room.name, kind=room.kind, floor=_joined(floors, (0, 3, 2)), furniture=boxes)


def _joined(parts: list[np.ndarray], empty: tuple[int, ...]) -> np.ndarray:
    return np.concatenate([np.zeros(empty), *parts])


def _cut(triangles: np.ndarray, height: float) -> np.ndarray:
    """(N, 2, 2) segments in which a level plane cuts triangles, seen from above."""
    above = triangles[:, :, 1] > height
    cut = triangles[above.any(axis=1) & ~above.all(axis=1)]
    above = cut[:, :, 1] > height
    # Turned so that the corner that is alone on its side of the plane comes first
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    turned = cut[np.arange(len(cut))[:, None], (alone[:, None] + np.arange(3)) % 3]
    ends = []
    for other in (1, 2):
        along = (height - turned[:, 0, 1]) / (turned[:, other, 1] - turned[:, 0, 1])
        ends.append(turned[:, 0] + along[:, None] * (turned[:, other] - turned[:, 0]))
    return np.stack(ends, axis=1)[:, :, (0, 2)] * (1, -1) if len(cut) else np.zeros((0, 2, 2))


def _box(entry: FrontFurniture, matrix: np.ndarray) -> FurnitureBox:
    """The declared box of a piece, its front towards +Z of the model."""
    width, depth, height = entry.sizes[0] if entry.sizes else (0.2, 0.2, 0.2)
    if max(width, depth, height) > LONGEST:
        width, depth, height = CENTIMETRE * width, CENTIMETRE * depth, CENTIMETRE * height
    x, z = width / 2, depth / 2
    corners = np.array([[-x, 0, z, 1], [x, 0, z, 1], [x, 0, -z, 1], [-x, 0, -z, 1]]) @ matrix.T
    return FurnitureBox(jid=entry.jid, category=entry.category, valid=bool(entry.valid),
                        corners=corners[:, (0, 2)] * (1, -1), top=float(matrix[1, 3]) + height)
