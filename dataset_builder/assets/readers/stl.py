"""STL, text and binary: loose triangles, which repair welds. Normals are worked out from the corners."""

import re
from pathlib import Path
from typing import NoReturn

import numpy as np

from dataset_builder.assets.file_model import FileModel, FilePart, counted, refuse
from dataset_builder.assets.readers.polygon_checks import checked_triangles, content_of, numbers_of
from dataset_builder.spec.problems import shown

HEADER = 84
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
SOLID = re.compile(rb"\s*solid\b([^\r\n]*)\s*", re.IGNORECASE)
END = re.compile(rb"end\s?solid\b[^\r\n]*\s*", re.IGNORECASE)
FACET = re.compile(rb"facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+" + 3 * rb"vertex\s+(\S+\s+\S+\s+\S+)\s+"
                   + rb"endloop\s+endfacet\s+", re.IGNORECASE)
NO_UNIT = "a format without units, often in millimetres: taken as `scale` says"


def read(path: Path, max_texture: int) -> FileModel:
    """All solids of a file. Raises UserError where its size is not what its count says, and for text that is cut."""
    data = content_of(path)
    count = int.from_bytes(data[HEADER - 4:HEADER], "little")
    # Headers of binary files may begin with `solid`, too
    if len(data) >= HEADER and len(data) == HEADER + RECORD.itemsize * count:
        solids, left_out = _binary(data, count)
    elif SOLID.match(data) and b"\0" not in data[:2 * HEADER]:
        solids, left_out = _text(path, data), ()
    else:
        refuse(path, f"expected {HEADER + RECORD.itemsize * count} bytes, which hold the {count} triangles that the "
                     f"header of a binary STL file declares, got {len(data)}", "export it again")
    parts = tuple(_part(path, name, corners) for name, corners in solids if len(corners))
    if not parts:
        refuse(path, "expected triangles, got none")
    contains = f"{counted(len(solids), 'solid')}, {counted(sum(len(part.faces) for part in parts), 'triangle')}"
    return FileModel(parts=parts, materials=(), contains=contains, left_out=(*left_out, NO_UNIT))


def _part(path: Path, name: str, corners: np.ndarray) -> FilePart:
    """A solid of (N, 3, 3) corners."""
    positions, indices = corners.reshape(-1, 3), np.arange(3 * len(corners))
    checked_triangles(path, positions, indices, np.full(len(corners), 3), at=name)
    return FilePart(name=name, positions=positions, faces=indices.reshape(-1, 3))


def _binary(data: bytes, count: int) -> tuple[list[tuple[str, np.ndarray]], tuple[str, ...]]:
    """The triangles, and what is left out: programs put colours into attributes and into the header."""
    records = np.frombuffer(data, RECORD, count, HEADER)
    coloured = int(np.count_nonzero(records["attribute"]))
    lost = [f"attributes of {coloured} triangles, which are colours in some programs"] if coloured else []
    lost += [f"{key[:-1].decode().lower()} in the header" for key in (b"COLOR=", b"MATERIAL=") if key in data[:HEADER]]
    with np.errstate(invalid="ignore"):  # NaN that signals; it is refused later
        return [("solid", records["corners"].astype(np.float64))], tuple(lost)


def _text(path: Path, data: bytes) -> list[tuple[str, np.ndarray]]:
    """Name and (N, 3, 3) corners of each solid."""
    solids: list[tuple[str, np.ndarray]] = []
    at = 0
    while at < len(data.rstrip()):
        if (start := SOLID.match(data, at)) is None:
            _stop(path, data, at, "solid")
        at, vertices = start.end(), list[bytes]()
        while facet := FACET.match(data, at):
            vertices += facet.groups()
            at = facet.end()
        if (end := END.match(data, at)) is None:
            _stop(path, data, at, "a whole facet, or endsolid,", f" after {len(vertices) // 3} triangles")
        at = end.end()
        numbers = numbers_of(b" ".join(vertices))
        if numbers is None:
            wrong = next(vertex for vertex in vertices if numbers_of(vertex) is None)
            refuse(path, f"expected three numbers of a vertex, got {shown(wrong.decode('latin-1'))}")
        name = start[1].decode("utf-8", "replace").strip()
        solids.append((name or "solid", numbers.reshape(-1, 3, 3)))
    return solids


def _stop(path: Path, data: bytes, at: int, expected: str, after: str = "") -> NoReturn:
    rest = data[at:].split(b"\n", 1)[0].decode("latin-1").strip()
    refuse(path, f"expected {expected}{after}, got {shown(rest) if rest else 'the end of the file'}",
           at=f"line {data.count(bytes([10]), 0, at) + 1}")
