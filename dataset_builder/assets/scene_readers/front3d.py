"""3D-FRONT scenes with 3D-FUTURE models -> SceneModel.

H. Fu et al., "3D-FRONT: 3D Furnished Rooms with layOuts and semaNTics", ICCV 2021; "3D-FUTURE: 3D Furniture shape with
TextURE", IJCV 2021. What the files are known to get wrong is lived with and listed: docs/scenes.md.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.mesh_file import scaled_world
from dataset_builder.assets.scene_model import Role, SceneModel, SceneThing
from dataset_builder.assets.scene_readers.front3d_building import FrontBuilding, front_role
from dataset_builder.assets.scene_readers.front3d_json import FrontScene, Names, read_front3d
from dataset_builder.assets.scene_readers.front3d_models import (
    LONGEST,
    WORLD_FROM_FRONT,
    FrontCategory,
    FrontModel,
    FrontModels,
    category_word,
    model_categories,
)
from dataset_builder.assets.scene_readers.front3d_overlaps import overlaps
from dataset_builder.assets.scene_readers.front3d_values import FaultNotes, SceneFault
from dataset_builder.assets.scene_readers.roles import said_role
from dataset_builder.errors import printable
from dataset_builder.geometry.mesh import transform
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.problems import name_alike

LARGE = 5.0
"""Scale that pieces of furniture seldom have (ATISS drops rooms with larger ones)."""
MOST_THINGS, MOST_PIECES = 20_000, 2_000
"""Children of rooms of a scene, and pieces of furniture up to which overlaps are looked for; real houses have some
hundred."""
NAMED = 3
"""Faults of a kind that are told one by one."""


def read(source: SceneSource, root: Path, max_texture: int) -> SceneModel:
    """The scene of a file with the models and textures of the folders that the source names.

    Raises UserError: no such file or folder, no JSON, no scene of 3D-FRONT, nothing in it.
    """
    path = root / source.source
    scene = read_front3d(path)
    if (children := sum(len(room.children) for room in scene.rooms)) > MOST_THINGS:
        refuse(path, f"expected at most {MOST_THINGS:,} things, got {children:,}")
    models, textures = (_folder(path, root, key, name) for key, name in
                        (("models", source.models), ("textures", source.textures)))
    house = _House(scene, FaultNotes(list(scene.faults)), models, textures, max_texture,
                   scaled_world(source.scale, "y"))
    things = tuple(replace(thing, role=said_role(thing.name, source) or thing.role) for thing in house.things())
    if not things:
        refuse(path, f"expected walls, floors or furniture, got a scene without any: {house.contains(things)}",
               "; ".join(fault_texts(house.notes.found)))
    pairs, in_walls = overlaps(things) if house.placed <= MOST_PIECES else ([], [])
    for kind, found in (("pieces of furniture that stand in each other, as they are", pairs),
                        ("pieces of furniture that stand in walls, as they are", in_walls)):
        for one, other in found:
            house.notes.add(kind, f"{one} and {other}")
    return SceneModel(things=things, lights=(), cameras=(), contains=house.contains(things),
                      left_out=tuple(house.left_out()), faults=tuple(fault_texts(house.notes.found)))


def fault_texts(faults: Iterable[SceneFault]) -> list[str]:
    """A sentence for each kind of fault, in the order in which kinds are met: how many, and the first few.

    >>> fault_texts([SceneFault("rugs that fly", "Hall/3", "2 m up"), SceneFault("rugs that fly", "Hall/4")])
    ['rugs that fly (2): Hall/3 (2 m up), Hall/4']
    """
    kinds: dict[str, list[SceneFault]] = {}
    for fault in faults:
        kinds.setdefault(fault.kind, []).append(fault)
    return [printable(f"{kind} ({len(found):,}): " + ", ".join(
        f"{fault.where} ({fault.said})" if fault.said else fault.where for fault in found[:NAMED])
        + (f" and {len(found) - NAMED:,} more" if len(found) > NAMED else "")) for kind, found in kinds.items()]


def _folder(scene: Path, root: Path, key: str, name: str) -> Path | None:
    """A folder that the source names, None for none."""
    if not name:
        return None
    folder = root / name
    if not folder.is_dir():
        refuse(scene, f"expected the folder of the {key} that the spec names, got none at {name}",
               name_alike(folder) or f"{key} is relative to the spec", at=key)
    return folder


@dataclass(eq=False)
class _House:
    """A scene on its way to things."""

    scene: FrontScene
    notes: FaultNotes
    models: Path | None
    textures: Path | None
    max_texture: int
    world_from_file: np.ndarray
    """(4, 4), with the scale that the spec gives."""
    categories: dict[str, FrontCategory] = field(default_factory=dict)
    unnamed: int = 0
    """Pieces of furniture, where the spec names no folder of models."""
    dark: Counter[str] = field(default_factory=Counter)
    """Lamps by category."""
    said: dict[str, str] = field(default_factory=dict)
    """What models say and is not honoured, by jid."""
    wanted: int = 0
    """Children of rooms that are pieces of furniture."""
    placed: int = 0
    """Those that are there."""
    kinds: set[str] = field(default_factory=set)
    """Their jids."""

    def things(self) -> Iterator[SceneThing]:
        """What stands in the rooms, then meshes that no room has, in the order of the file."""
        scene, names, used = self.scene, Names(), set[str]()
        self.building = FrontBuilding(scene, self.textures, self.max_texture, self.notes)
        library = None
        if self.models is not None:
            self.categories = model_categories(self.models, self.notes)
            library = FrontModels(self.models, self.max_texture, self.notes)
        placed: dict[tuple[str, bytes], str] = {}
        for room in scene.rooms:
            for child in room.children:
                matrix = self.world_from_file @ scene.matrix @ room.matrix @ child.matrix @ WORLD_FROM_FRONT.T
                key = child.ref, (np.round(matrix, 5) + 0.0).tobytes()
                if key in placed:
                    self.notes.add("things placed twice, the second left out", child.name, f"as {placed[key]}")
                    continue
                placed[key] = child.name
                used.add(child.ref)
                if child.ref in scene.meshes:
                    yield from self._part(child.ref, names.free(child.name), matrix)
                else:
                    yield from self._piece(child.ref, names.free(child.name), matrix, library)
            if not any(self._is_floor(child.ref) for child in room.children):
                self.notes.add("rooms without a floor", room.name, room.kind)
        for uid in scene.meshes:
            if uid not in used:
                self.notes.add("meshes of no room, in place", uid, scene.meshes[uid].kind)
                matrix = self.world_from_file @ scene.matrix @ WORLD_FROM_FRONT.T
                yield from self._part(uid, names.free(f"house/{uid}"), matrix)

    def _is_floor(self, ref: str) -> bool:
        return ref in self.scene.meshes and front_role(self.scene.meshes[ref].kind) == "floor"

    def _part(self, uid: str, name: str, matrix: np.ndarray) -> Iterator[SceneThing]:
        mesh = self.scene.meshes[uid]
        if model := self.building.model(mesh, name):
            yield _thing(model, name, mesh.kind.lower(), front_role(mesh.kind), matrix)

    def _piece(self, uid: str, name: str, matrix: np.ndarray, library: FrontModels | None) -> Iterator[SceneThing]:
        piece = self.scene.furniture[uid]
        self.wanted += 1
        listed = self.categories.get(piece.jid, FrontCategory("", ""))
        category = listed.category or category_word(piece.category)
        if not piece.valid:
            said = "not described" if piece.valid is None else "valid is false"
            self.notes.add("pieces of furniture that were not published, left out", name, f"{uid}, {said}")
        elif not piece.jid:
            self.notes.add("pieces of furniture without a model, left out", name, uid)
        elif library is None:
            self.unnamed += 1
        elif (model := library.model(piece, category)) is not None:
            if said := model.asset.meta["left_out"]:
                self.said.setdefault(piece.jid, said)
            scale = float(np.linalg.norm(matrix[:3, :3], axis=0).max())
            longest = float(max(transform(model.asset.mesh, matrix).size))
            if longest > LONGEST:
                self.notes.add("pieces of furniture longer than 10 m, left out", name,
                               f"{longest:.3g} m, scale {scale:.3g}")
                return
            if scale > LARGE:
                self.notes.add("pieces of furniture with scales above 5, as they are", name, f"{scale:.3g}")
            if "light" in f"{category} {listed.above}" or "lamp" in category:
                self.dark[category] += 1
            self.placed += 1
            self.kinds.add(piece.jid)
            yield _thing(model, name, category, "object", matrix)

    def contains(self, things: tuple[SceneThing, ...]) -> str:
        """For people."""
        triangles = sum(len(thing.asset.mesh.faces) for thing in things)
        return ", ".join((counted(len(self.scene.rooms), "room"),
                          f"{self.placed:,} of {counted(self.wanted, 'piece')} of furniture",
                          counted(len(self.kinds), "model"),
                          counted(len(things) - self.placed, "mesh of the building", "meshes of the building"),
                          counted(triangles, "triangle")))

    def left_out(self) -> Iterator[str]:
        """What is not honoured, and what was decided."""
        lamps = f": {', '.join(f'{number} {kind}' for kind, number in sorted(self.dark.items()))}" if self.dark else ""
        yield f"no lights: scenes of 3D-FRONT have none, and lamps give no light{lamps}"
        if self.placed > MOST_PIECES:
            yield f"overlaps, which are looked for among up to {MOST_PIECES:,} pieces of furniture"
        if self.unnamed:
            yield f"{counted(self.unnamed, 'piece')} of furniture: the spec names no folder of models"
        if self.building.unnamed:
            yield f"textures of {counted(self.building.unnamed, 'material')}: the spec names no folder of textures"
        if self.building.normal_maps:
            yield f"images of normals of {counted(self.building.normal_maps, 'material')}"
        if self.scene.views:
            yield f"{counted(self.scene.views, 'view')} in extension, which are no cameras of a known kind"
        if self.said:
            yield from fault_texts(SceneFault("models of which statements are not honoured", jid, said)
                                   for jid, said in self.said.items())


def _thing(model: FrontModel, name: str, category: str, role: Role, world: np.ndarray) -> SceneThing:
    return SceneThing(name=name, category=category, role=role, asset=model.asset, world=world, content=model.content)
