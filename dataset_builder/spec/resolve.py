"""A dataset spec with all that it names: files are followed, each is validated once, all problems are gathered."""

import os
import posixpath
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dataset_builder.digest import digest
from dataset_builder.errors import Problem, SpecError
from dataset_builder.spec.camera_path import PosesSpec
from dataset_builder.spec.check import (
    check_lamps,
    check_licence,
    check_object,
    check_scenes,
    check_splits,
    files_like,
    find_mesh,
)
from dataset_builder.spec.dataset import DatasetSpec, SplitSpec
from dataset_builder.spec.document import AnyModel, Document, validated
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.image_uses import ImageUse, find_images, image_uses, room_image_uses
from dataset_builder.spec.licences import FREE
from dataset_builder.spec.mesh_source import MeshSource
from dataset_builder.spec.named_files import (
    key_of,
    keyed_room,
    keyed_scene,
    keyed_split,
    scene_references,
    split_references,
)
from dataset_builder.spec.own_fields import check_own_field, check_own_targets
from dataset_builder.spec.pose_files import find_poses
from dataset_builder.spec.problems import dotted, shown
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec
from dataset_builder.spec.scene_files import find_scene

SAID = ("version", "title", "description", "licence", "splits")
"""Keys of a dataset that no example depends on, but for the splits of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadedSpec:
    """One dataset and its files.

    Files are keyed by their path relative to the folder of the dataset file, with forward slashes; every reference
    inside `dataset` and `scenes` is such a key, so `objects[piece.object]` always works, and `rooms[scene.room]` where
    a scene has a room.
    """

    path: Path
    dataset: DatasetSpec
    objects: Mapping[str, ObjectSpec]
    scenes: Mapping[str, SceneSpec]
    rooms: Mapping[str, RoomSpec]
    meshes: Mapping[str, MeshSource]
    """The mesh file of each object that has one, under the object's key."""
    images: Mapping[str, str]
    """SHA-256 of each image that lights and rooms show, by its name from the folder of the dataset file."""
    image_uses: tuple[ImageUse, ...] = ()
    """Where they are named."""
    pose_files: Mapping[str, str] = field(default_factory=dict)
    """SHA-256 of each file that cameras have their poses from, by its path relative to the folder of the dataset
    file."""
    places: Mapping[str, str] = field(default_factory=dict)
    """Where each object that has a mesh file names it, `file:line`, under the object's key."""
    scene_files: Mapping[str, MeshSource] = field(default_factory=dict)
    """The files of each scene that comes from one, under the scene's key."""
    documents: Mapping[str, Document] = field(default_factory=dict)
    """Where things are written: the dataset file under "", and scenes that come from files under their keys."""
    overrides: tuple[str, ...] = ()
    """`key.path=value` strings that `dataset` has already been changed by; with `path` they load the spec again."""

    @cached_property
    def spec_digest(self) -> str:
        """SHA-256 over the content of everything, files of meshes and images
        included; not over the folder that it lies in."""
        return digest(self.content())

    def problem(self, key: str, path: KeyPath, rule: str, hint: str = "") -> Problem:
        """A broken rule of what stands at `path` of the dataset file, whose key is "", or of a scene from a file."""
        document = self.documents.get(key)
        return document.problem(path, rule, hint) if document else Problem(where=key, path=dotted(path), rule=rule,
                                                                           hint=hint)

    def content(self) -> dict[str, Any]:
        """Everything that a build depends on, as plain data."""
        groups = {"objects": self.objects, "scenes": self.scenes, "rooms": self.rooms}
        plain = {kind: {key: spec.model_dump(mode="json", by_alias=True) for key, spec in specs.items()}
                 for kind, specs in groups.items()}
        files = {kind: {key: source.content() for key, source in sources.items()}
                 for kind, sources in (("meshes", self.meshes), ("scene_files", self.scene_files))}
        return {"dataset": self.dataset.model_dump(mode="json", by_alias=True), "images": dict(self.images),
                "pose_files": dict(self.pose_files), **files, **plain}

    def split_digest(self, split: SplitSpec, first: int) -> str:
        """SHA-256 over what the examples of a split depend on, the first of which has the index `first`.

        Not over other splits and what only they use, nor over what is said of the dataset as a whole.
        """
        rooms, objects = set[str](), set(split.objects.source)
        own_poses = isinstance((split.camera or self.dataset.camera).path, PosesSpec)
        for name in split.scenes.source:
            if (room := self.scenes[name].room) is not None:
                rooms.add(room)
            objects |= {piece.object for piece in self.scenes[name].furniture}
        content = self.content()
        dataset = {key: value for key, value in content["dataset"].items() if key not in SAID}
        scenes = set(split.scenes.source)
        own = {"scenes": scenes, "scene_files": scenes, "rooms": rooms, "objects": objects, "meshes": objects}
        return digest({"dataset": dataset, "split": split.model_dump(mode="json", by_alias=True,
                                                                     exclude={"allow_shared"}), "first": first,
                       "images": content["images"], "pose_files": content["pose_files"] if own_poses else {},
                       **{kind: {key: value for key, value in content[kind].items() if key in names}
                          for kind, names in own.items()}})


