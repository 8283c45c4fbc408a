"""OBJ files: `Object Files (.obj)`, Alias/Wavefront's Advanced Visualizer manual, appendix B1, polygons only."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import filterfalse
from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import FileMaterial, FileModel, FilePart, counted, refuse
from dataset_builder.assets.linear_texels import linear_rgba
from dataset_builder.assets.readers.color_scale import as_shares
from dataset_builder.assets.readers.mtl import file_material
from dataset_builder.assets.readers.obj_lines import ObjLines, read_lines
from dataset_builder.assets.readers.polygon_checks import crossing
from dataset_builder.assets.readers.polygons import Triangulation, triangulated
from dataset_builder.errors import Problem, UserError
from dataset_builder.spec.obj_references import defined_entries, obj_libraries, used_entries
from dataset_builder.spec.wavefront import MtlEntry, Statement, obj_bytes, obj_statements

KINDS = ("vertices", "texture coordinates", "normals")
MOST_PARTS = 1000


def read(path: Path, max_texture: int, *, whole: Callable[[str, list[str]], bool] | None = None,
         ignored: Callable[[Statement], bool] | None = None) -> FileModel:
    """The file and its material libraries. whole: where the file has objects, whether one is not parted by its groups,
    from its name and theirs; without it, each group ends what is before it. ignored: which statements of the libraries
    are left out. Raises UserError for what breaks the format."""
    try:
        data = obj_bytes(path)
        entries = defined_entries(path, obj_libraries(path, data))
    except (OSError, ValueError) as error:
        refuse(path, f"expected a readable .obj file, got: {error}")
    if ignored is not None:
        entries = [replace(entry, statements=tuple(filterfalse(ignored, entry.statements))) for entry in entries]
    lines = read_lines(data)
    _raise_faults(path, lines)
    corners = np.concatenate(lines.corners) if lines.corners else np.zeros((0, 3), dtype=np.int32)
    counts = np.concatenate(lines.counts) if lines.counts else np.zeros(0, dtype=np.int64)
    if not len(counts):
        others = "".join(f", with {each}" for each in _others(lines))
        refuse(path, f"expected triangles, got a file without any{others}")
    labels = np.concatenate(lines.labels)
    if whole is not None:
        lines.objects, labels[:, 1] = _whole_objects(lines, data, labels, whole)
    for kind, size in enumerate(lines.sizes):
        beyond = np.unique(np.repeat(np.arange(len(counts)), counts)[corners[:, kind] >= size])
        lines.fault(f"expected indices of {KINDS[kind]} up to {size}, got {{}} faces with higher ones",
                    labels[beyond, 2])
    _raise_faults(path, lines)
    vertices = np.concatenate(lines.vertices)
    triangles = triangulated(vertices[:, :3], corners[:, 0], counts)
    used = used_entries(lines.materials, entries)
    numbers = {name: number for number, name in enumerate(used)}
    known = np.array([*(numbers.get(name, -1) for name in lines.materials), -1])
    colors, doubts = _colors(vertices[:, 3:])
    parts = tuple(_parts(lines, triangles, labels, (vertices[:, :3], colors, known, corners)))
    materials = tuple(file_material(entry, path, max_texture) for entry in used.values())
    contains = ", ".join((f"{len(lines.objects)} objects or groups", counted(len(counts), "face"),
                          counted(len(triangles.corners), "triangle"), f"{len(used)} of {len(entries)} materials used"))
    return FileModel(parts=parts, materials=materials, contains=contains,
                     left_out=(*_unknown(lines, known, labels), *_others(lines), *doubts, *_clashes(used, entries),
                               *crossing(triangles), *_bare(corners, counts, known[labels[:, 0]], materials)))


def _raise_faults(path: Path, lines: ObjLines) -> None:
    if lines.faults:
        raise UserError([Problem(where=str(path), path=f"line {line}", rule=rule.format(f"{count:,}"))
                         for rule, (count, line) in lines.faults.items()])


def _whole_objects(lines: ObjLines, data: bytes, labels: np.ndarray,
                   whole: Callable[[str, list[str]], bool]) -> tuple[dict[str, int], np.ndarray]:
    """The objects, or `OBJECT/GROUP` of those that are parted, by their numbers, and (F,) the one of each face, -1
    before the first; groups where there is no object."""
    statements = list(obj_statements(data, b"o"))
    if not statements:
        return lines.objects, labels[:, 1]
    numbers: dict[str, int] = {}
    after = [-1, *(numbers.setdefault(name, len(numbers)) for _, name in statements)]
    found = np.array(after)[np.searchsorted([offset for offset, _ in statements], labels[:, 2])]
    pairs, inverse = np.unique(np.stack([found, labels[:, 1]], axis=1), axis=0, return_inverse=True)
    names, groups = [*lines.objects], dict[int, list[int]]()
    for number, group in pairs.tolist():
        groups.setdefault(number, []).append(group)
    made = pairs[:, 0].copy()
    for name, number in [*numbers.items()]:
        inner = [group for group in groups.get(number, ()) if names[group] != name]
        if not whole(name, [names[group] for group in inner]):
            for group in inner:
                at = (pairs == (number, group)).all(axis=1)
                made[at] = numbers.setdefault(f"{name}/{names[group]}", len(numbers))
    return numbers, made[inverse.ravel()]


def _parts(lines: ObjLines, triangles: Triangulation, labels: np.ndarray,
           arrays: tuple[np.ndarray, np.ndarray | None, np.ndarray, np.ndarray]) -> Iterator[FilePart]:
    """The triangles of each object or group and material, or of each material where those are many, in the order of the
    file."""
    positions, colors, known, corners = arrays
    texcoords = np.concatenate(lines.texcoords) if lines.texcoords else np.zeros((0, 2))
    names, materials = [*lines.objects, "no object"], [*lines.materials, "no material"]
    keys = labels[:, 1] * (len(materials) + 1) + labels[:, 0]
    if many := len(np.unique(keys)) > MOST_PARTS:
        keys = known[labels[:, 0]]
    _, first, inverse = np.unique(keys[triangles.owner], return_index=True, return_inverse=True)
    order = np.argsort(inverse, kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(inverse))[:-1])
    for number in np.argsort(first):
        rows = corners[triangles.corners[groups[number]]]
        material, group, _ = labels[triangles.owner[first[number]]]
        used, faces = np.unique(rows[..., 0], return_inverse=True)
        mapped = rows[..., 1] >= 0
        uvs = {0: np.where(mapped[..., None], texcoords[rows[..., 1]], 0)} if mapped.any() else {}
        yield FilePart(name=f"{names[group]!r}, {materials[material]!r}", positions=positions[used],
                       faces=faces.reshape(-1, 3), material=int(known[material]), uvs=uvs,
                       group="" if many or group < 0 else names[group],
                       colors=None if colors is None else colors[rows[..., 0]])


def _colors(said: np.ndarray) -> tuple[np.ndarray | None, list[str]]:
    """(V, 4) linear colours and coverage of (V, 4) sRGB ones, white where there are none, and what is doubtful."""
    if not np.isfinite(said).any():
        return None, []
    said, doubts = as_shares(said)
    return linear_rgba(np.nan_to_num(said, nan=1)), doubts


# What is left out, or doubtful

def _unknown(lines: ObjLines, known: np.ndarray, labels: np.ndarray) -> list[str]:
    """Materials that faces use and no library defines."""
    faces = Counter(dict(zip(*(each.tolist() for each in np.unique(labels[:, 0], return_counts=True)), strict=True)))
    return [f"material {name!r} of {faces[number]:,} faces, which no library defines"
            for name, number in lines.materials.items() if known[number] < 0 and faces[number]]


def _others(lines: ObjLines) -> list[str]:
    """Statements and values that are not read, with their counts."""
    named = {"p": "lines of points", "l": "lines of edges"}
    kinds = lines.others.most_common(12)
    more = [f"{len(lines.others) - len(kinds)} more kinds of lines"] if len(lines.others) > len(kinds) else []
    return [*(f"{count:,} {named.get(key, f'lines of {key!r}')}" for key, count in kinds), *more,
            *(f"{count:,} {words}" for words, count in lines.notes.items() if count)]


def _clashes(used: dict[str, MtlEntry], entries: list[MtlEntry]) -> list[str]:
    times = Counter(entry.name for entry in entries)
    return [f"material {name!r} is defined {times[entry.name]} times, and the last counts"
            for name, entry in used.items() if times[entry.name] > 1]


def _bare(corners: np.ndarray, counts: np.ndarray, used: np.ndarray, materials: tuple[FileMaterial, ...]) -> list[str]:
    """Faces without texture coordinates whose material has a texture. used: (F,) material of each face."""
    bare = np.bincount(used[(used >= 0) & (corners[np.cumsum(counts) - 1, 1] < 0)], minlength=len(materials))
    return [f"{each.name}: {count:,} faces have no texture coordinates, and take one texel"
            for each, count in zip((found.material for found in materials), bare.tolist(), strict=True)
            if count and each.texture is not None]
