"""The header of a glTF file, and the files that it names."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from dataset_builder.digest import open_regular
from dataset_builder.spec.file_reference import MOST_BYTES, FileReference
from dataset_builder.spec.problems import shown


def gltf_header(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf file, or the first chunk of a .glb file, which is its JSON (glTF 2.0, section 4.4).

    Raises ValueError where there is none.
    """
    with open_regular(path, most=MOST_BYTES) as stream:
        data = stream.read()
    if path.suffix.lower() == ".glb":
        if data[:4] != b"glTF":
            raise ValueError(f"expected it to start with glTF, got {data[:4]!r}")
        data = data[20:20 + int.from_bytes(data[12:16], "little")]
    try:
        header = json.loads(data)
    except RecursionError as error:
        raise ValueError("expected JSON that is not nested without end") from error
    if not isinstance(header, dict):
        raise ValueError("expected it to hold an object")
    for kind in ("buffers", "images", "materials"):
        _require_objects(kind, header.get(kind, []))
    return header


def _require_objects(kind: str, entries: Any) -> None:
    """Raise ValueError where entries of a glTF header are not what all who read it take them for."""
    parts = [*entries] if isinstance(entries, list) else [entries]
    for entry in [*parts]:
        if kind == "materials" and isinstance(entry, dict):
            parts += [entry.get("pbrMetallicRoughness", {}), entry.get("extensions", {})]
            if not isinstance(entry.get("name", ""), str):
                raise ValueError(f"expected a material's name to be text, got {shown(entry['name'])}")
    if wrong := [part for part in parts if not isinstance(part, dict)]:
        raise ValueError(f"expected {kind} to be objects, got {shown(wrong[0])}")


def gltf_references(path: Path) -> Iterator[FileReference]:
    """External `uri`s of a glTF 2.0 file (section 3.6 and 3.8.4); data URIs are inside the file."""
    header = gltf_header(path)
    for kind in ("buffers", "images"):
        for index, entry in enumerate(header.get(kind, ())):
            uri = entry.get("uri")
            if isinstance(uri, str) and uri and not uri.startswith("data:"):
                yield FileReference(by=path, key=f"{kind}[{index}].uri", written=uri, name=unquote(uri),
                                    image=kind == "images")
