"""The header of a PLY file, and the textures that it names."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import open_regular
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference
from dataset_builder.spec.problems import shown

TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
         "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
         "double": "f8", "float64": "f8", "int64": "i8", "uint64": "u8"}
"""NumPy's names of the types of PLY, old and new."""
COUNTS = {name for name, kind in TYPES.items() if kind[0] in "iu"}
"""Types that the length of a list may have."""
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
MOST_HEADER = 2**20


@dataclass(frozen=True, kw_only=True)
class PlyProperty:
    """A column of an element."""

    name: str
    type: str
    """NumPy's, such as `f4`."""
    count_type: str = ""
    """Type of the length that precedes a list; empty for a single value."""


@dataclass(frozen=True, kw_only=True)
class PlyElement:
    """A table of the file."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]


@dataclass(frozen=True, kw_only=True)
class PlyHeader:
    """What stands before the data."""

    order: str
    """`<` or `>` for binary data, empty for text."""
    elements: tuple[PlyElement, ...]
    textures: tuple[tuple[int, str], ...]
    """Line and name, with `/` between folders, of each `comment TextureFile`."""
    size: int
    """Bytes up to the data."""


def ply_header(data: bytes) -> PlyHeader:
    """The header that a file's bytes start with; lines may end as on any system. Raises ValueError that says where it
    breaks the format (G. Turk, "The PLY Polygon File Format", 1994)."""
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r"):
        raise ValueError(f"expected it to start with a line `ply`, got {shown(data[:8].decode('latin-1'))}")
    ending = b"\n" if data[3:4] == b"\n" else b"\r\n" if data[4:5] == b"\n" else b"\r"
    lines, size = [], 0
    while (end := data.find(ending, size, MOST_HEADER)) >= 0:
        lines.append(_text(data[size:end]))
        size = end + len(ending)
        if lines[-1].strip() == "end_header":
            return _parsed(lines[:-1], size)
    if data[size:MOST_HEADER].strip() == b"end_header":
        return _parsed(lines, len(data))
    raise ValueError("expected a line `end_header`, got none")


def ply_references(path: Path) -> Iterator[FileReference]:
    """`comment TextureFile` lines, which lie relative to the file."""
    with open_regular(path, most=MOST_BYTES) as stream:
        header = ply_header(stream.read(MOST_HEADER))
    for line, name in header.textures:
        yield FileReference(by=path, key=f"line {line}: TextureFile", written=name, name=name, image=True)


def _text(line: bytes) -> str:
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def _parsed(lines: list[str], size: int) -> PlyHeader:
    order: str | None = None
    tables: list[tuple[str, int, list[PlyProperty]]] = []
    textures: list[tuple[int, str]] = []
    for number, line in enumerate(lines[1:], start=2):
        words = line.split()
        match words:
            case [] | ["obj_info", *_]:
                pass
            case ["comment", *rest]:
                if len(rest) > 1 and rest[0].lower() == "texturefile":
                    name = line.split(maxsplit=2)[2].strip()
                    textures.append((number, name.replace("\\", "/")))
            case ["format", kind, "1.0"] if kind in ORDERS and order is None:
                order = ORDERS[kind]
            case ["element", name, count] if count.isascii() and count.isdecimal() and len(count) < 19:
                if name in (table[0] for table in tables):
                    raise ValueError(f"line {number}: expected one element {shown(name)}, got two")
                tables.append((name, int(count), []))
            case ["property", kind, name] if kind in TYPES and tables:
                tables[-1][2].append(PlyProperty(name=name, type=TYPES[kind]))
            case ["property", "list", counts, kind, name] if kind in TYPES and counts in COUNTS and tables:
                tables[-1][2].append(PlyProperty(name=name, type=TYPES[kind], count_type=TYPES[counts]))
            case _:
                raise ValueError(f"line {number}: expected format, comment, element or property, got {shown(line)}")
    if order is None:
        raise ValueError("expected a line `format`, got none")
    for table, _, columns in tables:
        names = [column.name for column in columns]
        if doubled := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"element {table}: expected one property {shown(doubled[0])}, got two")
    elements = tuple(PlyElement(name=name, count=count, properties=tuple(columns)) for name, count, columns in tables)
    return PlyHeader(order=order, elements=elements, textures=tuple(textures), size=size)
