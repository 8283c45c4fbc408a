"""The files that an .obj names: material libraries, and the maps in them that are read."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from dataset_builder.spec.file_reference import FileReference
from dataset_builder.spec.wavefront import (
    MtlEntry,
    Statement,
    companion_name,
    library_entries,
    line_at,
    map_words,
    obj_bytes,
    obj_statements,
    uncommented,
)

READ_MAPS = {"map_kd": "base_color", "map_d": "alpha", "map_ke": "emission", "map_ks": "specular",
             "map_pr": "roughness", "map_pm": "metallic", "map_ps": "sheen", "map_pc": "coat",
             "map_pcr": "coat_roughness", "norm": "normal", "map_norm": "normal", "bump": "bump", "map_bump": "bump"}
"""Keys of MTL, in lower case, whose images are read, and what they give."""


def obj_references(path: Path) -> Iterator[FileReference]:
    """Libraries lie relative to the .obj; the maps of the materials that it uses relative to their library.

    Raises ValueError for what is no text, and for names that leave the folder of the .obj; OSError for what cannot be
    read.
    """
    data = obj_bytes(path)
    libraries = list(obj_libraries(path, data))
    yield from libraries
    names = dict.fromkeys(name for _, name in obj_statements(data, b"usemtl"))
    used = used_entries(names, defined_entries(path, libraries)).values()
    for entry in {id(entry): entry for entry in used}.values():
        for statement, name in entry_maps(path, entry):
            yield FileReference(by=entry.library, key=f"line {statement.line}: {statement.key}",
                                written=map_words(statement.rest).written, name=name, image=True)


def obj_libraries(path: Path, data: bytes) -> Iterator[FileReference]:
    """Each library of an .obj once. The rest of a line is one name if there is such a file, or if it does not consist
    of several that end in .mtl."""
    named: set[str] = set()
    for offset, rest in obj_statements(data, b"mtllib"):
        words = uncommented(rest).split()
        several = len(words) > 1 and not os.path.isfile(path.parent / rest) and (
            all(word.lower().endswith(".mtl") for word in words))
        line = line_at(data, offset)
        for written in words if several else [rest] if rest else []:
            name = _named(path, path, f"line {line}: mtllib", path.parent, written)
            if name not in named:
                named.add(name)
                yield FileReference(by=path, key=f"line {line}: mtllib", written=written, name=name, image=False)


def defined_entries(path: Path, libraries: Iterable[FileReference]) -> list[MtlEntry]:
    """All materials of the libraries. One that is missing has none: who reads it reports it."""
    return [entry for library in libraries if os.path.isfile(file := path.parent / library.name)
            for entry in library_entries(file)]


def used_entries(names: Iterable[str], entries: list[MtlEntry]) -> dict[str, MtlEntry]:
    """The materials that an .obj uses, by the `names` that it uses, in their order. Of several of one name the last
    counts, as in Blender. Comments after names do not count where there is no such name."""
    by_name = {uncommented(entry.name): entry for entry in entries} | {entry.name: entry for entry in entries}
    found = {name: by_name.get(name, by_name.get(uncommented(name))) for name in names}
    return {name: entry for name, entry in found.items() if entry is not None}


def entry_maps(path: Path, entry: MtlEntry) -> list[tuple[Statement, str]]:
    """The maps of a material that are read, with their paths relative to the folder of the .obj."""
    return [(said, _named(path, entry.library, f"line {said.line}: {said.key}", entry.library.parent,
                          map_words(said.rest).written))
            for said in entry.statements if said.key.lower() in READ_MAPS and said.rest]


def _named(path: Path, by: Path, key: str, folder: Path, written: str) -> str:
    try:
        return companion_name(path, folder, written)
    except ValueError as error:
        raise ValueError(f"{by.name}: {key}: {error}") from error