class Resolver:
    """Reads the files of one dataset; `read(path, name)` gives a file as plain data or raises SpecError."""

    def __init__(self, *, read: Callable[[Path, str], Document], root: Path, problems: list[Problem]) -> None:
        self.read = read
        self.root = root
        self.problems = problems
        self.objects: dict[str, ObjectSpec | None] = {}
        self.scenes: dict[str, SceneSpec | None] = {}
        self.rooms: dict[str, RoomSpec | None] = {}
        self.meshes: dict[str, MeshSource] = {}
        self.places: dict[str, str] = {}
        self.scene_files: dict[str, MeshSource] = {}
        self.documents: dict[str, Document] = {}
        self.image_uses: list[ImageUse] = []

    def dataset(self, document: Document) -> LoadedSpec:
        """The dataset that `document` means. Raises SpecError with every problem of every file."""
        spec = self._validated(document, DatasetSpec)
        for path, name in split_references(document.data):
            kind = self._object if path[2] == "objects" else self._scene
            self._follow(document, path, name, "", kind)
        uses = (*image_uses(document), *self.image_uses)
        images, problems = find_images(uses, self.root.parent)
        poses, more = find_poses(document, self.root.parent)
        self.problems += [*problems, *more]
        if spec is not None:
            spec = spec.model_copy(update={"splits": tuple(map(keyed_split, spec.splits))})
            self.problems += check_splits(spec, document, self.meshes)
            self.problems += check_scenes(spec, document, _found(self.scenes), self.scene_files)
            self.problems += check_lamps(spec, document, _found(self.scenes))
            self.problems += check_own_targets(spec, document, _found(self.objects))
            licence = check_licence(spec, document, _licences(_found(self.objects), _found(self.scenes)))
            if isinstance(licence, Problem):
                self.problems.append(licence)
            else:
                spec = spec.model_copy(update={"licence": licence})
        if self.problems or spec is None:
            raise SpecError(dict.fromkeys(self.problems))
        return LoadedSpec(path=self.root, dataset=spec, objects=_found(self.objects), scenes=_found(self.scenes),
                          rooms=_found(self.rooms), meshes=MappingProxyType(self.meshes),
                          images=MappingProxyType(images), image_uses=uses, pose_files=MappingProxyType(poses),
                          places=MappingProxyType(self.places),
                          scene_files=MappingProxyType(self.scene_files),
                          documents=MappingProxyType({"": document, **self.documents}))

    def _validated(self, document: Document, model: type[AnyModel]) -> AnyModel | None:
        result = validated(document, model)
        if isinstance(result, list):
            self.problems += result
            return None
        return result

    def _follow(self, document: Document, path: KeyPath, name: str, key: str,
                visit: Callable[[str], None]) -> None:
        """Visit the file that `document` calls `name`; a missing one is a problem of the line that names it."""
        target = key_of(name, key)
        if not os.path.isfile(self.root.parent / target):
            rule, hint = f"expected a spec file, found none at {shown(name)}", files_like(self.root.parent / target)
            self.problems.append(document.problem(path, rule, hint))
            return
        visit(target)

    def _read(self, key: str) -> Document | None:
        try:
            return self.read(self.root.parent / key, posixpath.join(posixpath.dirname(str(self.root)), key))
        except SpecError as error:
            self.problems += error.problems
            return None

    def _object(self, key: str) -> None:
        if key in self.objects or (document := self._read(key)) is None:
            return
        spec = self.objects[key] = self._validated(document, ObjectSpec)
        if spec is None:
            return
        self.problems += [*check_object(spec, document), *check_own_field(spec, document)]
        mesh = find_mesh(spec, document, (self.root.parent / key).parent)
        if isinstance(mesh, Problem):
            self.problems.append(mesh)
        elif mesh:
            self.meshes[key], self.places[key] = mesh, document.place(("file",))
        family = FAMILIES.get(spec.family or "")
        self.objects[key] = spec.model_copy(update={
            "category": spec.category or (family.category if family else "object"),
            "licence": spec.licence or (FREE if spec.family else "")})

    def _scene(self, key: str) -> None:
        if key in self.scenes or (document := self._read(key)) is None:
            return
        spec = self.scenes[key] = self._validated(document, SceneSpec)
        for path, name in scene_references(document.data):
            self._follow(document, path, name, key, self._room if path == ("room",) else self._object)
        if spec is None:
            return
        if spec.file is not None:
            found = find_scene(spec.file, document, (self.root.parent / key).parent)
            self.documents[key] = document
            if isinstance(found, list):
                self.problems += found
            else:
                self.scene_files[key] = found
        self.scenes[key] = keyed_scene(spec, key)

    def _room(self, key: str) -> None:
        if key not in self.rooms and (document := self._read(key)) is not None:
            spec = self._validated(document, RoomSpec)
            self.rooms[key] = spec and keyed_room(spec, key)
            self.image_uses += room_image_uses(document, key)


def _found(specs: dict[str, AnyModel | None]) -> MappingProxyType[str, AnyModel]:
    return MappingProxyType({key: spec for key, spec in specs.items() if spec is not None})


def _licences(objects: Mapping[str, ObjectSpec], scenes: Mapping[str, SceneSpec]) -> dict[str, str]:
    """The licences of objects and of scenes that come from files, by the file that says so."""
    found = {key: spec.licence for key, spec in objects.items() if spec.licence}
    return found | {key: scene.file.licence for key, scene in scenes.items() if scene.file}
