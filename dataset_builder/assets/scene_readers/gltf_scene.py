"""glTF scenes -> things by the hierarchy of nodes, with the lights and cameras of the file."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Asset
from dataset_builder.assets.file_model import FileModel, counted, unique
from dataset_builder.assets.mesh_file import left_out_of
from dataset_builder.assets.readers.gltf import GltfReading, gltf_reading
from dataset_builder.assets.readers.gltf_nodes import NodeTree, Placed, Placement, node_tree, place_meshes
from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.assets.scene_readers.gltf_lights import LIGHTS, scene_cameras, scene_lights
from dataset_builder.assets.scene_readers.thing_assets import thing_asset
from dataset_builder.assets.scene_readers.thing_tree import TreeNode, category_in, thing_nodes
from dataset_builder.errors import UserError, printable
from dataset_builder.label.scene_source import SceneSource

MOST_NODES, DEEPEST = 200_000, 100
"""Nodes of a file, and how far they may nest."""
MOST_THINGS = 10_000
MOST_TRIANGLES = 50_000_000
"""Of all things, wherever they stand."""
FLATTEST = 1e-9
"""Share of its scale, cubed, that a matrix has to keep of a volume; of others the mesh is moved itself."""
FARTHEST = 1e7
"""Metres from the origin."""


def read_gltf_scene(path: Path, source: SceneSource, roots: tuple[Path, ...], world_from_file: np.ndarray,
                    max_texture: int) -> SceneModel:
    """The scene that a glTF file shows; every thing is an `object` yet. Raises UserError."""
    with gltf_reading(path, max_texture, roots, besides=frozenset({LIGHTS})) as reading:
        tree = node_tree(reading.gltf)
        _check_nodes(reading, tree)
        placed = place_meshes(reading.gltf, tree)
        paths = node_paths(reading, tree)
        taking = _Taking(reading, tree, placed, paths, source, world_from_file)
        things = tuple(taking.things())
        lights, light_notes = scene_lights(reading.gltf, tree, paths, world_from_file)
        cameras, camera_notes = scene_cameras(reading.gltf, tree, paths, world_from_file)
        contains = [counted(len(things), "thing"), counted(len(lights), "light"), counted(len(cameras), "camera"),
                    reading.contains(placed)]
        whole = FileModel(parts=(), materials=reading.used_materials(), contains=", ".join(contains),
                          left_out=(*reading.left_out(placed, ()), *light_notes, *camera_notes))
        return SceneModel(things=things, lights=lights, cameras=cameras, contains=whole.contains,
                          left_out=tuple(left_out_of(whole)), faults=tuple(taking.faults))


def _check_nodes(reading: GltfReading, tree: NodeTree) -> None:
    if len(tree.parents) > MOST_NODES:
        reading.gltf.root.refuse(f"expected at most {MOST_NODES:,} nodes, got {len(tree.parents):,}", key="nodes")
    depth = np.zeros(len(tree.parents), np.int64)
    for number in tree.order:
        parent = tree.parents[number]
        depth[number] = depth[parent] + 1 if parent >= 0 else 1
        if depth[number] > DEEPEST:
            reading.gltf.lists["nodes"][number].refuse(f"expected nodes that nest at most {DEEPEST} deep, got one "
                                                       "deeper", "export the scene with a flatter hierarchy")


def node_paths(reading: GltfReading, tree: NodeTree) -> list[str]:
    """A unique path of names for every node: `Room/Chair`; the second of a name is `Room/Chair_2`."""
    lists = reading.gltf.lists
    paths, taken = [""] * len(tree.parents), set[str]()
    for number in tree.order:
        node, parent = lists["nodes"][number], tree.parents[number]
        mesh = node.index("mesh", lists["meshes"], "meshes")
        name = node.text("name") or (lists["meshes"][mesh].text("name") if mesh is not None else "") or f"node_{number}"
        path = f"{paths[parent]}/" * bool(parent >= 0) + printable(name)
        paths[number] = unique(path, taken)
    return paths


@dataclass(eq=False)
class _Taking:
    """Things on their way out of a file."""

    reading: GltfReading
    tree: NodeTree
    placed: Placed
    paths: list[str]
    source: SceneSource
    world_from_file: np.ndarray
    faults: list[str] = field(default_factory=list)
    made: dict[object, tuple[Asset, str] | UserError] = field(default_factory=dict)
    """What was made of which nodes at which places."""
    count: int = 0
    triangles: int = 0

    def things(self) -> Iterator[SceneThing]:
        """All of them, in the order of the file."""
        by_node = {placement.number: placement for placement in self.placed.placements}
        nodes = [TreeNode(path=path, name=path.rpartition("/")[2], parent=int(parent), drawn=number in by_node)
                 for number, (path, parent) in enumerate(zip(self.paths, self.tree.parents, strict=True))]
        patterns = [pattern for part in self.source.parts for pattern in part.patterns]
        for root, numbers in thing_nodes(nodes, self.tree.order, patterns, lambda n: self._box(by_node[n])).items():
            yield from self._things_at(root, [by_node[number] for number in numbers])

    def _box(self, placement: Placement) -> np.ndarray:
        """(2, 3) corners of what a node places."""
        counted_before = self.reading.corners
        ends = np.array([[part.positions.min(axis=0), part.positions.max(axis=0)]
                         for part in self.reading.parts(placement)]).reshape(-1, 2, 3)
        self.reading.corners = counted_before
        return np.stack([ends[:, 0].min(axis=0, initial=np.inf), ends[:, 1].max(axis=0, initial=-np.inf)])

    def _things_at(self, root: int, placements: list[Placement]) -> Iterator[SceneThing]:
        """The thing of a node, or as many as it has instances."""
        first = placements[0]
        worlds = self.tree.worlds[root][None]
        if len(placements) == 1 and first.joints is None and (first.number == root or len(first.places) == 1):
            worlds, placements = first.places, [replace(first, places=np.eye(4)[None])]
        else:
            placements = [replace(each, places=places) for each, places in zip(
                placements, self._relative(root, placements), strict=True)]
        for number, world in enumerate(worlds, start=1):
            name = self.paths[root] + f"#{number}" * (len(worlds) > 1)
            flat = abs(np.linalg.det(world[:3, :3])) <= FLATTEST * np.linalg.norm(world[:3, :3]) ** 3
            if flat or any(each.joints is not None for each in placements):
                # Joints, and what has no way back, are told in the coordinates of the file
                moved = [replace(each, places=world @ each.places) for each in placements]
                yield from self._thing(name, root, moved, np.eye(4))
            else:
                yield from self._thing(name, root, placements, world)

    def _relative(self, root: int, placements: list[Placement]) -> Iterator[np.ndarray]:
        """(N, 4, 4) from the mesh of each placement to the node `root` above it, step by step: equal hierarchies come
        to equal numbers."""
        for each in placements:
            number, steps = each.number, np.eye(4)
            while number != root:
                steps = self.tree.own[number] @ steps
                number = int(self.tree.parents[number])
            yield steps @ each.within

    def _thing(self, name: str, root: int, placements: list[Placement], world: np.ndarray) -> Iterator[SceneThing]:
        key = tuple((each.mesh, each.places.tobytes(), str(each.node.value.get("weights")),
                     each.number if each.joints is not None else -1) for each in placements)
        if key not in self.made:
            self.made[key] = self._made(name, placements)
        made = self.made[key]
        if isinstance(made, UserError):
            self.faults.append(f"{name}: {made.problems[0].rule}: left out")
            return
        asset, content = made
        self.count, self.triangles = self.count + 1, self.triangles + len(asset.mesh.faces)
        self._check_size(root, asset, world)
        turn = self.world_from_file
        # Things that share what they are made of may be called differently
        yield SceneThing(name=name, category=category_in(name, *self._words(placements)), role="object", asset=asset,
                         content=content, world=turn @ world @ np.linalg.inv(turn))

    def _made(self, name: str, placements: list[Placement]) -> tuple[Asset, str] | UserError:
        parts = tuple(part for each in placements for part in self.reading.parts(each))
        if not parts:
            return UserError("expected triangles, got none")
        model = FileModel(parts=parts, materials=self.reading.used_materials(), contains="")
        try:
            return thing_asset(model, self.world_from_file, name=name, licence=self.source.licence,
                               category=category_in(name, *self._words(placements)))
        except UserError as error:
            return error

    def _words(self, placements: list[Placement]) -> Iterator[str]:
        """What may tell the kind of a thing where its own path does not: its pieces and their meshes."""
        yield from (self.paths[each.number] for each in placements)
        yield from (self.reading.gltf.lists["meshes"][each.mesh].text("name") for each in placements)

    def _check_size(self, root: int, asset: Asset, world: np.ndarray) -> None:
        node = self.reading.gltf.lists["nodes"][root]
        if self.count > MOST_THINGS or self.triangles > MOST_TRIANGLES:
            node.refuse(f"expected at most {MOST_THINGS:,} things of {MOST_TRIANGLES:,} triangles in all, got more",
                        "name groups of nodes in `parts`, so that each is one thing, or export less of the scene")
        ends = self.world_from_file @ world @ np.linalg.inv(self.world_from_file) @ np.append(
            np.abs(asset.mesh.bounds).max(axis=0), 1)
        if not (np.abs(world) < FARTHEST).all() or not (np.abs(ends) < FARTHEST).all():
            node.refuse(f"expected it within {FARTHEST:g} m of the origin", "check its transforms, and `scale`")
