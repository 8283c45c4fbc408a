"""Mesh files that a spec names: where they are, what belongs to them, and the digest of all of it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from dataset_builder.digest import digest, sha256_file
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference, is_inside
from dataset_builder.spec.gltf_references import gltf_references
from dataset_builder.spec.obj_references import obj_references
from dataset_builder.spec.problems import shown

REFERENCES: dict[str, Callable[[Path], Iterable[FileReference]]] = {
    ".glb": gltf_references, ".gltf": gltf_references, ".obj": obj_references, ".ply": lambda path: ()}
"""What finds the files that a mesh file names, by its suffix."""
MESH_SUFFIXES = tuple(REFERENCES)



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


def references(path: Path) -> tuple[FileReference, ...]:
    """The files that a mesh file names, such as buffers, textures and material libraries; each need not be there.

    Raises ValueError where the mesh file cannot be understood that far or names a file outside of its folder, OSError
    where it cannot be read.
    """
    found = tuple(REFERENCES[path.suffix.lower()](path))
    for reference in found:
        if not is_inside(path.parent, reference.name):
            raise ValueError(f"{reference.key}: expected a file in the folder of the mesh or below it, got "
                             f"{shown(reference.written)}")
    return found


def companions(path: Path) -> tuple[str, ...]:
    """Names of the files that a mesh file needs, relative to it, each once; raises as `references` does."""
    return tuple(sorted({reference.name for reference in references(path)}))


def mesh_source(path: Path, names: tuple[str, ...]) -> MeshSource:
    """The mesh file and its companions with their digests. Raises OSError where one cannot be read."""
    digests = {name: sha256_file(path.parent / name, most=MOST_BYTES) for name in sorted(names)}
    return MeshSource(path=path.resolve(), sha256=sha256_file(path, most=MOST_BYTES),
                      companions=MappingProxyType(digests))
