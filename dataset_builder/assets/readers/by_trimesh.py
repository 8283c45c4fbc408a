"""Interim: .obj and .ply by trimesh, until they have readers of their own."""

import io
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from dataset_builder.assets.asset import Material, Texture, reflectance_at
from dataset_builder.assets.file_model import GREY, ROUGHNESS, FileMaterial, FileModel, FilePart, refuse
from dataset_builder.assets.image_maps import ImageFile, linear_from_srgb, make_texture, read_texels
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.file_reference import FileReference
from dataset_builder.spec.mesh_source import references
from dataset_builder.spec.scene import MAX_SPECULAR

SOLID_GLASS, THIN_GLASS = (6, 7), (4, 9)
READER_ERRORS = (ArithmeticError, AssertionError, AttributeError, LookupError, NameError, NotImplementedError, OSError,
                 TypeError, ValueError, struct.error)
"""What trimesh's readers raise over files that do not keep their format."""


def read(path: Path, max_texture: int) -> FileModel:
    """The file as trimesh reads it."""
    parts: list[FilePart] = []
    materials: list[tuple[Any, Material]] = []
    for part, world_from_part in _parts(_read(path, references(path))):
        try:
            index = _material_index(part.visual, materials, max_texture)
        except OSError as error:
            raise _problem(path, f"expected readable textures, got: {error}") from error
        except (AttributeError, TypeError, ValueError) as error:
            raise _problem(path, f"expected materials in a valid format, got: {error}") from error
        parts.append(_part(part, path, index, world_from_part))
    found = tuple(FileMaterial(material=each) for _, each in materials)
    return FileModel(parts=tuple(parts), materials=found, contains=f"{len(parts)} parts")


def _problem(path: Path, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=str(path), path="", rule=rule, hint=hint)])


def _read(path: Path, named: Sequence[FileReference]) -> trimesh.Scene:
    try:
        return trimesh.load_scene(path, process=False, resolver=_Resolver(path, named))
    except READER_ERRORS as error:
        speechless = isinstance(error, AssertionError | NameError)
        detail = "data that ends early or breaks the format" if speechless else str(error) or type(error).__name__
        raise _problem(path, f"expected a readable {path.suffix.lower()} file, got: {detail}") from error


class _Resolver(trimesh.resolvers.FilePathResolver):
    """Files by what the mesh file says of them: an .mtl counts from its own folder."""

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


def _material_index(visual: Any, known: list[tuple[Any, Material]], max_texture: int) -> int:
    """Index of the visual's material among those `known`, which grow where it is new."""
    source = getattr(visual, "material", None)
    for index, (other, _) in enumerate(known):
        if source is not None and other is source:
            return index
    name = getattr(source, "name", None) or f"material_{len(known)}"
    known.append((source, file_material(visual, name=name, max_texture=max_texture)))
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


def file_material(visual: Any, *, name: str, max_texture: int) -> Material:
    """Material of a mesh's `visual` as trimesh gives it."""
    material = getattr(visual, "material", None)
    if hasattr(material, "kwargs"):
        return _wavefront(material, name, max_texture)
    return Material(name=name, base_color=_mean_color(visual), roughness=ROUGHNESS)


def _wavefront(material: Any, name: str, max_texture: int) -> Material:
    """MTL: Kd is linear; Ns is a Blinn-Phong exponent.

    The lobe of equal width has alpha = sqrt(2 / (Ns + 2)) (B. Walter et al., "Microfacet Models for Refraction through
    Rough Surfaces", EGSR 2007); roughness is the root of alpha.
    """
    extra = getattr(material, "kwargs", {}) or {}
    diffuse = getattr(material, "diffuse", None)
    color = extra.get("kd", (GREY,) * 3 if diffuse is None else np.asarray(diffuse) / 255)
    exponent = extra.get("ns")
    roughness = ROUGHNESS if exponent is None else (2 / (max(float(exponent), 0.0) + 2)) ** 0.25
    texture = _texture(getattr(material, "image", None), max_texture)
    plain = Material(name=name, base_color=_triple(color), roughness=_share(roughness), texture=texture)
    return _wavefront_glass(plain, extra)


def _wavefront_glass(material: Material, extra: dict[str, Any]) -> Material:
    """MTL's illumination models of glass: 6 and 7 refract and are solid, 4 and 9 bend no light and are thin.

    d (or 1 - Tr) is what stays opaque; glass that refracts is often written with a d of 1, which then means nothing.
    Tf, or a Kd that is not black, tints; Ni is the index of refraction. Other models keep no transparency.
    """
    model = int(_number(extra, "illum", 0))
    if model not in (*SOLID_GLASS, *THIN_GLASS):
        return material
    opaque = _number(extra, "d", 1 - _number(extra, "tr", 0))
    if opaque >= 1 and model in THIN_GLASS:
        return material
    ior = float(np.clip(_number(extra, "ni", 1.5), 1, 3))
    tint = extra.get("tf") or (material.base_color if any(material.base_color) else (1.0, 1.0, 1.0))
    return replace(material, transmission=_share(1 - opaque % 1), thin=model in THIN_GLASS, ior=ior,
                   specular=min(reflectance_at(ior), MAX_SPECULAR),
                   base_color=_triple([float(value) for value in tint]),
                   roughness=material.roughness if "ns" in extra else 0.0)


def _number(extra: dict[str, Any], key: str, default: float) -> float:
    """A number of an MTL file, which the reader leaves as a list of words."""
    value = extra.get(key, default)
    return float(value[-1] if isinstance(value, list) else value)


def _mean_color(visual: Any) -> tuple[float, float, float]:
    """Linear mean of sRGB vertex or face colours; grey where there are none."""
    if getattr(visual, "kind", None) not in ("vertex", "face"):
        return (GREY,) * 3
    colors = visual.vertex_colors if visual.kind == "vertex" else visual.face_colors
    return _triple(linear_from_srgb(np.asarray(colors)[:, :3] / 255).mean(axis=0))


def _texture(base: Image.Image | None, max_size: int) -> Texture | None:
    if base is None:
        return None
    stream = io.BytesIO()
    base.save(stream, "PNG")
    texels = read_texels(ImageFile(name="texture", content=stream.getvalue()), srgb=True, max_size=max_size)
    return make_texture({"base_color": texels[..., :3]})


def _triple(color: Any) -> tuple[float, float, float]:
    red, green, blue = (_share(value) for value in np.atleast_1d(color)[:3])
    return red, green, blue


def _share(value: Any) -> float:
    return float(np.clip(value, 0, 1))
