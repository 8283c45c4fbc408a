"""Mesh files that a spec names: where they are, what belongs to them, and the digest of all of it."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dataset_builder.digest import digest, sha256_file
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference, is_within
from dataset_builder.spec.gltf_references import gltf_references
from dataset_builder.spec.obj_references import obj_references
from dataset_builder.spec.ply_references import ply_references
from dataset_builder.spec.problems import shown
from dataset_builder.spec.usd_references import USD_SUFFIXES, usd_references

FIELD_SUFFIX = ".npz"
"""Of fields, whose meshes are read as any mesh is."""
SPLAT_FORMATS = {".spz": "SPZ", ".splat": "antimatter15's format", ".ksplat": "a format of GaussianSplats3D"}
"""Formats of Gaussian splats alone: how they are called, by suffix."""
SPLATS = ("KHR_gaussian_splatting", "ParticleField3DGaussianSplat")
"""What splats are called in formats that hold meshes too."""
MADE_OF_SPLATS = "make an object of its splats: `dataset-builder import capture FILE`"
SCALED_FIELD = "scale, turn and place it where it is made: `dataset-builder import capture`"
REFERENCES: dict[str, Callable[[Path], Iterable[FileReference]]] = {
    ".glb": gltf_references, ".gltf": gltf_references, ".obj": obj_references, ".off": lambda path: (),
    ".ply": ply_references, ".stl": lambda path: (), FIELD_SUFFIX: lambda path: (),
    **dict.fromkeys(USD_SUFFIXES, usd_references)}
"""What finds the files that a mesh file names, by its suffix."""
MESH_SUFFIXES = tuple(REFERENCES)
OTHER_FORMATS = {
    ".dae": ("COLLADA", "Blender"), ".fbx": ("FBX", "Blender"), ".3ds": ("3D Studio", "Blender"),
    ".blend": ("Blender's own format", "Blender, with File > Export > glTF 2.0"), ".x3d": ("X3D", "Blender"),
    ".wrl": ("VRML", "Blender"), ".abc": ("Alembic", "Blender"), ".ifc": ("IFC", "Blender with Bonsai"),
    ".step": ("STEP", "FreeCAD"), ".stp": ("STEP", "FreeCAD"), ".iges": ("IGES", "FreeCAD"),
    ".igs": ("IGES", "FreeCAD"), ".3mf": ("3MF", "Blender"), ".max": ("3ds Max's own format", "3ds Max"),
    ".skp": ("SketchUp's own format", "SketchUp")}
"""Formats that are not read: how they are called, and what exports glTF from them, by suffix."""


@dataclass(frozen=True, kw_only=True)
class MeshSource:
    """One mesh file on this machine."""

    path: Path
    sha256: str
    companions: Mapping[str, str]
    """SHA-256 of each file that it names (buffers, textures), by name."""

    def content(self) -> dict[str, Any]:
        """What the mesh holds, wherever it lies."""
        return {"sha256": self.sha256, "companions": dict(self.companions)}

    @property
    def digest(self) -> str:
        """SHA-256 over all that the mesh holds: another texel is another digest."""
        return digest(self.content())


def broken_suffix_rule(name: str) -> tuple[str, str]:
    """The rule that the suffix of a mesh file breaks, and a hint; both empty where it breaks none."""
    suffix = Path(name).suffix.lower()
    if suffix in MESH_SUFFIXES:
        return "", ""
    if suffix in SPLAT_FORMATS:
        called = SPLAT_FORMATS[suffix]
        hint = MADE_OF_SPLATS if suffix == ".spz" else "write the splats as .ply, with SuperSplat or splat-transform"
        return f"expected a mesh or a field, got {shown(name)}: {called} holds Gaussian splats", hint
    if suffix in OTHER_FORMATS:
        called, program = OTHER_FORMATS[suffix]
        return f"expected a format that is read, got {shown(name)}: {called} is not read", f"export glTF from {program}"
    return f"expected a file that ends in one of {' '.join(MESH_SUFFIXES)}, got {shown(name)}", ""


def splat_hint(said: Iterable[str]) -> str:
    """What to do with a file without a mesh that says this of itself; empty where none of it means splats."""
    return MADE_OF_SPLATS if any(name in text for text in said for name in SPLATS) else ""


def names_field(file: str) -> bool:
    """Whether a file is a field, by its suffix."""
    return Path(file).suffix.lower() == FIELD_SUFFIX


class OutsideError(ValueError):
    """A file is named that lies in none of the folders where it may."""


def references(path: Path, roots: Sequence[Path] = ()) -> tuple[FileReference, ...]:
    """The files that a mesh file names, such as buffers, textures and material libraries; each need not be there.

    roots: folders, beside its own, that they may lie in. Raises ValueError where the mesh file cannot be understood
    that far, OutsideError where it names a file outside of these, OSError where it cannot be read.
    """
    suffix = path.suffix.lower()
    found = usd_references(path, tuple(roots)) if suffix in USD_SUFFIXES else tuple(REFERENCES[suffix](path))
    for reference in found:
        if not is_within((path.parent, *roots), reference.name):
            inside = os.path.abspath(path.parent / reference.name).startswith(os.path.join(path.parent.absolute(), ""))
            raise OutsideError(f"{reference.key}: expected a file in the folder of the mesh or below it"
                               f"{', or in one of the roots' if roots else ''}, got {shown(reference.written)}"
                               f"{', a link that leads out of it' if inside else ''}")
    return found


def companions(path: Path, roots: Sequence[Path] = ()) -> tuple[str, ...]:
    """Names of the files that a mesh file needs, relative to it, each once; raises as `references` does."""
    return tuple(sorted({reference.name for reference in references(path, roots)}))


def mesh_source(path: Path, names: tuple[str, ...]) -> MeshSource:
    """The mesh file and its companions with their digests. Raises OSError where one cannot be read."""
    digests = {name: sha256_file(path.parent / name, most=MOST_BYTES) for name in sorted(names)}
    return MeshSource(path=path.resolve(), sha256=sha256_file(path, most=MOST_BYTES),
                      companions=MappingProxyType(digests))
