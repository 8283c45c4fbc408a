"""A glTF file on its way in: its lists, its buffers, and the bytes of its views, all held to their stated sizes."""

import base64
import binascii
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from urllib.parse import unquote_to_bytes

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.digest import read_regular
from dataset_builder.errors import printable
from dataset_builder.extras import missing_named
from dataset_builder.spec.file_reference import MOST_BYTES
from dataset_builder.spec.gltf_references import GltfContainer, is_data, read_container
from dataset_builder.spec.mesh_source import references
from dataset_builder.spec.problems import name_alike, shown

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
MESHOPT_RATIO = 1024
"""The codec's best: a row of zeros of at most 256 bytes takes a quarter of a byte."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfFile:
    """The JSON of a file and, once asked for, its buffers. Methods raise UserError."""

    path: Path
    container: GltfContainer
    files: dict[str, Path]
    """External files by the key that names them, such as `images[2].uri`."""
    _buffers: dict[int, bytes | memoryview] = field(default_factory=dict)
    _views: dict[int, np.ndarray] = field(default_factory=dict)

    @cached_property
    def root(self) -> Entry:
        """The whole JSON."""
        return Entry(self.container.header, "", self.path)

    @cached_property
    def lists(self) -> dict[str, list[Entry]]:
        """The top level's lists of objects by their names; empty where there are none."""
        return {name: self.root.entries(name) for name in (
            "accessors", "animations", "bufferViews", "buffers", "cameras", "images", "materials", "meshes", "nodes",
            "samplers", "scenes", "skins", "textures")}

    def buffer(self, index: int) -> bytes | memoryview:
        """The bytes of a buffer, at least as many as it states."""
        if index not in self._buffers:
            entry = self.lists["buffers"][index]
            data, needed = self._content(entry, index), entry.integer("byteLength", low=1)
            if len(data) < needed:
                entry.refuse(f"expected {needed:,} bytes, got {len(data):,}", "the file that holds it is cut short")
            self._buffers[index] = data
        return self._buffers[index]

    def _content(self, entry: Entry, index: int) -> bytes | memoryview:
        if entry.has("uri"):
            return self.external(entry)
        if index == 0 and self.container.binary is not None:
            return self.container.binary
        return entry.refuse("expected a uri, or a .glb file with a binary chunk")

    def external(self, entry: Entry) -> bytes:
        """What the `uri` of a buffer or an image holds or names."""
        uri = entry.text("uri")
        if is_data(uri):
            return _decoded(entry, uri)
        file = self.files.get(f"{entry.at}.uri")
        if file is None:
            entry.refuse("expected the name of a file", key="uri")
        try:
            return read_regular(file, most=MOST_BYTES)
        except OSError as error:
            return entry.refuse(f"expected a readable file, got {file.name}: {error.strerror}", name_alike(file),
                                key="uri")

    def view(self, index: int) -> np.ndarray:
        """(N,) uint8, the bytes of a bufferView, decompressed if need be."""
        if index not in self._views:
            entry = self.lists["bufferViews"][index]
            packed = next((found for name in MESHOPT if (found := entry.extension(name)) is not None), None)
            plain = packed is None or self._is_plain(entry)
            self._views[index] = self._slice(entry) if plain or packed is None else self._unpacked(packed)
        return self._views[index]

    def _is_plain(self, entry: Entry) -> bool:
        """Whether a compressed view also stands in its buffer as it is."""
        number = entry.index("buffer", self.lists["buffers"], "buffers")
        if number is None:
            return False
        buffer = self.lists["buffers"][number]
        marked = any((found := buffer.extension(name)) is not None and found.flag("fallback") for name in MESHOPT)
        return not marked and (buffer.has("uri") or (number == 0 and self.container.binary is not None))

    def _slice(self, entry: Entry) -> np.ndarray:
        number = entry.index("buffer", self.lists["buffers"], "buffers")
        if number is None:
            entry.refuse("expected a buffer, the key is missing")
        data = self.buffer(number)
        start, length = entry.integer("byteOffset", 0), entry.integer("byteLength", low=1)
        if start + length > len(data):
            entry.refuse(f"expected bytes of buffers[{number}], which has {len(data):,}, got {start:,} to "
                         f"{start + length:,}")
        return np.frombuffer(data, np.uint8, length, start)

    def _unpacked(self, entry: Entry) -> np.ndarray:
        """EXT_meshopt_compression: what a stream of its three kinds holds."""
        source = self._slice(entry)
        count, stride = entry.integer("count", low=1), entry.integer("byteStride", low=1, high=256)
        mode, kind = entry.text("mode"), entry.text("filter", "NONE")
        if count * stride > MESHOPT_RATIO * len(source):
            entry.refuse(f"expected at most {MESHOPT_RATIO * len(source):,} bytes out of {len(source):,}, got "
                         f"{count:,} times {stride}")
        with missing_named():
            import meshopt
        try:
            rows = meshopt.decode_gltf_buffer(source.tobytes(), count, stride, mode, kind)
        except (ValueError, MemoryError) as error:
            entry.refuse(f"expected data compressed by meshoptimizer, got: {error}",
                         "unpack the file with `gltf-transform copy`, or export it again")
        return np.ascontiguousarray(rows).reshape(-1).view(np.uint8)


def open_gltf(path: Path, roots: Sequence[Path] = ()) -> GltfFile:
    """Read the container. roots: folders, beside its own, that it may name files in. Raises UserError where it cannot
    be."""
    try:
        files = {reference.key: path.parent / reference.name for reference in references(path, roots)}
        return GltfFile(path=path, container=read_container(path), files=files)
    except (OSError, ValueError) as error:
        refuse(path, f"expected a readable {path.suffix} file, got: {error}")


def _decoded(entry: Entry, uri: str) -> bytes:
    """The content of a data URI (RFC 2397)."""
    head, comma, text = uri.partition(",")
    if not comma:
        entry.refuse(f"expected data after a comma, got {shown(uri)}", key="uri")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(text)
    try:
        packed = unquote_to_bytes(text)
        return base64.b64decode(packed + b"=" * (-len(packed) % 4), validate=True)
    except binascii.Error as error:
        return entry.refuse(f"expected base64, got: {error}", key="uri")


def listed(words: Sequence[str], most: int = 6) -> str:
    """Words of a file with commas, each once, cut where there are many."""
    once = list(dict.fromkeys(map(printable, words)))
    return ", ".join(once[:most]) + (f" and {len(once) - most} more" if len(once) > most else "")
