"""USD stages as scenes: their things, lights and cameras."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.file_model import FileModel, counted, of_each, refuse
from dataset_builder.assets.mesh_file import checked_references, scaled_world
from dataset_builder.assets.readers.usd import is_drawn, lost_words, size_of
from dataset_builder.assets.readers.usd_cages import rounds_of
from dataset_builder.assets.readers.usd_parts import MOST_TRIANGLES, UsdParts
from dataset_builder.assets.readers.usd_stage import OpenStage, naming, stage_of
from dataset_builder.assets.readers.usd_walk import UsdNode, UsdWalk
from dataset_builder.assets.scene_model import SceneCamera, SceneLight, SceneModel, SceneThing
from dataset_builder.assets.scene_readers.roles import classified
from dataset_builder.assets.scene_readers.thing_assets import made_of, thing_asset
from dataset_builder.assets.scene_readers.usd_cameras import read_camera
from dataset_builder.assets.scene_readers.usd_light_images import ImageFound
from dataset_builder.assets.scene_readers.usd_lights import is_light, read_light
from dataset_builder.assets.scene_readers.usd_things import Group, things_of, words_for
from dataset_builder.errors import UserError
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.file_reference import is_within
from dataset_builder.spec.usual_sizes import category_of

if TYPE_CHECKING:
    from pxr import Sdf

FLAT = 1e-12
"""Least share of a box's volume that a transform may leave of it, from which a thing is not there."""


@dataclass(kw_only=True, eq=False)
class _Scene:
    """What is read of a stage, and what came of it so far."""

    source: SceneSource
    root: Path
    opened: OpenStage
    walk: UsdWalk
    taken: UsdParts
    world: np.ndarray
    """(4, 4) from the stage to metres with Z up."""
    drawn: list[UsdNode] = field(default_factory=list)
    lights: list[SceneLight] = field(default_factory=list)
    cameras: list[SceneCamera] = field(default_factory=list)
    said: dict[tuple[str, str], list[str]] = field(default_factory=dict)
    """What is told of lights and cameras, by their kind and in words, and the names of those of which it is told."""
    faults: list[str] = field(default_factory=list)
    assets: dict[tuple[object, ...], tuple[Asset, str] | str] = field(default_factory=dict)
    """By what they are made of; or why there is none."""
    contents: dict[int, str] = field(default_factory=dict)
    """Digests of materials."""


def read(source: SceneSource, root: Path, max_texture: int) -> SceneModel:
    """The scene of a USD stage. Raises UserError."""
    path = root / source.source
    if not path.is_file():
        refuse(path, "expected an existing file, got none", "paths are relative to the spec that names them")
    roots = tuple(root / folder for folder in source.roots)
    checked_references(path, roots)
    choices = tuple((each.prim, each.set, each.variant) for each in source.variants)
    with stage_of(path, roots, choices) as opened:
        walk = UsdWalk(path=path, stage=opened.stage)
        taken = UsdParts(opened=opened, max_texture=max_texture, left_out=walk.left_out, decided=walk.decided)
        return _read(_Scene(source=source, root=root, opened=opened, walk=walk, taken=taken,
                            world=scaled_world(source.scale, "y") @ opened.metres))


def _read(scene: _Scene) -> SceneModel:
    for node in scene.walk.nodes():
        with naming(scene.opened.path, node.name):
            _take(scene, node)
    rounds = dict(zip(map(id, scene.drawn), rounds_of([size_of(node.prim) for node in scene.drawn]), strict=True))
    named = {pattern for part in scene.source.parts for pattern in part.patterns}
    found = [thing for group in things_of(scene.drawn, named) for thing in _thing(scene, group, rounds)]
    lost = lost_words(scene.walk)
    if not found:
        refuse(scene.opened.path, "expected things with triangles, got none", "; ".join((*scene.faults, *lost)[:3]))
    triangles = sum(len(thing.asset.mesh.faces) for thing in found)
    if triangles > MOST_TRIANGLES:
        largest = max(found, key=lambda thing: len(thing.asset.mesh.faces))
        refuse(scene.opened.path, f"expected at most {MOST_TRIANGLES:,} triangles, instances counted each, got "
                                  f"{triangles:,}", f"{largest.name} has {len(largest.asset.mesh.faces):,}")
    things, decided = classified(found, scene.source)
    materials = [f"{each.file.material.name}: {', '.join(each.file.left_out)}" for each in scene.taken.materials
                 if each.file.left_out]
    said = [of_each(kind, names, what) if kind else what for (kind, what), names in scene.said.items()]
    return SceneModel(
        things=things, lights=tuple(scene.lights), cameras=tuple(scene.cameras),
        contains=", ".join((counted(len(things), "thing"), counted(len(scene.lights), "light"),
                            counted(len(scene.cameras), "camera"), counted(triangles, "triangle"))),
        left_out=(*materials, *lost, *scene.opened.decided, *scene.taken.decided, *said, *decided),
        faults=tuple(scene.faults))


