"""The container of a glTF 2.0 file, and the files that it names."""

import json
import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

from dataset_builder.digest import read_regular
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference
from dataset_builder.spec.problems import shown

MAGIC, ZIP = b"glTF", b"PK\x03\x04"
OLD = "glTF {}, which is not read: convert the file to glTF 2.0, with Blender or gltf-pipeline"
SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)
NOT_PILLOWS = (".ktx2", ".ktx", ".dds")
"""Suffixes of images that only the reader can judge."""


@dataclass(frozen=True, kw_only=True)
class GltfContainer:
    """A glTF file taken apart."""

    header: dict[str, Any]
    binary: memoryview | None
    """The first buffer of a .glb file, if it is in there."""
    left_out: tuple[str, ...] = ()
    """Chunks of unknown kinds, in words."""


def read_container(path: Path) -> GltfContainer:
    """The JSON and the binary chunk of a .glb (glTF 2.0, section 4.4) or .gltf file, told apart by their first bytes.

    Raises ValueError where it is neither, cut short, or of another version; OSError where it cannot be read.
    """
    data = read_regular(path, most=MOST_BYTES)
    if path.suffix.lower() == ".glb" and data[:4] != MAGIC:
        archive = ", the beginning of a zip archive: unpack it, and take the model from it" * (data[:4] == ZIP)
        raise ValueError(f"expected it to start with glTF, got {data[:4]!r}{archive}")
    text, binary, left_out = _chunks(data) if data[:4] == MAGIC else (data, None, ())
    return GltfContainer(header=_header(text), binary=binary, left_out=left_out)


def _chunks(data: bytes) -> tuple[bytes, memoryview | None, tuple[str, ...]]:
    """JSON, binary data if there are any, and what else a .glb file holds."""
    if len(data) < 20:
        raise ValueError(f"expected at least 20 bytes, got {len(data)}")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise ValueError(OLD.format("1.0") if version == 1 else f"version {version} of the binary format, expected 2")
    if length > len(data):
        raise ValueError(f"{len(data):,} of the {length:,} bytes that it says it has; it is cut short")
    chunks: list[tuple[bytes, memoryview]] = []
    start = 12
    while start + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, start)
        if start + 8 + size > length:
            raise ValueError(f"a chunk {kind!r} of {size:,} bytes where only {length - start - 8:,} are left")
        chunks.append((kind, memoryview(data)[start + 8:start + 8 + size]))
        start += 8 + size
    kinds = [kind for kind, _ in chunks]
    if not kinds or kinds[0] != b"JSON" or max(kinds.count(b"JSON"), kinds.count(b"BIN\0")) > 1:
        raise ValueError(f"expected one JSON chunk, then at most one BIN chunk, got {kinds[:8]}")
    unknown = tuple(f"a chunk {kind!r} of {len(content):,} bytes" for kind, content in chunks
                    if kind not in (b"JSON", b"BIN\0"))
    return bytes(chunks[0][1]).rstrip(b"\0"), dict(chunks).get(b"BIN\0"), unknown


def _header(text: bytes) -> dict[str, Any]:
    """The JSON of the file."""
    try:
        header = json.loads(text.decode("utf-8-sig"), parse_constant=_not_json)
        _check_header(header)
    except RecursionError as error:
        raise ValueError("expected JSON that is not nested without end") from error
    return header


def _check_header(header: Any) -> None:
    """Raise ValueError where it is of a version that is not read, or names files in no known way."""
    if not isinstance(header, dict):
        raise ValueError("expected it to hold an object")
    asset = header.get("asset")
    if not isinstance(asset, dict):
        # Lists of named objects are glTF 1.0's, where the asset may be missing
        old = any(isinstance(header.get(key), dict) for key in ("accessors", "buffers", "meshes", "nodes"))
        raise ValueError(OLD.format("1.0") if old else "expected glTF 2.0, got JSON without an asset")
    version, least = asset.get("version"), asset.get("minVersion", "2.0")
    if not isinstance(version, str) or not version.startswith("2."):
        raise ValueError(OLD.format(version) if isinstance(version, str) else f"a version of {shown(version)}")
    if least != "2.0":
        raise ValueError(f"glTF that asks for version {shown(least)} at least, expected 2.0")
    for kind in ("buffers", "images"):
        entries = header.get(kind, [])
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise ValueError(f"expected {kind} to be a list of objects, got {shown(entries)}")


def _not_json(name: str) -> NoReturn:
    raise ValueError(f"expected numbers, got {name}")


def gltf_references(path: Path) -> Iterator[FileReference]:
    """External `uri`s of a glTF 2.0 file (section 3.6 and 3.8.4); data URIs are inside the file.

    Raises ValueError as `read_container` does, and for an address elsewhere.
    """
    header = read_container(path).header
    for kind in ("buffers", "images"):
        for index, entry in enumerate(header.get(kind, ())):
            uri, key = entry.get("uri"), f"{kind}[{index}].uri"
            if isinstance(uri, str) and uri and not is_data(uri):
                name = _local_name(path.parent, uri, key)
                judged = kind == "images" and not name.lower().endswith(NOT_PILLOWS)
                yield FileReference(by=path, key=key, written=uri, name=name, image=judged)


def is_data(uri: str) -> bool:
    """Whether an address holds its data."""
    return uri[:5].lower() == "data:"


def _local_name(folder: Path, uri: str, key: str) -> str:
    """The file that an address names, relative to `folder`: percent escapes undone, unless it is so called; Windows'
    separators are taken for what they are meant to be."""
    if SCHEME.match(uri) or uri.startswith(("/", "\\")):
        raise ValueError(f"{key}: expected a name relative to the file, got {shown(uri)} (nothing is fetched from "
                         "elsewhere; put the file beside it)")
    choices = [unquote(uri), uri, unquote(uri).replace("\\", "/")]
    return next((choice for choice in choices if os.path.isfile(folder / choice)), choices[-1])
