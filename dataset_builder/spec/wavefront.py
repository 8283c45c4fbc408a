"""The words of OBJ and MTL files: statements, options of maps, and where the files that they name lie."""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from urllib.parse import unquote

from dataset_builder.digest import read_regular
from dataset_builder.spec.file_reference import MOST_BYTES, is_inside

MOST_LIBRARY_BYTES = 2**24
"""Of a material library."""
OPTION = re.compile(r"(-(?:(?:mm|o|s|t)(?:\s+[-+]?[\d.]+(?:e[-+]?\d+)?(?=\s)){1,3}|[a-z]+\s+\S+))\s+", re.IGNORECASE)
"""An option before the file name of a texture map: up to three numbers, or one value."""
ABSOLUTE = re.compile(r"[a-z]:/|/", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One statement."""

    line: int
    """Counted from 1."""
    key: str
    rest: str
    """All that follows the key, comments included: names may hold a `#`."""


@dataclass(frozen=True, kw_only=True)
class MtlEntry:
    """A material of a library."""

    name: str
    library: Path
    statements: tuple[Statement, ...]
    """Those after its `newmtl`."""


@dataclass(frozen=True, kw_only=True)
class MapWords:
    """What follows the key of a texture map."""

    options: Mapping[str, tuple[str, ...]]
    """Values by the option's name in lower case, without its dash."""
    written: str
    """The name of the image."""


def obj_bytes(path: Path) -> bytes:
    """An OBJ file with its line continuations (a backslash before the end of a line) as blanks, so that every byte and
    line break that counts stays in its place; a byte order mark too.

    Raises OSError where it cannot be read, ValueError where it holds NUL bytes.
    """
    data = read_regular(path, most=MOST_BYTES)
    if data.startswith(b"\xef\xbb\xbf"):
        data = b"   " + data[3:]
    if (at := data.find(b"\0")) >= 0:
        raise ValueError(f"expected text, got a NUL byte in line {line_at(data, at)}")
    for broken in (b"\\\r\n", b"\\\n"):
        data = data.replace(broken, b" " * (len(broken) - 1) + b"\v")
    return data.replace(b"\r\n", b" \n").replace(b"\r", b"\n")


def line_at(data: bytes, offset: int) -> int:
    """The line of a file, as its writer counts, that a byte of `obj_bytes` stands in."""
    return 1 + sum(data.count(end, 0, offset) for end in (b"\n", b"\v"))


def obj_statements(data: bytes, key: bytes) -> Iterator[tuple[int, str]]:
    """Offset and arguments of every statement of `obj_bytes` with that key."""
    at = data.find(key)
    while at >= 0:
        start, end = data.rfind(b"\n", 0, at) + 1, data.find(b"\n", at)
        end = len(data) if end < 0 else end
        words = data[start:end].split(maxsplit=1)
        if words and words[0] == key:
            yield start, as_text(words[1]).strip() if len(words) > 1 else ""
        at = data.find(key, end)


def as_text(data: bytes) -> str:
    """UTF-8, with or without a byte order mark, or else Latin-1."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def library_entries(path: Path) -> list[MtlEntry]:
    """The materials of a library in their order. Raises OSError where it cannot be read, ValueError for NUL bytes."""
    data = read_regular(path, most=MOST_LIBRARY_BYTES)
    if b"\0" in data:
        raise ValueError(f"{path.name}: expected text, got a NUL byte")
    found: list[tuple[str, list[Statement]]] = []
    for number, line in enumerate(re.split(r"\r\n|\n|\r", as_text(data)), start=1):
        words = line.split(maxsplit=1)
        if not words or words[0].startswith("#"):
            continue
        key, rest = words[0].lower(), words[1].strip() if len(words) > 1 else ""
        if key == "newmtl":
            found.append((rest, []))
        elif found:
            found[-1][1].append(Statement(line=number, key=words[0], rest=rest))
    return [MtlEntry(name=name, library=path, statements=tuple(said)) for name, said in found]


def uncommented(text: str) -> str:
    """Text up to a `#` that begins a word."""
    return re.split(r"(?:^|\s)#", text, maxsplit=1)[0].strip()


def map_words(rest: str) -> MapWords:
    """Options and name of a texture map."""
    options: dict[str, tuple[str, ...]] = {}
    while option := OPTION.match(rest):
        key, *values = option[1].split()
        options[key[1:].lower()] = tuple(values)
        rest = rest[option.end():]
    return MapWords(options=MappingProxyType(options), written=rest)


def companion_name(mesh: Path, folder: Path, written: str) -> str:
    """Path relative to the folder of `mesh` of a file that lies in `folder` under a name as it is written.

    The first that is there of: the name as it stands, without a comment, without quotes, with its backslashes as
    slashes, without percent escapes; of an absolute path, its last part. Where none is, the name with slashes, for a
    message. Raises ValueError for a path that leaves the folder of the mesh.
    """
    slashed = uncommented(written).strip("\"'").replace("\\", "/")
    names = [written, uncommented(written), uncommented(written).strip("\"'"), slashed, unquote(slashed)]
    if ABSOLUTE.match(slashed):
        names = [slashed.rpartition("/")[2], unquote(slashed.rpartition("/")[2])]
    places = [os.path.normpath(os.path.relpath(folder / name, mesh.parent)) for name in names if name]
    outside = [place for place in places if not is_inside(mesh.parent, place)]
    inside = [place for place in places if place not in outside and os.path.isfile(mesh.parent / place)]
    if inside:
        return inside[0]
    if outside or not places:
        raise ValueError(f"expected the name of a file in {mesh.parent}, got {written!r}, which is outside")
    return places[min(3, len(places) - 1)]