def _take(scene: _Scene, node: UsdNode) -> None:
    """Add a prim to what is drawn, to the lights, or to the cameras."""
    from pxr import UsdGeom

    path = scene.opened.path
    if is_light(node.prim):
        light = read_light(path, node.prim, scene.world @ node.matrix, image=lambda asset: _image(scene, asset),
                           unit=float(np.cbrt(np.linalg.det(scene.world[:3, :3]))))
        scene.lights += [replace(light.light, name=node.name)] if light.light else []
        _say(scene, "light", node, light.said)
    elif node.prim.IsA(UsdGeom.Camera):
        camera = read_camera(path, node.prim, scene.world @ node.matrix)
        scene.cameras += [replace(camera.camera, name=node.name)] if camera.camera else []
        _say(scene, "camera", node, camera.said)
    if is_drawn(scene.walk, node):
        scene.drawn.append(node)


def _say(scene: _Scene, kind: str, node: UsdNode, said: Iterable[str]) -> None:
    """Keep what is told of a light or a camera, with others of which the same is."""
    head = f"{kind} {node.prim.GetPath()}: "
    for line in said:
        scene.said.setdefault((kind if line.startswith(head) else "", line.removeprefix(head)), []).append(node.name)


def _image(scene: _Scene, asset: "Sdf.AssetPath") -> ImageFound | str:
    """The file of a light's texture."""
    from pxr import Ar

    outer, inner = Ar.SplitPackageRelativePathOuter(asset.resolvedPath)
    if not outer:
        return f"{asset.path} is not there"
    if inner:
        return f"{asset.path} is in a package; take it out of it"
    if not is_within(scene.opened.folders, outer):
        return f"{asset.path} is outside of the scene's folders"
    return ImageFound(path=Path(outer), root=scene.root)


def _thing(scene: _Scene, group: Group, rounds: dict[int, int]) -> Iterator[SceneThing]:
    """The thing of a root and its meshes; none where it has no surface, which is a fault."""
    top, meshes = group
    back = scene.world @ top.matrix @ np.linalg.inv(scene.world)
    size = float(np.prod(np.linalg.norm(back[:3, :3], axis=0)))
    if abs(np.linalg.det(back[:3, :3])) <= FLAT * size or not size:
        scene.faults.append(f"{top.name}: its transform leaves no volume of it: left out")
        return
    relative = [mesh.relative_to(top) for mesh in meshes]
    key = tuple((scene.taken.key_of(mesh.prim), rounds[id(mesh)], matrix.tobytes())
                for mesh, matrix in zip(meshes, relative, strict=True))
    if key not in scene.assets:
        scene.assets[key] = _asset(scene, group, relative, rounds)
    made = scene.assets[key]
    if isinstance(made, str):
        scene.faults.append(f"{top.name}: {made}: left out")
        return
    # Things that share what they are made of may be called differently
    yield SceneThing(name=top.name, category=category_of(words_for(top, meshes)), role="object", asset=made[0],
                     world=back, content=made[1])


def _asset(scene: _Scene, group: Group, relative: list[np.ndarray], rounds: dict[int, int]) -> tuple[Asset, str] | str:
    """The asset of a thing in the frame of its root and its digest, or why there is none."""
    top, meshes = group
    parts = [part for mesh, matrix in zip(meshes, relative, strict=True)
             for part in scene.taken.parts(mesh.prim, mesh.name, matrix, rounds=rounds[id(mesh)])]
    materials = scene.taken.materials
    for index in {part.material for part in parts if part.material >= 0} - set(scene.contents):
        scene.contents[index] = made_of(materials[index].file.material)
    triangles = sum(len(part.faces) for part in parts)
    model = FileModel(
        parts=tuple(parts),
        materials=tuple(replace(each.file, content=scene.contents.get(index, "")) for index, each in
                        enumerate(materials)),
        contains=f"{counted(len(meshes), 'mesh prim')}, {counted(triangles, 'triangle')}")
    name = top.name.rpartition("/")[2]
    try:
        return thing_asset(model, scene.world, name=name, category=category_of(words_for(top, meshes)),
                           licence=scene.source.licence)
    except UserError as error:
        return error.problems[0].rule
