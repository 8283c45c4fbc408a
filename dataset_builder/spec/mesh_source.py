"""Mesh files that a spec names: where they are, what belongs to them, and the digest of all of it."""

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import unquote

from dataset_builder.digest import digest, open_regular, sha256_file
from dataset_builder.spec.problems import shown

MOST_BYTES = 2**31
"""Of a mesh, a buffer, or an image."""
MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
GLTF_SUFFIXES = (".glb", ".gltf")
MTL_MAPS = ("map_", "bump", "norm")
MTL_OPTION = re.compile(r"-(?:(?:mm|o|s|t)(?:\s+[-+]?[\d.]+(?:e[-+]?\d+)?(?=\s)){1,3}|[a-z]+\s+\S+)\s+", re.IGNORECASE)
"""An option before the file name of a texture map: up to three numbers, or one value."""


@dataclass(frozen=True, kw_only=True)
class FileReference:
    """A file that a mesh file needs."""

    by: Path
    """The file that names it, the mesh or its material library."""
    key: str
    """Where in `by`."""
    written: str
    """What stands there."""
    name: str
    """Its path relative to the folder of the mesh file."""
    image: bool
    """Whether it is a texture that is read."""


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
    """The files that a mesh file names: buffers and textures of glTF, .mtl and maps of .obj; each need not be there.

    Raises ValueError where the mesh file cannot be understood that far, OSError where it cannot be read.
    """
    if path.suffix.lower() in GLTF_SUFFIXES:
        return tuple(_gltf_references(path))
    return tuple(_obj_references(path)) if path.suffix.lower() == ".obj" else ()


def companions(path: Path) -> tuple[str, ...]:
    """Names of the files that a mesh file needs, relative to it, each once; raises as `references` does."""
    return tuple(sorted({reference.name for reference in references(path)}))


def mesh_source(path: Path, names: tuple[str, ...]) -> MeshSource:
    """The mesh file and its companions with their digests. Raises OSError where one cannot be read."""
    digests = {name: sha256_file(path.parent / name, most=MOST_BYTES) for name in sorted(names)}
    return MeshSource(path=path.resolve(), sha256=sha256_file(path, most=MOST_BYTES),
                      companions=MappingProxyType(digests))


def gltf_header(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf file, or the first chunk of a .glb file, which is its JSON (glTF 2.0, section 4.4).

    Raises ValueError where there is none.
    """
    with open_regular(path, most=MOST_BYTES) as stream:
        data = stream.read()
    if path.suffix.lower() == ".glb":
        if data[:4] != b"glTF":
            raise ValueError(f"expected it to start with glTF, got {data[:4]!r}")
        data = data[20:20 + int.from_bytes(data[12:16], "little")]
    try:
        header = json.loads(data)
    except RecursionError as error:
        raise ValueError("expected JSON that is not nested without end") from error
    if not isinstance(header, dict):
        raise ValueError("expected it to hold an object")
    for kind in ("buffers", "images", "materials"):
        _require_objects(kind, header.get(kind, []))
    return header


def _require_objects(kind: str, entries: Any) -> None:
    """Raise ValueError where entries of a glTF header are not what all who read it take them for."""
    parts = [*entries] if isinstance(entries, list) else [entries]
    for entry in [*parts]:
        if kind == "materials" and isinstance(entry, dict):
            parts += [entry.get("pbrMetallicRoughness", {}), entry.get("extensions", {})]
            if not isinstance(entry.get("name", ""), str):
                raise ValueError(f"expected a material's name to be text, got {shown(entry['name'])}")
    if wrong := [part for part in parts if not isinstance(part, dict)]:
        raise ValueError(f"expected {kind} to be objects, got {shown(wrong[0])}")


def _gltf_references(path: Path) -> Iterator[FileReference]:
    """External `uri`s of a glTF 2.0 file (section 3.6 and 3.8.4); data URIs are inside the file."""
    header = gltf_header(path)
    for kind in ("buffers", "images"):
        for index, entry in enumerate(header.get(kind, ())):
            uri = entry.get("uri")
            if isinstance(uri, str) and uri and not uri.startswith("data:"):
                yield FileReference(by=path, key=f"{kind}[{index}].uri", written=uri, name=unquote(uri),
                                    image=kind == "images")


def _obj_references(path: Path) -> Iterator[FileReference]:
    """Libraries lie relative to the .obj, their maps relative to the library."""
    libraries = [library for key, library in _statements(path) if key.lower() == "mtllib"]
    for library in dict.fromkeys(libraries):
        yield FileReference(by=path, key="mtllib", written=library, name=library, image=False)
        # A library that is missing is reported as such by who reads it
        if os.path.isfile(file := path.parent / library):
            for key, written in dict.fromkeys(_statements(file)):
                if key.lower().startswith(MTL_MAPS):
                    yield FileReference(by=file, key=key, written=written, image=key.lower() == "map_kd",
                                        name=str(Path(library).parent / _map_name(written)))


def _statements(path: Path) -> Iterator[tuple[str, str]]:
    """Keyword and arguments of every line of a text file that has both."""
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            words = line.strip().split(maxsplit=1)
            if len(words) == 2:
                yield words[0], words[1]


def _map_name(arguments: str) -> str:
    """The file name, which options may precede."""
    while option := MTL_OPTION.match(arguments):
        arguments = arguments[option.end():]
    return arguments
