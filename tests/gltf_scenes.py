"""Scenes as glTF files, written in code, and datasets of them, for tests of scenes from files."""

import base64
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Matrix = Sequence[Sequence[float]]
WORLD_FROM_FILE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""glTF has Y up."""
BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
"""A box of one metre that stands on z = 0."""
WEDGE = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 1.0]])
WEDGE_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
"""A corner without any symmetry but one, so that mirrors show."""


def at(x: float, y: float, z: float = 0.0, size: Sequence[float] = (1, 1, 1), yaw: float = 0.0) -> np.ndarray:
    """(4, 4) scaled, turned about +Z, and moved."""
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag(size)
    matrix[:3, 3] = x, y, z
    return matrix


def thing(name: str, world: np.ndarray, color: Sequence[float] = (0.6, 0.5, 0.4), positions: np.ndarray = BOX,
          faces: np.ndarray = FACES) -> dict[str, Any]:
    """A thing with a mesh of its own; metres, Z up."""
    return {"name": name, "world": world, "color": color, "positions": positions, "faces": faces}


ROOM = (thing("Floor", at(0, 0, -0.1, (4, 4, 0.1)), (0.5, 0.45, 0.4)),
        thing("Wall_back", at(0, 2.05, 0, (4, 0.1, 2.5)), (0.7, 0.7, 0.7)),
        thing("Wall_left", at(-2.05, 0, 0, (0.1, 4, 2.5)), (0.7, 0.7, 0.7)))
"""A floor and two walls, without a ceiling."""
CHAIR = thing("Chair_01", at(-0.7, 0.2, 0, (0.5, 0.5, 0.9), 30), (0.7, 0.2, 0.1))
TABLE = thing("Table", at(0.7, 0.0, 0, (0.9, 0.6, 0.7), -15), (0.2, 0.3, 0.7))
SCENE = (*ROOM, CHAIR, TABLE)


def write_gltf(path: Path, things: Sequence[Mapping[str, Any]]) -> Path:
    """A glTF file with everything in it; things that share arrays share a mesh."""
    data, views, accessors, meshes, materials, nodes = b"", [], [], [], [], []  # type: ignore[var-annotated]
    known: dict[tuple[int, int, tuple[float, ...]], int] = {}
    for each in things:
        key = id(each["positions"]), id(each["faces"]), tuple(each["color"])
        if key not in known:
            known[key] = len(meshes)
            points = (each["positions"] @ WORLD_FROM_FILE[:3, :3]).astype("<f4")
            for array, kind, component in ((points, "VEC3", 5126), (each["faces"].astype("<u4"), "SCALAR", 5125)):
                views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
                accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind,
                                  "count": len(array) if kind == "VEC3" else array.size})
                data += array.tobytes()
            accessors[-2] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
            materials.append({"name": f"paint {len(materials)}", "pbrMetallicRoughness": {
                "baseColorFactor": [*each["color"], 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}})
            meshes.append({"primitives": [{"attributes": {"POSITION": len(accessors) - 2},
                                           "indices": len(accessors) - 1, "material": len(materials) - 1}]})
        local = np.linalg.inv(WORLD_FROM_FILE) @ each["world"] @ WORLD_FROM_FILE
        nodes.append({"name": each["name"], "mesh": known[key], "matrix": local.T.ravel().tolist()})
    document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [*range(len(nodes))]}], "nodes": nodes,
                "meshes": meshes, "materials": materials, "accessors": accessors, "bufferViews": views,
                "buffers": [{"byteLength": len(data),
                             "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(document))
    return path


DATASET = """\
name: stage
seed: 3
image: {width: 24, height: 20}
layers: {i_s: frame, i_t: frame, s_prime: object, mask: object, mask_rough: object, instance: object, depth: frame}
render: {spp: 8, max_depth: 3}
rough: {sigma: [0.005], edge_length: 0.2, rounds: 0}
camera: {elevation: {uniform: [15, 40]}, coverage: [0.05, 0.5]}
splits:
  - name: train
    objects: {things: {name: "*"}, count: 2}
    scenes: {count: 1, from: [scene.yaml]}
"""
SPEC = "file:\n  path: stage.gltf\n  licence: CC-BY-4.0\n"


def write_dataset(folder: Path, things: Sequence[Mapping[str, Any]] = SCENE, dataset: str = DATASET,
                  **files: str) -> Path:
    """A dataset whose scene is a file; `files` are more spec files, by name without `.yaml`."""
    write_gltf(folder / "stage.gltf", things)
    for name, text in {"dataset": dataset, "scene": SPEC, **files}.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "dataset.yaml"
