"""Mesh files (.glb .gltf .obj .ply) -> Asset."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from PIL import Image

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.file_materials import file_material
from dataset_builder.assets.gltf_extensions import Extended, extended, material_entries
from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.geometry.repair import RepairReport, repair
from dataset_builder.spec.mesh_source import GLTF_SUFFIXES, MESH_SUFFIXES, FileReference, gltf_header, references

Up = Literal["x", "y", "z"]
Entries = dict[str | None, dict[str, Any]]
READER_ERRORS = (ArithmeticError, AssertionError, AttributeError, LookupError, NameError, NotImplementedError, OSError,
                 TypeError, ValueError, struct.error)
"""What trimesh's readers raise over files that do not keep their format."""
WORLD_FROM_FILE: dict[Up, np.ndarray] = {
    "x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "y": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}
"""Rotations by the file's upward axis; with y up, glTF's front +Z comes to -Y."""


def checked_references(path: Path) -> tuple[FileReference, ...]:
    """The files that `path` refers to. Raises UserError that names every one which is not there or unreadable; the mesh
    reader would pass over a missing texture."""
    try:
        found = references(path)
    except ValueError as error:
        problem = Problem(where=str(path), path="", rule=f"expected a readable {path.suffix} file, got: {error}")
        raise UserError([problem]) from error
    problems = [problem for reference in found for problem in _problem_of(reference, path.parent / reference.name)]
    if problems:
        raise UserError(problems)
    return found


def _problem_of(reference: FileReference, file: Path) -> list[Problem]:
    """What is wrong with a `file` that is referred to, at most one problem; an image has to start like one."""
    where = str(reference.by)
    if not file.is_file():
        return [Problem(where=where, path=reference.key, rule=f"expected an existing file, got {file.name}, which is "
                        f"not in {file.parent}", hint="put it there, or export the model again with its textures")]
    if reference.image:
        try:
            Image.open(file).close()
        except OSError as error:
            return [Problem(where=where, path=reference.key, rule=f"expected a readable image, got: {error}")]
    return []


def exact_factors(path: Path) -> dict[str | None, dict[str, Any]]:
    """glTF's `pbrMetallicRoughness` of every material whose name, or lack of one, is its own; empty for other files.

    The mesh reader keeps colours in 8 bits.
    """
    if path.suffix.lower() not in GLTF_SUFFIXES:
        return {}
    materials = gltf_header(path).get("materials", [])
    names = [material.get("name") for material in materials]
    return {name: material.get("pbrMetallicRoughness", {}) for name, material in zip(names, materials, strict=True)
            if names.count(name) == 1}


def load_mesh_file(path: Path, *, name: str, category: str, licence: str, scale: float = 1.0, up: Up = "y",
                   max_texture: int = 1024) -> Asset:
    """The whole scene of a mesh file as one asset, every node where its transforms put it.

    scale: metres per file unit. up: axis of the file that points up. max_texture: longest side of a texture in texels.
    The mesh is welded and mended, centred over the origin and stood on z = 0; `meta` says how far it was moved, what
    was mended, and what of its materials was left out. Raises UserError: no such file, another format, unreadable, a
    texture that is missing, no faces, NaN or Inf.
    """
    path = Path(path)
    _check_file(path)
    named = checked_references(path)
    try:
        mesh, materials, mended, left_out = _scene(path, named, _world_from_file(scale, up), max_texture)
    except UserError as error:
        raise UserError([replace(problem, where=problem.where or str(path)) for problem in error.problems]) from error
    placed, moved = _stand(mesh)
    meta = {"licence": licence, "source": path.name, "moved": ", ".join(f"{step:.6g} m" for step in moved),
            "repair": f"{mended.welded} vertices welded, {mended.degenerate} degenerate and {mended.duplicate} "
                      "duplicate faces dropped", "left_out": left_out}
    return Asset(name=name, category=category, mesh=placed, materials=materials, meta=meta)


def _scene(path: Path, named: Sequence[FileReference], world_from_file: np.ndarray, max_texture: int) \
        -> tuple[TriangleMesh, tuple[Material, ...], RepairReport, str]:
    """Everything in the file as one mended mesh with its materials, and what of these was left out."""
    meshes: list[TriangleMesh] = []
    materials: list[tuple[Any, Extended]] = []
    factors, entries = exact_factors(path), material_entries(path)
    for part, world_from_part in _parts(_read(path, named)):
        try:
            index = _material_index(part.visual, materials, (factors, entries), max_texture)
        except OSError as error:
            raise _problem(path, f"expected readable textures, got: {error}") from error
        except (AttributeError, TypeError, ValueError) as error:
            raise _problem(path, f"expected materials in a valid format, got: {error}") from error
        meshes.append(transform(_triangles(part, path, index), world_from_part))
    if not sum(len(mesh.faces) for mesh in meshes):
        raise _problem(path, "expected triangles, got a file without any")
    mesh, report = repair(transform(concatenate(meshes), world_from_file))
    left_out = [f"{found.material.name}: {', '.join(found.left_out)}" for _, found in materials if found.left_out]
    return mesh, tuple(found.material for _, found in materials), report, "; ".join(left_out)


def _problem(path: Path, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=str(path), path="", rule=rule, hint=hint)])


