"""Nodes of a glTF file -> where each mesh is placed: matrices, scenes, instances, skins (glTF 2.0, section 3.5)."""

from dataclasses import dataclass

import numpy as np

from dataset_builder.assets.file_model import counted
from dataset_builder.assets.readers.gltf_accessors import read_numbers
from dataset_builder.assets.readers.gltf_file import GltfFile
from dataset_builder.assets.readers.gltf_values import Entry

INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"


@dataclass(frozen=True, kw_only=True, eq=False)
class Placement:
    """A mesh at all the places where one node puts it."""

    node: Entry
    number: int
    """Of the node."""
    mesh: int
    places: np.ndarray
    """(N, 4, 4) from mesh to file coordinates."""
    within: np.ndarray
    """(N, 4, 4) from mesh to node."""
    joints: np.ndarray | None = None
    """(J, 4, 4) of a skin's joints, from mesh to file coordinates; they replace `places`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NodeTree:
    """The N nodes of a file, and which of them the scene shows."""

    parents: np.ndarray
    """(N,) -1 for none."""
    order: tuple[int, ...]
    """All of them, parents first."""
    own: np.ndarray
    """(N, 4, 4) from each node to its parent."""
    worlds: np.ndarray
    """(N, 4, 4) from each node to the file."""
    shown: np.ndarray
    """(N,) whether it is in the scene that is read."""
    hidden: np.ndarray
    """(N,) whether it, or one above it, says that it is not seen."""
    decided: tuple[str, ...]
    """Which scene was taken, in words."""

    def is_drawn(self, number: int) -> bool:
        """Whether a node is there."""
        return bool(self.shown[number] and not self.hidden[number])


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """What the scene places, and what it leaves aside."""

    placements: tuple[Placement, ...]
    """In order of their nodes."""
    left_out: tuple[str, ...]
    decided: tuple[str, ...]
    """Which scene and which pose were taken, in words."""


def node_tree(gltf: GltfFile) -> NodeTree:
    """The nodes of the scene that the file says, or else its first. Raises UserError for nodes in circles."""
    parents = _parents(gltf)
    order = _order(gltf, parents)
    own = np.array([_local(node) for node in gltf.lists["nodes"]]).reshape(-1, 4, 4)
    shown, decided = _shown(gltf, parents, order)
    return NodeTree(parents=parents, order=tuple(order), own=own, worlds=_worlds(own, parents, order), shown=shown,
                    hidden=_hidden(gltf, parents, order), decided=tuple(decided))


def place_meshes(gltf: GltfFile, tree: NodeTree) -> Placed:
    """Every mesh that a node of the tree puts somewhere. Raises UserError."""
    placements, outside, unseen = [], 0, 0
    for number, node in enumerate(gltf.lists["nodes"]):
        mesh = node.index("mesh", gltf.lists["meshes"], "meshes")
        outside += mesh is not None and not tree.shown[number]
        unseen += mesh is not None and tree.shown[number] and tree.hidden[number]
        if mesh is not None and tree.is_drawn(number):
            within = _instances(gltf, node)
            placements.append(Placement(node=node, number=number, mesh=mesh, places=tree.worlds[number] @ within,
                                        within=within, joints=_joints(gltf, node, tree.worlds)))
    left_out = [f"{counted(amount, 'node')} with a mesh {why}" for amount, why in
                ((outside, "in no scene that is read"), (unseen, "that the file hides")) if amount]
    skinned = any(placement.joints is not None for placement in placements)
    pose = ["skins in the pose that the nodes of the file have"] if skinned else []
    return Placed(placements=tuple(placements), left_out=tuple(left_out), decided=(*tree.decided, *pose))


def _parents(gltf: GltfFile) -> np.ndarray:
    """(N,) the parent of every node, -1 for none."""
    nodes = gltf.lists["nodes"]
    parents = np.full(len(nodes), -1)
    for number, node in enumerate(nodes):
        for child in node.indices("children", nodes):
            if parents[child] >= 0:
                node.refuse(f"expected nodes with one parent, got nodes[{child}] below nodes[{parents[child]}], too",
                            key="children")
            parents[child] = number
    return parents


def _order(gltf: GltfFile, parents: np.ndarray) -> list[int]:
    """All nodes, parents first. Raises UserError where they go in circles."""
    nodes = gltf.lists["nodes"]
    order = np.flatnonzero(parents < 0).tolist()
    for number in order:  # grows as it goes
        order += nodes[number].indices("children", nodes)
    if len(order) < len(nodes):
        circle = min(set(range(len(nodes))) - set(order))
        nodes[circle].refuse("expected nodes that end somewhere, got one that is below itself", key="children")
    return order


def _worlds(own: np.ndarray, parents: np.ndarray, order: list[int]) -> np.ndarray:
    """(N, 4, 4) from every node's to file coordinates."""
    worlds = own.copy()
    for number in order:
        if parents[number] >= 0:
            worlds[number] = worlds[parents[number]] @ own[number]
    return worlds


