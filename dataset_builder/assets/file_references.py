"""Whether the files that a mesh file names are there, and colour factors read from the file's own text.

The mesh reader ignores a missing texture silently and keeps colour factors in 8 bits; this module does neither.
"""

from pathlib import Path
from typing import Any

from PIL import Image

from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.mesh_source import GLTF_SUFFIXES, FileReference, gltf_header, references


def checked_references(path: Path) -> tuple[FileReference, ...]:
    """The files that `path` refers to. Raises UserError that names every one which is not there or unreadable."""
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
    """glTF's `pbrMetallicRoughness` of every material whose name, or lack of one, is its own; empty for other files."""
    if path.suffix.lower() not in GLTF_SUFFIXES:
        return {}
    materials = gltf_header(path).get("materials", [])
    names = [material.get("name") for material in materials]
    return {name: material.get("pbrMetallicRoughness", {}) for name, material in zip(names, materials, strict=True)
            if names.count(name) == 1}
