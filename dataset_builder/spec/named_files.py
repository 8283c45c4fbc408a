"""The files that the files of a spec name, and these names as keys: paths relative to the dataset's folder."""

import posixpath
from collections.abc import Iterator
from typing import Any

from dataset_builder.spec.dataset import ObjectsSpec, ScenesSpec, SplitSpec
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.document import items_of, value_at
from dataset_builder.spec.file_scene import SceneFileSpec
from dataset_builder.spec.scene import RoomSpec, SceneSpec


def key_of(name: str, key: str) -> str:
    """Key of the file that the file `key` calls `name`: the path relative to the dataset's folder.

    >>> key_of("../rooms/study.yaml", "scenes/office.yaml")
    'rooms/study.yaml'
    """
    return posixpath.normpath(posixpath.join(posixpath.dirname(key), name))


def keyed_scene(scene: SceneSpec, key: str) -> SceneSpec:
    """The scene with its references as keys."""
    furniture = tuple(piece.model_copy(update={"object": key_of(piece.object, key)}) for piece in scene.furniture)
    room = None if scene.room is None else key_of(scene.room, key)
    return scene.model_copy(update={"room": room, "file": scene.file and _keyed_file(scene.file, key),
                                    "furniture": furniture})


def keyed_room(room: RoomSpec, key: str) -> RoomSpec:
    """The room with its textures as keys."""
    return room.model_copy(update={"materials": {
        role: own.model_copy(update={"texture": key_of(own.texture, key)}) if own.texture else own
        for role, own in room.materials.items()}})


def _keyed_file(file: SceneFileSpec, key: str) -> SceneFileSpec:
    """The scene file with paths relative to the folder of the dataset file."""
    folders = {name: key_of(folder, key) if (folder := getattr(file, name)) else "" for name in ("models", "textures")}
    return file.model_copy(update={"path": key_of(file.path, key), **folders,
                                   "roots": tuple(key_of(root, key) for root in file.roots)})


def keyed_split(split: SplitSpec) -> SplitSpec:
    """The split with its references as keys."""
    groups: dict[str, ObjectsSpec | ScenesSpec] = {"objects": split.objects, "scenes": split.scenes}
    keyed = {name: group.model_copy(update={"source": tuple(key_of(file, "") for file in group.source)})
             for name, group in groups.items()}
    return split.model_copy(update=keyed)


# References are read from plain data, so that files are followed even from a file that breaks rules

def split_references(data: Any) -> Iterator[tuple[KeyPath, str]]:
    """Where a dataset names object and scene files, and their names."""
    for number, split in items_of(value_at(data, "splits")):
        for kind in ("objects", "scenes"):
            for index, name in items_of(value_at(value_at(split, kind), "from")):
                if isinstance(name, str):
                    yield ("splits", number, kind, "from", index), name


def scene_references(data: Any) -> Iterator[tuple[KeyPath, str]]:
    """Where a scene names its room and object files, and their names."""
    if isinstance(room := value_at(data, "room"), str):
        yield ("room",), room
    for index, piece in items_of(value_at(data, "furniture")):
        if isinstance(name := value_at(piece, "object"), str):
            yield ("furniture", index, "object"), name