def _check_file(path: Path) -> None:
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise _problem(path, f"expected a mesh file ({' '.join(MESH_SUFFIXES)}), got {path.suffix or 'no suffix'}")
    if not path.is_file():
        raise _problem(path, "expected an existing file, got none", "paths are relative to the spec that names them")


def _read(path: Path, named: Sequence[FileReference]) -> trimesh.Scene:
    try:
        return trimesh.load_scene(path, process=False, resolver=_Resolver(path, named))
    except READER_ERRORS as error:
        speechless = isinstance(error, AssertionError | NameError)
        detail = "data that ends early or breaks the format" if speechless else str(error) or type(error).__name__
        raise _problem(path, f"expected a readable {path.suffix.lower()} file, got: {detail}") from error


class _Resolver(trimesh.resolvers.FilePathResolver):
    """Files by what the mesh file says of them: glTF encodes names, and an .mtl counts from its own folder."""

    def __init__(self, path: Path, named: Sequence[FileReference]):
        super().__init__(str(path), allow_anywhere=True)
        # Of two libraries the reader takes the first
        self._names = {reference.written: reference.name for reference in reversed(named)}

    def get(self, name: str) -> bytes:
        """Content of a file by its name as written."""
        return super().get(self._names.get(name, name))


def _parts(scene: trimesh.Scene) -> Iterator[tuple[trimesh.Trimesh, np.ndarray]]:
    """Every mesh of the scene with its (4, 4) matrix, in order of node names."""
    for node in sorted(scene.graph.nodes_geometry):
        world_from_part, geometry = scene.graph[node]
        if isinstance(part := scene.geometry[geometry], trimesh.Trimesh) and len(part.faces):
            yield part, np.asarray(world_from_part)


def _material_index(visual: Any, known: list[tuple[Any, Extended]], said: tuple[Entries, Entries],
                    max_texture: int) -> int:
    """Index of the visual's material among those `known`, which grow where it is new. said: factors and whole entries
    of the file's materials, by name."""
    source = getattr(visual, "material", None)
    for index, (other, _) in enumerate(known):
        if source is not None and other is source:
            return index
    given = getattr(source, "name", None)
    name = given or f"material_{len(known)}"
    factors, entry = (by_name.get(given, {}) for by_name in said)
    known.append((source, extended(file_material(visual, name=name, factors=factors, max_texture=max_texture), entry)))
    return len(known) - 1


def _triangles(part: trimesh.Trimesh, path: Path, material: int) -> TriangleMesh:
    """The part as the file has it. Raises UserError for vertices that are not finite."""
    positions, faces = np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        raise _problem(path, f"expected finite vertices, got {len(bad)} with NaN or Inf, first at vertex {bad[0]}")
    uv = getattr(part.visual, "uv", None)
    uvs = np.zeros((len(faces), 3, 2)) if uv is None else np.nan_to_num(np.asarray(uv, dtype=np.float64))[faces]
    return TriangleMesh(positions=positions, faces=faces, uvs=uvs[..., :2], material=np.full(len(faces), material))


def _world_from_file(scale: float, up: Up) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * WORLD_FROM_FILE[up]
    return matrix


def _stand(mesh: TriangleMesh) -> tuple[TriangleMesh, np.ndarray]:
    """The mesh centred over the origin and standing on z = 0, and the (3,) metres it was moved."""
    low, high = mesh.bounds
    moved = np.array([*-(low + high)[:2] / 2, -low[2]])
    matrix = np.eye(4)
    matrix[:3, 3] = moved
    return transform(mesh, matrix), moved
