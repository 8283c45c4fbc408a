"""Mesh files -> Asset."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.even_colours import with_even_colours
from dataset_builder.assets.file_model import GREY, NO_MATERIAL, ROUGHNESS, FileModel, FilePart, refuse
from dataset_builder.assets.image_maps import ImageFile, check_image
from dataset_builder.assets.readers import gltf, obj, off, own_field, ply, stl, usd
from dataset_builder.assets.repair_text import pieces_text, repair_notes, repair_text
from dataset_builder.errors import Problem, UserError
from dataset_builder.geometry.mesh import TriangleMesh, concatenate, transform
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.shape_faults import shape_faults
from dataset_builder.geometry.support import NEAR, near_support
from dataset_builder.spec.file_reference import FileReference
from dataset_builder.spec.mesh_source import (
    FIELD_SUFFIX,
    SCALED_FIELD,
    broken_suffix_rule,
    names_field,
    references,
    splat_hint,
)
from dataset_builder.spec.problems import name_alike
from dataset_builder.spec.usd_references import USD_SUFFIXES

READERS: dict[str, Callable[[Path, int], FileModel]] = {
    ".glb": gltf.read, ".gltf": gltf.read, ".obj": obj.read, ".off": off.read, ".ply": ply.read, ".stl": stl.read,
    FIELD_SUFFIX: own_field.read, **dict.fromkeys(USD_SUFFIXES, usd.read)}
"""What reads a file by its suffix: functions of its path and the longest side of a texture."""
STANDING = 1e-5
"""Share of its diagonal that the mesh of a field may be off its place: welding moves vertices by a tenth of it."""
RAISED = 1e-4
"""Metres that a sheet lies above what it stands on; in one plane, half of its pixels would be the floor's."""
Up = Literal["x", "y", "z"]
WORLD_FROM_FILE: dict[Up, np.ndarray] = {
    "x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "y": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}
"""Rotations by the file's upward axis; with y up, glTF's front +Z comes to -Y."""


def checked_references(path: Path, roots: Sequence[Path] = ()) -> tuple[FileReference, ...]:
    """The files that `path` refers to, in its own folder or in `roots`. Raises UserError that names every one which is
    not there or unreadable; the mesh reader would pass over a missing texture."""
    try:
        found = references(path, roots)
    except (OSError, ValueError) as error:
        problem = Problem(where=str(path), path="", rule=f"expected a readable {path.suffix} file, got: {error}")
        raise UserError([problem]) from error
    problems = [problem for reference in found for problem in _problem_of(reference, path.parent / reference.name)]
    if problems:
        raise UserError(problems)
    return found


def _problem_of(reference: FileReference, file: Path) -> list[Problem]:
    """What is wrong with a `file` that is referred to, at most one problem; an image has to start like one."""
    where = str(reference.by)
    if not os.path.isfile(file):
        return [Problem(where=where, path=reference.key, rule=f"expected an existing file, got {file.name}, which is "
                        f"not in {file.parent}", hint=name_alike(file) or
                        "put it there, or export the model again with its textures")]
    if reference.image:
        try:
            check_image(ImageFile(name=file.name, content=file))
        except UserError as error:
            return [replace(problem, where=where, path=f"{reference.key}: {file.name}") for problem in error.problems]
    return []


def load_mesh_file(path: Path, *, name: str, category: str, licence: str, scale: float = 1.0, up: Up = "y",
                   max_texture: int = 1024) -> Asset:
    """The whole scene of a mesh file as one asset, every node where its transforms put it.

    scale: metres per file unit. up: axis of the file that points up. max_texture: longest side of a texture in texels.
    The mesh is welded and mended, centred over the origin and stood on z = 0, a sheet 0.1 mm above it; `meta` says how
    far it was moved, what the file contains, what of it was left out, what was mended of which part, and what is wrong
    with its shape. That of a field is where the field is, and stays there. Raises UserError: no such file, another
    format, unreadable, a texture that is missing, no faces, NaN or Inf, a field that does not stand so or is to be
    scaled or turned.
    """
    path = Path(path)
    _check_file(path)
    checked_references(path)
    with file_named(path):
        model = READERS[path.suffix.lower()](path, max_texture)
        if not model.parts:
            refuse(path, "expected triangles, got a file without any", splat_hint(left_out_of(model)))
        asset = model_asset(model, scaled_world(scale, up), name=name, category=category, licence=licence)
    if names_field(path.name):
        _require_own_frame(path, asset.mesh, scale, up)
    # A field's image would stay where it is
    placed, moved, flat = (asset.mesh, np.zeros(3), []) if names_field(path.name) else stand(asset.mesh)
    meta = {**asset.meta, "source": path.name, "moved": ", ".join(f"{step:.6g} m" for step in moved),
            "shape": "; ".join(filter(None, [asset.meta["shape"], *flat]))}
    return replace(asset, mesh=placed, meta=meta)


def _require_own_frame(path: Path, mesh: TriangleMesh, scale: float, up: Up) -> None:
    """Refuse a field whose mesh would have to be moved, but for the hair by which `stand` raises what lies flat."""
    if (scale, up) != (1.0, "y"):
        refuse(path, f"expected scale 1 and up y of a field, which has metres and stands already, got {scale:g} and "
                     f"{up}", SCALED_FIELD)
    low, high = mesh.bounds
    off = np.array([*(low + high)[:2] / 2, low[2]])
    if np.abs(off).max() > STANDING * float(np.linalg.norm(high - low)):
        refuse(path, "expected a field that stands on z = 0 over the origin, got one that is off by "
                     f"{', '.join(f'{step:.4g}' for step in off)} m", SCALED_FIELD)


@contextmanager
def file_named(path: Path) -> Iterator[None]:
    """Name the file in problems that do not."""
    try:
        yield
    except UserError as error:
        raise UserError([replace(problem, where=problem.where or str(path)) for problem in error.problems]) from error


def model_asset(model: FileModel, world_from_file: np.ndarray, *, name: str, category: str, licence: str,
                look: bool = True) -> Asset:
    """What a reader took out of a file, of at least one part, as one asset: moved by a (4, 4) affine map to metres with
    Z up, welded and mended. `meta` says what the file contains, what of it was left out, what was mended of which part,
    and what is wrong with its shape; look: whether to look for that, which takes most of the time. Raises UserError for
    what is no surface."""
    model = with_even_colours(model)
    plain = _colored_or_not(model)
    whole = transform(concatenate([_mesh(part, model, plain) for part in model.parts]), world_from_file)
    sizes = [len(part.faces) for part in model.parts]
    mesh, mended = repair(whole, part=np.repeat(np.arange(len(sizes)), sizes), outwards=not model.wound)
    meta = {"licence": licence, "contains": f"{model.contains}; {pieces_text(mended)}",
            "left_out": "; ".join(left_out_of(model)),
            "repair": repair_text(mended, [part.name for part in model.parts]),
            "shape": "; ".join([*repair_notes(mended), *(shape_faults(mesh).notes if look else ())])}
    return Asset(name=name, category=category, mesh=mesh, materials=_materials(model), meta=meta)


def _mesh(part: FilePart, model: FileModel, plain: list[bool]) -> TriangleMesh:
    """A part with the texture coordinates that its material uses. Those without a material come after the others, in
    the order of `plain`: whether they have colours."""
    index = part.material
    if index < 0:
        index = len(model.materials) + plain.index(part.colors is not None)
    used = model.materials[part.material] if part.material >= 0 else None
    uvs = part.uvs.get(used.uv_set if used else 0)
    if uvs is None:
        uvs = np.zeros((len(part.faces), 3, 2))
    if used is not None and used.uv_transform is not None:
        uvs = uvs @ used.uv_transform[:, :2].T + used.uv_transform[:, 2]
    return TriangleMesh(positions=part.positions, faces=part.faces, uvs=uvs, colors=part.colors,
                        material=np.full(len(part.faces), index))


def _materials(model: FileModel) -> tuple[Material, ...]:
    """Those of the file, then a grey one for parts with neither material nor colours, and a white one for colours."""
    plain = [Material(name="vertex colours" if colored else NO_MATERIAL, roughness=ROUGHNESS,
                      base_color=(1.0 if colored else GREY,) * 3) for colored in _colored_or_not(model)]
    return (*(each.material for each in model.materials), *plain)


def _colored_or_not(model: FileModel) -> list[bool]:
    """Of the parts without a material: whether they have colours, each answer once."""
    return sorted({part.colors is not None for part in model.parts if part.material < 0})


def left_out_of(model: FileModel) -> list[str]:
    """What a file says and is not honoured, that of its materials first."""
    return [*(f"{each.material.name}: {', '.join(each.left_out)}" for each in model.materials if each.left_out),
            *model.left_out]


def _check_file(path: Path) -> None:
    rule, hint = broken_suffix_rule(path.name)
    if rule:
        refuse(path, rule, hint)
    if not path.is_file():
        refuse(path, "expected an existing file, got none", "paths are relative to the spec that names them")


def scaled_world(scale: float, up: Up) -> np.ndarray:
    """(4, 4) from a file whose unit is `scale` metres and whose axis `up` is up, to metres with Z up."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * WORLD_FROM_FILE[up]
    return matrix


def stand(mesh: TriangleMesh) -> tuple[TriangleMesh, np.ndarray, list[str]]:
    """The mesh centred over the origin and standing on z = 0, the (3,) metres it was moved, and what is to be said of
    it."""
    low, high = mesh.bounds
    lies = near_support(mesh, RAISED) > NEAR
    moved = np.array([*-(low + high)[:2] / 2, -low[2] + RAISED * lies])
    matrix = np.eye(4)
    matrix[:3, 3] = moved
    said = [f"has faces in the plane of what it stands on: raised by {1000 * RAISED:g} mm, so that this does not show "
            "through"]
    return transform(mesh, matrix), moved, said if lies else []
