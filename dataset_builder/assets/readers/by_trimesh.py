"""Interim: every format by trimesh, until it has a reader of its own."""

import io
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.file_model import GREY, ROUGHNESS, FileMaterial, FileModel, FilePart, refuse
from dataset_builder.assets.image_maps import ImageFile, linear_from_srgb, make_texture, read_texels
from dataset_builder.assets.readers.gltf_extensions import Extended, extended, material_entries
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.file_reference import FileReference
from dataset_builder.spec.gltf_references import gltf_header
from dataset_builder.spec.mesh_source import references

GLTF_SUFFIXES = (".glb", ".gltf")
TEXTURES = ("baseColorTexture", "metallicRoughnessTexture")
Entries = dict[str | None, dict[str, Any]]
READER_ERRORS = (ArithmeticError, AssertionError, AttributeError, LookupError, NameError, NotImplementedError, OSError,
                 TypeError, ValueError, struct.error)
"""What trimesh's readers raise over files that do not keep their format."""


def read(path: Path, max_texture: int) -> FileModel:
    """The file as trimesh reads it."""
    parts: list[FilePart] = []
    materials: list[tuple[Any, Extended]] = []
    factors, entries = exact_factors(path), material_entries(path)
    for part, world_from_part in _parts(_read(path, references(path))):
        try:
            index = _material_index(part.visual, materials, (factors, entries), max_texture)
        except OSError as error:
            raise _problem(path, f"expected readable textures, got: {error}") from error
        except (AttributeError, TypeError, ValueError) as error:
            raise _problem(path, f"expected materials in a valid format, got: {error}") from error
        parts.append(_part(part, path, index, world_from_part))
    found = tuple(FileMaterial(material=each.material, left_out=each.left_out) for _, each in materials)
    return FileModel(parts=tuple(parts), materials=found, contains=f"{len(parts)} parts")


def _problem(path: Path, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=str(path), path="", rule=rule, hint=hint)])


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


def _read(path: Path, named: Sequence[FileReference]) -> trimesh.Scene:
    try:
        return trimesh.load_scene(path, process=False, resolver=_Resolver(path, named))
    except READER_ERRORS as error:
        speechless = isinstance(error, AssertionError | NameError)
        detail = "data that ends early or breaks the format" if speechless else str(error) or type(error).__name__
        raise _problem(path, f"expected a readable {path.suffix.lower()} file, got: {detail}") from error


class _Resolver(trimesh.resolvers.FilePathResolver):
    """Files by what the mesh file says of them: glTF encodes names."""

    def __init__(self, path: Path, named: Sequence[FileReference]):
        super().__init__(str(path), allow_anywhere=True)
        self._names = {reference.written: reference.name for reference in named}

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


def _part(part: trimesh.Trimesh, path: Path, material: int, world: np.ndarray) -> FilePart:
    """The part as the file has it. Raises UserError for vertices that are not finite."""
    positions, faces = np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces)
    bad = np.flatnonzero(~np.isfinite(positions).all(axis=1))
    if len(bad):
        refuse(path, f"expected finite vertices, got {len(bad)} with NaN or Inf, first at vertex {bad[0]}")
    uv = getattr(part.visual, "uv", None)
    uvs = {} if uv is None else {0: np.nan_to_num(np.asarray(uv, dtype=np.float64))[faces][..., :2]}
    order = [0, 2, 1] if np.linalg.det(world[:3, :3]) < 0 else [0, 1, 2]
    return FilePart(name="part", positions=positions @ world[:3, :3].T + world[:3, 3], faces=faces[:, order],
                    material=material, uvs={key: each[:, order] for key, each in uvs.items()})


def file_material(visual: Any, *, name: str, factors: dict[str, Any], max_texture: int) -> Material:
    """Material of a mesh's `visual` as trimesh gives it.

    factors: glTF's own numbers of this material where known; trimesh rounds colours to 8 bits. max_texture: texels.
    """
    material = getattr(visual, "material", None)
    if hasattr(material, "metallicFactor"):
        return _metallic_roughness(material, name, factors, max_texture)
    return Material(name=name, base_color=_mean_color(visual), roughness=ROUGHNESS)


def _metallic_roughness(material: Any, name: str, factors: dict[str, Any], max_texture: int) -> Material:
    """glTF 2.0, section 3.9.2: factors are linear and default to 1."""
    lost = [key for key in TEXTURES if key in factors and getattr(material, key) is None]
    if lost:
        raise UserError(f"material {name}: {', '.join(lost)}: expected PNG or JPEG images, got something else")
    rounded = 1.0 if material.baseColorFactor is None else np.asarray(material.baseColorFactor) / 255
    color = factors.get("baseColorFactor", np.broadcast_to(rounded, 4))
    texture = _texture(material.baseColorTexture, material.metallicRoughnessTexture, material.normalTexture,
                       max_texture)
    return Material(name=name, base_color=_triple(color), texture=texture,
                    roughness=_share(1.0 if material.roughnessFactor is None else material.roughnessFactor),
                    metallic=_share(1.0 if material.metallicFactor is None else material.metallicFactor))


def _mean_color(visual: Any) -> tuple[float, float, float]:
    """Linear mean of sRGB vertex or face colours; grey where there are none."""
    if getattr(visual, "kind", None) not in ("vertex", "face"):
        return (GREY,) * 3
    colors = visual.vertex_colors if visual.kind == "vertex" else visual.face_colors
    return _triple(linear_from_srgb(np.asarray(colors)[:, :3] / 255).mean(axis=0))


def _texture(base: Image.Image | None, surface: Image.Image | None, normal: Image.Image | None,
             max_size: int) -> Texture | None:
    maps: dict[str, np.ndarray] = {}
    if base is not None:
        maps["base_color"] = _decoded(base, True, max_size)[..., :3]
    if surface is not None:
        texels = _decoded(surface, False, max_size)
        maps |= {"roughness": texels[..., 1], "metallic": texels[..., 2]}
    if normal is not None:
        maps["normal"] = _decoded(normal, False, max_size)[..., :3]
    return make_texture(maps)


def _decoded(image: Image.Image, srgb: bool, max_size: int) -> np.ndarray:
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return read_texels(ImageFile(name="texture", content=stream.getvalue()), srgb=srgb, max_size=max_size)


def _triple(color: Any) -> tuple[float, float, float]:
    red, green, blue = (_share(value) for value in np.atleast_1d(color)[:3])
    return red, green, blue


def _share(value: Any) -> float:
    return float(np.clip(value, 0, 1))
