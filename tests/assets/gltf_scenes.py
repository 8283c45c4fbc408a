"""Scenes written as glTF in code, for tests: assets of ours at nodes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.mesh_file import WORLD_FROM_FILE
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.label.scene_source import SceneSource
from tests.assets.gltf_files import GltfMaker

FILE_FROM_WORLD = np.eye(4)
FILE_FROM_WORLD[:3, :3] = WORLD_FROM_FILE["y"].T


def box_mesh(low: Sequence[float], high: Sequence[float]) -> TriangleMesh:
    """A closed box, wound outwards."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return TriangleMesh(positions=corners, faces=faces, uvs=np.zeros((12, 3, 2)), material=np.zeros(12))


def box_asset(low: Sequence[float], high: Sequence[float]) -> Asset:
    return Asset(name="box", category="", mesh=box_mesh(low, high),
                 materials=(Material(name="m", base_color=(1, 1, 1)),))


def plain(asset: Asset) -> Asset:
    """The asset with the factors of its materials that glTF has without extensions, and no textures."""
    materials = tuple(Material(name=each.name, base_color=each.base_color, roughness=each.roughness,
                               metallic=each.metallic) for each in asset.materials)
    return Asset(name=asset.name, category=asset.category, mesh=asset.mesh, materials=materials)


def add_mesh(made: GltfMaker, asset: Asset, **more: Any) -> int:
    """A mesh with a primitive for each material, in the file's axes: Y up."""
    mesh = transform(asset.mesh, FILE_FROM_WORLD)
    primitives = []
    for index, material in enumerate(asset.materials):
        faces = mesh.faces[mesh.material == index]
        if len(faces):
            factors = {"baseColorFactor": [*material.base_color, 1], "roughnessFactor": material.roughness,
                       "metallicFactor": material.metallic}
            number = made.add("materials", name=material.name, doubleSided=True, pbrMetallicRoughness=factors)
            primitives.append(made.primitive(mesh.positions.astype(np.float32), faces.ravel().astype(np.uint32),
                                             material=number))
    return made.add("meshes", primitives=primitives, **more)


def matrix(world: np.ndarray) -> list[float]:
    """A matrix of the world as a node states it: in the file's axes, by columns."""
    moved: list[float] = (FILE_FROM_WORLD @ world @ FILE_FROM_WORLD.T).T.ravel().tolist()
    return moved


def placed(x: float = 0, y: float = 0, z: float = 0, *, linear: Any = None) -> np.ndarray:
    world = np.eye(4)
    world[:3, 3] = x, y, z
    if linear is not None:
        world[:3, :3] = linear
    return world


def load(path: Path, **source: Any) -> SceneModel:
    return load_scene(SceneSource(source=path.name, licence="CC0-1.0", **source), path.parent, max_texture=64)


def scene(made: GltfMaker, folder: Path, **source: Any) -> SceneModel:
    return load(made.write(folder / "a.glb"), **source)


def world_corners(things: Sequence[SceneThing]) -> np.ndarray:
    """(F, 3, 3) corners of all faces in the world."""
    return concatenate([transform(thing.asset.mesh, thing.world) for thing in things]).corners


def names(found: SceneModel, role: str = "") -> list[str]:
    return [thing.name for thing in found.things if role in ("", thing.role)]
