"""Mesh files that a spec names: where they are, what belongs to them, and the digest of all of it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import unquote

from dataset_builder.digest import sha256_file

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply")


@dataclass(frozen=True, kw_only=True)
class MeshSource:
    """One mesh file on this machine. companions: SHA-256 of each file that it names (buffers, textures), by name."""

    path: Path
    sha256: str
    companions: Mapping[str, str]

    def content(self) -> dict[str, Any]:
        """What the mesh holds, wherever it lies."""
        return {"sha256": self.sha256, "companions": dict(self.companions)}


def companions(path: Path) -> tuple[str, ...]:
    """Names of the files that a mesh file needs, relative to it: buffers and textures of glTF, .mtl and maps of .obj.

    Raises ValueError where the mesh file cannot be understood that far, OSError where it cannot be read.
    """
    if path.suffix.lower() in (".gltf", ".glb"):
        return tuple(_gltf_names(json.loads(_gltf_header(path))))
    if path.suffix.lower() == ".obj":
        return tuple(_obj_names(path))
    return ()


def mesh_source(path: Path, names: tuple[str, ...]) -> MeshSource:
    """The mesh file and its companions with their digests. Raises OSError where one cannot be read."""
    digests = {name: sha256_file(path.parent / name) for name in sorted(names)}
    return MeshSource(path=path.resolve(), sha256=sha256_file(path), companions=MappingProxyType(digests))


def _gltf_header(path: Path) -> bytes:
    """The JSON of a .gltf file, or the first chunk of a .glb file, which is its JSON (glTF 2.0, section 4.4)."""
    data = path.read_bytes()
    if path.suffix.lower() == ".gltf":
        return data
    if data[:4] != b"glTF":
        raise ValueError(f"expected it to start with glTF, got {data[:4]!r}")
    return data[20:20 + int.from_bytes(data[12:16], "little")]


def _gltf_names(gltf: Any) -> list[str]:
    """External `uri`s of a glTF 2.0 file (section 3.6 and 3.8.4); data URIs are inside the file."""
    if not isinstance(gltf, dict):
        raise ValueError("expected a glTF file to hold an object")
    entries = [entry for kind in ("buffers", "images") for entry in gltf.get(kind, ())]
    uris = [entry["uri"] for entry in entries if isinstance(entry, dict) and isinstance(entry.get("uri"), str)]
    return sorted({unquote(uri) for uri in uris if not uri.startswith("data:")})


def _obj_names(path: Path) -> list[str]:
    libraries = {words[1].strip() for words in _statements(path) if words[0] == "mtllib" and len(words) == 2}
    names = set(libraries)
    for library in libraries:
        # A library that is missing is reported as such by who reads it
        if (file := path.parent / library).is_file():
            names |= {str(Path(library).parent / _map_name(words[1])) for words in _statements(file)
                      if words[0].lower().startswith(("map_", "bump", "norm")) and len(words) == 2}
    return sorted(names)


def _statements(path: Path) -> list[list[str]]:
    text = path.read_text(encoding="utf-8", errors="replace")
    return [line.split(maxsplit=1) for line in text.splitlines() if line.strip()]


def _map_name(arguments: str) -> str:
    """Options of a texture map come before its file name."""
    return arguments.split()[-1] if arguments.startswith("-") else arguments.strip()
