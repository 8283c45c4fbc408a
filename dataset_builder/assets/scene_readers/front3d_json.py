"""3D-FRONT scene files (JSON, version 2.0) -> rooms, furniture, meshes, materials and doors; no other file is opened.

Axes and units are the file's: metres, Y up, right-handed. What is wrong with a file is lived with and listed.
"""

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.scene_readers.front3d_meshes import FrontMaterial, FrontMesh, material_of, mesh_of
from dataset_builder.assets.scene_readers.front3d_values import (
    FURTHEST,
    FaultNotes,
    SceneFault,
    cleaned,
    number,
    with_arrays,
)
from dataset_builder.spec.front3d_references import folder_name, front3d_document
from dataset_builder.spec.problems import shown

Entry = TypeVar("Entry", "FrontFurniture", FrontMesh, FrontMaterial)


@dataclass(frozen=True, eq=False)
class FrontChild:
    """A piece of furniture or a mesh in a room."""

    name: str
    """Unique in the scene: `Kitchen-1224/furniture/487`."""
    ref: str
    """uid of a piece of furniture or a mesh of the scene."""
    matrix: np.ndarray
    """(4, 4) room_from_child."""


@dataclass(frozen=True, eq=False)
class FrontRoom:
    """A room."""

    name: str
    """Its instanceid, unique in the scene: `Kitchen-1224`."""
    kind: str
    """Its type: `Kitchen`."""
    matrix: np.ndarray
    """(4, 4) house_from_room."""
    children: tuple[FrontChild, ...]


@dataclass(frozen=True)
class FrontFurniture:
    """An entry of the list of furniture, which children of rooms refer to."""

    uid: str
    jid: str
    """Folder of the model; empty for none that may be one."""
    category: str
    """As written; empty for none."""
    sizes: tuple[tuple[float, float, float], ...]
    """What `size` and `bbox` declare, in the order of the file, which varies; metres, as a rule."""
    valid: bool | None
    """Whether the model was published; None where the entry does not say."""


@dataclass(frozen=True)
class FrontDoor:
    """A door of the list of doors."""

    kind: str
    """`interiorDoor`, `entryDoor`."""
    room: str
    refs: tuple[str, ...]
    """uids of furniture and meshes that are there."""


@dataclass(frozen=True, eq=False)
class FrontScene:
    """A whole file."""

    uid: str
    version: str
    matrix: np.ndarray
    """(4, 4) world_from_house, in the file's axes."""
    rooms: tuple[FrontRoom, ...]
    furniture: Mapping[str, FrontFurniture]
    """By uid."""
    meshes: Mapping[str, FrontMesh]
    """By uid; each with at least one face."""
    materials: Mapping[str, FrontMaterial]
    """By uid."""
    doors: tuple[FrontDoor, ...]
    views: int
    """Cameras in `extension`, which are not read."""
    faults: tuple[SceneFault, ...]
    """What is wrong with the file."""


def read_front3d(path: Path) -> FrontScene:
    """The scene of a file. Raises UserError, in one line with the file and the place, for what is no JSON or no scene
    of 3D-FRONT, or too large."""
    try:
        document = front3d_document(path, with_arrays)
    except (OSError, ValueError) as error:
        refuse(path, f"expected a readable scene of 3D-FRONT, got: {error}")
    if not isinstance(document, dict) or not isinstance(document.get("scene"), dict):
        refuse(path, "expected a scene of 3D-FRONT, an object with the key scene, got "
               + (f"one without it: {shown(list(document))}" if isinstance(document, dict) else shown(document)))
    return front3d_scene(document)


def front3d_scene(document: Mapping[str, Any]) -> FrontScene:
    """The scene of a JSON object whose long lists `with_arrays` has made arrays."""
    notes = FaultNotes()
    furniture = _by_uid(notes, [(where, _furniture(notes, where, entry))
                                for where, entry in notes.entries(document, "furniture")])
    materials = _by_uid(notes, [(where, material_of(notes, where, entry))
                                for where, entry in notes.entries(document, "material")])
    entries = notes.entries(document, "mesh")
    meshes = {mesh.uid: mesh for mesh in _by_uid(notes, [
        (where, mesh_of(notes, where, entry)) for where, entry in entries]).values() if len(mesh.faces)}
    empty = {cleaned(entry.get("uid")) for _, entry in entries} - set(meshes)
    scene, extension = notes.mapping(document, "scene"), notes.mapping(document, "extension")
    known = furniture.keys() | meshes.keys()
    rooms = _rooms(notes, scene, known, empty)
    doors = tuple(_door(notes, where, entry, known | empty)
                  for where, entry in notes.entries(extension, "door", "extension"))
    perspective = extension.get("perspective_view")
    views = [extension.get("snapshots"), perspective.get("link") if isinstance(perspective, dict) else None]
    return FrontScene(uid=cleaned(document.get("uid")), version=cleaned(document.get("version")),
                      matrix=_matrix(notes, scene, "scene"), rooms=rooms, furniture=furniture, meshes=meshes,
                      materials=materials, doors=doors, faults=tuple(notes.found),
                      views=sum(len(each) for each in views if isinstance(each, list)))