def _local(node: Entry) -> np.ndarray:
    """(4, 4) of one node: its matrix, which stands by columns, or translation times rotation times scale."""
    if node.has("matrix"):
        if any(node.has(key) for key in ("translation", "rotation", "scale")):
            node.refuse("expected a matrix, or translation, rotation and scale, got both")
        matrix = node.numbers("matrix", (), count=16).reshape(4, 4).T
        if not np.allclose(matrix[3], (0, 0, 0, 1)):
            node.refuse(f"expected an affine matrix, got a last row of {matrix[3].tolist()}", key="matrix")
        return matrix
    return composed(node.numbers("translation", (0, 0, 0))[None], node.numbers("rotation", (0, 0, 0, 1))[None],
                    node.numbers("scale", (1, 1, 1))[None])[0]


def composed(translation: np.ndarray, rotation: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(N, 4, 4) of (N, 3) translations, (N, 4) quaternions xyzw, made unit ones, and (N, 3) scales."""
    length = np.linalg.norm(rotation, axis=1, keepdims=True)
    x, y, z, w = np.where(length > 0, rotation / np.where(length > 0, length, 1), (0, 0, 0, 1)).T
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    made = np.tile(np.eye(4), (len(scale), 1, 1))
    made[:, :3, :3] = np.moveaxis(turn, 2, 0) * scale[:, None, :]
    made[:, :3, 3] = translation
    return made


def _instances(gltf: GltfFile, node: Entry) -> np.ndarray:
    """(N, 4, 4) of EXT_mesh_gpu_instancing, from mesh to node; one identity without it."""
    found = node.extension(INSTANCING)
    if found is None:
        return np.eye(4)[None]
    attributes = found.entry("attributes")
    columns = {}
    for key, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3")):
        if (index := attributes.index(key, gltf.lists["accessors"], "accessors")) is not None:
            columns[key] = read_numbers(gltf, index, kind)
    counts = {len(values) for values in columns.values()}
    if len(counts) != 1:
        attributes.refuse(f"expected TRANSLATION, ROTATION or SCALE, all as long, got lengths {sorted(counts)}")
    count = counts.pop()
    return composed(columns.get("TRANSLATION", np.zeros((count, 3))),
                    columns.get("ROTATION", np.tile((0.0, 0.0, 0.0, 1.0), (count, 1))),
                    columns.get("SCALE", np.ones((count, 3))))


def _joints(gltf: GltfFile, node: Entry, worlds: np.ndarray) -> np.ndarray | None:
    """(J, 4, 4): a joint's place times its inverse bind matrix (section 3.7.3.2); None without a skin."""
    number = node.index("skin", gltf.lists["skins"], "skins")
    if number is None:
        return None
    skin = gltf.lists["skins"][number]
    joints = skin.indices("joints", gltf.lists["nodes"])
    if not joints:
        skin.refuse("expected at least one joint", key="joints")
    index = skin.index("inverseBindMatrices", gltf.lists["accessors"], "accessors")
    if index is None:
        return worlds[joints]
    binds = read_numbers(gltf, index, "MAT4").reshape(-1, 4, 4).transpose(0, 2, 1)
    if len(binds) < len(joints):
        skin.refuse(f"expected {len(joints)} matrices, got {len(binds)}", key="inverseBindMatrices")
    return worlds[joints] @ binds[:len(joints)]


def _shown(gltf: GltfFile, parents: np.ndarray, order: list[int]) -> tuple[np.ndarray, list[str]]:
    """(N,) bool, whether a node is in the scene that is read, and what was decided about scenes."""
    nodes, scenes = gltf.lists["nodes"], gltf.lists["scenes"]
    shown = np.zeros(len(nodes), bool)
    chosen = gltf.root.index("scene", scenes, "scenes")
    if not scenes:
        return ~shown, ["no scene in the file: all nodes are taken"] if len(nodes) else []
    shown[scenes[chosen or 0].indices("nodes", nodes)] = True
    for number in order:
        shown[number] |= parents[number] >= 0 and shown[parents[number]]
    if len(scenes) == 1:
        return shown, []
    others = ", ".join(scene.title for number, scene in enumerate(scenes) if number != (chosen or 0))
    return shown, [f"{scenes[chosen or 0].title} is taken, not {others}"]


def _hidden(gltf: GltfFile, parents: np.ndarray, order: list[int]) -> np.ndarray:
    """(N,) bool: KHR_node_visibility hides a node and all below it."""
    hidden = np.zeros(len(parents), bool)
    for number in order:
        found = gltf.lists["nodes"][number].extension(VISIBILITY)
        above = bool(parents[number] >= 0 and hidden[parents[number]])
        hidden[number] = above or (found is not None and not found.flag("visible", True))
    return hidden

