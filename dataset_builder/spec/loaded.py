"""A dataset spec with everything that it names, checked and ready for planning."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from dataset_builder.digest import digest
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.mesh_source import MeshSource
from dataset_builder.spec.scene import ObjectSpec, RoomSpec, SceneSpec


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadedSpec:
    """One dataset and its files.

    Files are keyed by their path relative to the folder of the dataset file, with forward slashes; every reference
    inside `dataset` and `scenes` is such a key, so `rooms[scene.room]` and `objects[piece.object]` always work.
    meshes: the mesh file of each object that has one, under the object's key. images: SHA-256 of each image that lights
    show, by its name in the dataset file. overrides: `key.path=value` strings that `dataset` has already been changed
    by; with `path` they load the spec again.
    """

    path: Path
    dataset: DatasetSpec
    objects: Mapping[str, ObjectSpec]
    scenes: Mapping[str, SceneSpec]
    rooms: Mapping[str, RoomSpec]
    meshes: Mapping[str, MeshSource]
    images: Mapping[str, str]
    overrides: tuple[str, ...] = ()

    @cached_property
    def spec_digest(self) -> str:
        """SHA-256 over the content of everything, files of meshes and images
        included; not over the folder that it lies in."""
        return digest(self.content())

    def content(self) -> dict[str, Any]:
        """Everything that a build depends on, as plain data."""
        groups = {"objects": self.objects, "scenes": self.scenes, "rooms": self.rooms}
        plain = {kind: {key: spec.model_dump(mode="json", by_alias=True) for key, spec in specs.items()}
                 for kind, specs in groups.items()}
        meshes = {key: mesh.content() for key, mesh in self.meshes.items()}
        return {"dataset": self.dataset.model_dump(mode="json", by_alias=True), "meshes": meshes,
                "images": dict(self.images), **plain}