def _by_uid(notes: FaultNotes, entries: list[tuple[str, Entry]]) -> dict[str, Entry]:
    """The entries that have a uid, the first of each."""
    found: dict[str, Entry] = {}
    for where, entry in entries:
        if not entry.uid:
            notes.add("entries without a uid, left out", where)
        elif entry.uid in found:
            notes.add("uids that are there twice, the first counts", where, entry.uid)
        else:
            found[entry.uid] = entry
    return found


def _furniture(notes: FaultNotes, where: str, entry: Mapping[str, Any]) -> FrontFurniture:
    jid, valid = folder_name(entry.get("jid")), entry.get("valid")
    if entry.get("jid") and entry["jid"] != "local" and not jid:
        notes.add("jids that name no folder, left out", where, shown(entry["jid"]))
    sizes = filter(None, (_size(entry.get(key)) for key in ("size", "bbox")))
    return FrontFurniture(uid=cleaned(entry.get("uid")), jid=jid, category=cleaned(entry.get("category")),
                          sizes=tuple(dict.fromkeys(sizes)),
                          valid=None if valid is None else valid in (True, 1, "true", "True"))


def _size(value: Any) -> tuple[float, float, float] | None:
    """Three positive lengths, in a list or in a list in a list; None for anything else."""
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], list):
        value = value[0]
    if not isinstance(value, list) or len(value) != 3:
        return None
    x, y, z = (number(each) for each in value)
    return (x, y, z) if min(x, y, z) >= 0 and 0 < max(x, y, z) < FURTHEST else None


def _rooms(notes: FaultNotes, scene: Mapping[str, Any], known: AbstractSet[str], empty: AbstractSet[str]) \
        -> tuple[FrontRoom, ...]:
    names, rooms = Names(), []
    for position, (where, entry) in enumerate(notes.entries(scene, "room", "scene")):
        room = names.free(cleaned(entry.get("instanceid")) or f"room-{position}")
        found = []
        for index, (place, child) in enumerate(notes.entries(entry, "children", where)):
            name = f"{room}/{cleaned(child.get('instanceid')) or index}"
            ref = cleaned(child.get("ref"))
            if ref not in known:
                if ref not in empty:
                    notes.add("references to nothing, left out", name, ref or place)
            elif (matrix := notes.placement(child, name)) is not None:
                found.append(FrontChild(names.free(name), ref, matrix))
        rooms.append(FrontRoom(room, cleaned(entry.get("type")), _matrix(notes, entry, room), tuple(found)))
    if not rooms:
        notes.add("scenes without rooms", "scene.room")
    return tuple(rooms)


def _matrix(notes: FaultNotes, entry: Mapping[str, Any], where: str) -> np.ndarray:
    """Of a room or a scene; one that is none changes nothing."""
    placed = notes.placement({"pos": [0, 0, 0], "rot": [0, 0, 0, 1], "scale": [1, 1, 1], **entry}, where)
    return np.eye(4) if placed is None else placed


def _door(notes: FaultNotes, where: str, entry: Mapping[str, Any], known: AbstractSet[str]) -> FrontDoor:
    value = entry.get("ref")
    refs = tuple(filter(None, map(cleaned, value if isinstance(value, list) else [value])))
    for ref in refs:
        if ref not in known:
            notes.add("doors that refer to nothing", where, ref)
    return FrontDoor(cleaned(entry.get("type")), cleaned(entry.get("roomId")), refs)


class Names:
    """Names of things, each once."""

    def __init__(self) -> None:
        self._taken: dict[str, int] = {}

    def free(self, name: str) -> str:
        """The name, or with a number where it is taken: `Kitchen-1#2`."""
        count = self._taken[name] = self._taken.get(name, 0) + 1
        return name if count == 1 else self.free(f"{name}#{count}")
