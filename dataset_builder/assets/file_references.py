"""What a mesh file says about itself and other files: read straight from glTF JSON and OBJ/MTL text.

The mesh reader passes over a missing texture in silence and keeps colour factors in 8 bits; this module does neither.
"""

import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from PIL import Image

from dataset_builder.errors import Problem, UserError

GLB_MAGIC = b"glTF"
GLB_HEADER = struct.Struct("<4sIII4s")
"""Magic, version, length; then length and type of the first chunk, which is JSON."""


def gltf_header(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf or .glb file. Raises UserError where it has none."""
    data = path.read_bytes()
    try:
        if path.suffix.lower() == ".glb":
            magic, _, _, size, _ = GLB_HEADER.unpack_from(data)
            if magic != GLB_MAGIC:
                raise ValueError(f"expected a file that starts with {GLB_MAGIC!r}, got {magic!r}")
            data = data[GLB_HEADER.size:GLB_HEADER.size + size]
        header = json.loads(data)
    except (ValueError, struct.error) as error:
        problem = Problem(where=str(path), path="", rule=f"expected a readable glTF file, got: {error}")
        raise UserError([problem]) from error
    if not isinstance(header, dict):
        raise UserError([Problem(where=str(path), path="", rule="expected a glTF object, got something else")])
    return header


def check_references(path: Path) -> None:
    """Raise UserError that names every file which `path` refers to and which is not there."""
    suffix = path.suffix.lower()
    problems = _gltf_problems(path) if suffix in (".gltf", ".glb") else _obj_problems(path) if suffix == ".obj" else []
    if problems:
        raise UserError(problems)


def _gltf_problems(path: Path) -> list[Problem]:
    header = gltf_header(path)
    problems = []
    for kind in ("buffers", "images"):
        for index, entry in enumerate(header.get(kind, [])):
            uri = unquote(entry.get("uri", ""))
            if uri and not uri.startswith("data:"):
                problems += _problem_of(path, f"{kind}[{index}].uri", path.parent / uri, image=kind == "images")
    return problems


def _obj_problems(path: Path) -> list[Problem]:
    libraries = _values(path, "mtllib")
    problems = []
    for library in (path.parent / name for name in libraries):
        problems += _problem_of(path, "mtllib", library, image=False)
        for image in _values(library, "map_kd") if library.is_file() else []:
            problems += _problem_of(library, "map_Kd", path.parent / image, image=True)
    return problems


def _values(path: Path, keyword: str) -> list[str]:
    """What follows `keyword` on the lines of a text file that start with it, in order, each once."""
    found: dict[str, None] = {}
    with path.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            words = line.strip().split(maxsplit=1)
            if len(words) > 1 and words[0].lower() == keyword:
                found[words[1]] = None
    return list(found)


def _problem_of(path: Path, key: str, file: Path, *, image: bool) -> list[Problem]:
    """What is wrong with a `file` that `path` names, at most one problem; an image has to start like one."""
    if not file.is_file():
        return [Problem(where=str(path), path=key, rule=f"expected an existing file, got {file.name}, which is not in "
                        f"{file.parent}", hint="put it there, or export the model anew with its textures")]
    if image:
        try:
            Image.open(file).close()
        except OSError as error:
            return [Problem(where=str(path), path=key, rule=f"expected a readable image, got: {error}")]
    return []


def exact_factors(path: Path) -> dict[str | None, dict[str, Any]]:
    """glTF's `pbrMetallicRoughness` of every material whose name, or lack of one, is its own; empty for other files."""
    if path.suffix.lower() not in (".gltf", ".glb"):
        return {}
    materials = gltf_header(path).get("materials", [])
    names = [material.get("name") for material in materials]
    return {name: material.get("pbrMetallicRoughness", {}) for name, material in zip(names, materials, strict=True)
            if names.count(name) == 1}
