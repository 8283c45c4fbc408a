"""Mesh files as scenes: glTF by its nodes, .obj by its objects or groups, .ply, .stl, .off and fields as one thing.

An object of an .obj file whose groups name different parts of a building is parted by them, `OBJECT/GROUP`, unless the
spec's `parts` gives its whole name.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import FileModel, counted, refuse, unique
from dataset_builder.assets.mesh_file import checked_references, file_named, left_out_of, scaled_world
from dataset_builder.assets.readers import obj, off, own_field, ply, stl
from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.assets.scene_readers.gltf_scene import read_gltf_scene
from dataset_builder.assets.scene_readers.roles import classified, is_building
from dataset_builder.assets.scene_readers.thing_assets import thing_asset
from dataset_builder.assets.scene_readers.thing_tree import category_in
from dataset_builder.errors import UserError, printable
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.mesh_source import FIELD_SUFFIX, splat_hint

GLTF = (".glb", ".gltf")
WHOLE: dict[str, Callable[[Path, int], FileModel]] = {
    ".obj": obj.read, ".ply": ply.read, ".stl": stl.read, ".off": off.read, FIELD_SUFFIX: own_field.read}
"""What reads the formats without a hierarchy."""
MESH_SCENES = (*GLTF, *WHOLE)
"""Suffixes of mesh files that are read as scenes."""


def read(source: SceneSource, root: Path, max_texture: int) -> SceneModel:
    """The scene of a mesh file. Raises UserError."""
    path = root / source.source
    if not path.is_file():
        refuse(path, "expected an existing file, got none", "paths are relative to the spec that names them")
    roots = tuple(root / folder for folder in source.roots)
    checked_references(path, roots)
    world_from_file = scaled_world(source.scale, source.up)
    with file_named(path):
        if path.suffix.lower() in GLTF:
            scene = read_gltf_scene(path, source, roots, world_from_file, max_texture)
        else:
            scene = _flat_scene(_model(path, source, max_texture), path, source, world_from_file)
        if not scene.things:
            refuse(path, "expected things with triangles, got none",
                   "; ".join(scene.faults[:3]) or splat_hint(scene.left_out))
        things, decided = classified(scene.things, source)
    return replace(scene, things=things, left_out=(*scene.left_out, *decided))


def _model(path: Path, source: SceneSource, max_texture: int) -> FileModel:
    if path.suffix.lower() != ".obj":
        return WHOLE[path.suffix.lower()](path, max_texture)
    named = {pattern for part in source.parts for pattern in part.patterns}
    return obj.read(path, max_texture, whole=lambda name, groups: name in named or not is_building(name, groups))


def _flat_scene(model: FileModel, path: Path, source: SceneSource, world_from_file: np.ndarray) -> SceneModel:
    """Every group of the parts as a thing, in the coordinates of the file."""
    faults: list[str] = []
    things = tuple(_group_things(model, path, source, world_from_file, faults))
    return SceneModel(things=things, lights=(), cameras=(), contains=f"{counted(len(things), 'thing')}, "
                      f"{model.contains}", left_out=tuple(left_out_of(model)), faults=tuple(faults))


def _group_things(model: FileModel, path: Path, source: SceneSource, world_from_file: np.ndarray,
                  faults: list[str]) -> Iterator[SceneThing]:
    taken: set[str] = set()
    for group in dict.fromkeys(part.group for part in model.parts):
        parts = tuple(part for part in model.parts if part.group == group)
        name = unique(printable(group) or path.stem, taken)
        try:
            asset, content = thing_asset(replace(model, parts=parts, left_out=()), world_from_file, name=name,
                                         category=category_in(name), licence=source.licence)
        except UserError as error:
            faults.append(f"{name}: {error.problems[0].rule}: left out")
            continue
        yield SceneThing(name=name, category=asset.category, role="object", asset=asset, world=np.eye(4),
                         content=content)
