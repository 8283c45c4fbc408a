"""Primitives of a glTF file -> triangles with their attributes (glTF 2.0, section 3.7.2), morphed and decompressed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dataset_builder.assets.file_model import counted
from dataset_builder.assets.readers.gltf_accessors import (
    WIDTHS,
    component_type,
    count_of,
    dequantised,
    has_bytes,
    read_integers,
    read_numbers,
)
from dataset_builder.assets.readers.gltf_file import GltfFile
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.extras import missing_named

DRACO = "KHR_draco_mesh_compression"
TRIANGLES, STRIP, FAN = 4, 5, 6
COLOUR_KINDS = ("VEC3", "VEC4")


@dataclass(frozen=True, kw_only=True, eq=False)
class GltfShape:
    """The triangles of a primitive, in the coordinates of its mesh."""

    positions: np.ndarray
    """(V, 3) float64."""
    faces: np.ndarray
    """(F, 3) int64."""
    uvs: np.ndarray | None
    """(V, 2), of the set that was asked for, v downwards as in the file."""
    colors: np.ndarray | None
    """(V, 4) linear and coverage, in [0, 1]."""
    influences: tuple[tuple[np.ndarray, np.ndarray], ...]
    """Sets of (V, 4) joints and (V, 4) weights."""
    notes: tuple[str, ...]


def triangle_count(gltf: GltfFile, primitive: Entry) -> int:
    """How many triangles a primitive states, 0 for points and lines. Raises UserError."""
    mode, count = mode_of(primitive), corner_count(gltf, primitive)
    return count // 3 if mode == TRIANGLES else max(count - 2, 0) if mode in (STRIP, FAN) else 0


def corner_count(gltf: GltfFile, primitive: Entry) -> int:
    """How many indices, or vertices without any, a primitive states."""
    index = primitive.index("indices", gltf.lists["accessors"], "accessors")
    if index is None:
        index = primitive.entry("attributes").index("POSITION", gltf.lists["accessors"], "accessors")
    return 0 if index is None else count_of(gltf, index)


def mode_of(primitive: Entry) -> int:
    """0 to 3 for points and lines, 4 to 6 for triangles, strips and fans."""
    return primitive.integer("mode", TRIANGLES, high=FAN)


def read_shape(gltf: GltfFile, primitive: Entry, *, weights: Sequence[float], uv_set: int | None,
               skinned: bool) -> GltfShape:
    """The shape of a primitive of triangles, with the morph targets added by their `weights`. Raises UserError."""
    source = _Source(gltf, primitive)
    positions = source.morphed("POSITION", ("VEC3",), weights)
    if positions is None:
        primitive.refuse("expected a POSITION", key="attributes")
    _check_finite(primitive, "vertices", positions)
    faces = _triangles(primitive, source.indices(len(positions)))
    _check_range(primitive, faces, len(positions))
    uvs = None if uv_set is None else source.morphed(f"TEXCOORD_{uv_set}", ("VEC2",), weights)
    if uvs is not None:
        _check_finite(primitive, f"TEXCOORD_{uv_set}", uvs)
    tones = source.morphed("COLOR_0", COLOUR_KINDS, weights)
    if tones is not None:
        _check_finite(primitive, "COLOR_0", tones)
    for name, values in (("texture coordinates", uvs), ("colours", tones)):
        if values is not None and len(values) != len(positions):
            primitive.refuse(f"expected {len(positions):,} {name}, one a vertex, got {len(values):,}", key="attributes")
    influences = tuple(source.influences(len(positions))) if skinned else ()
    beyond = 0 if tones is None else int(((tones < 0) | (tones > 1)).any(axis=1).sum())
    notes = (f"{counted(beyond, 'vertex colour')} beyond 1, taken as 1",) if beyond else ()
    return GltfShape(positions=positions, faces=faces, uvs=uvs, influences=influences, notes=notes,
                 colors=None if tones is None else _with_coverage(np.clip(tones, 0, 1)))


class _Source:
    """Attributes of a primitive: from accessors, or from its Draco stream where it has one."""

    def __init__(self, gltf: GltfFile, primitive: Entry):
        self._gltf, self._primitive = gltf, primitive
        self._attributes = primitive.entry("attributes")
        packed = primitive.extension(DRACO)
        self._draco: Any = None if packed is None or self._is_plain() else _draco(gltf, packed)
        self._ids = packed.entry("attributes") if self._draco is not None and packed is not None else None

    def _is_plain(self) -> bool:
        """Whether the primitive is there without compression, too."""
        accessors = self._gltf.lists["accessors"]
        index = self._attributes.index("POSITION", accessors, "accessors")
        optional = DRACO not in self._gltf.root.names("extensionsRequired")
        return optional and index is not None and has_bytes(self._gltf, index)

    def indices(self, vertices: int) -> np.ndarray:
        """(N,) indices as the mode takes them; Draco's are triangles in any mode."""
        index = self._primitive.index("indices", self._gltf.lists["accessors"], "accessors")
        if self._draco is not None:
            faces = np.asarray(self._draco.faces, dtype=np.int64)
            if faces.size < (stated := triangle_count(self._gltf, self._primitive) * 3):
                self._primitive.refuse(f"expected {stated // 3:,} triangles in its Draco data, got {len(faces):,}")
            return faces
        return np.arange(vertices) if index is None else read_integers(self._gltf, index, "SCALAR")[:, 0]

    def _read(self, entry: Entry, name: str, kinds: tuple[str, ...]) -> np.ndarray | None:
        """(V, width) float64 of an attribute, None where it is missing."""
        accessors = self._gltf.lists["accessors"]
        index = entry.index(name, accessors, "accessors")
        if index is None:
            return None
        if self._ids is not None and entry is self._attributes and self._ids.has(name):
            found = self._decoded(name, component_type(accessors[index]))
            if found.shape[1] not in [WIDTHS[kind] for kind in kinds]:
                self._primitive.refuse(f"expected {name} of {' or '.join(kinds)} in its Draco data, got "
                                       f"{found.shape[1]} numbers a vertex")
            return dequantised(found, accessors[index])
        values = read_numbers(self._gltf, index, *kinds)
        whole = component_type(accessors[index])
        if name.startswith("COLOR") and whole.kind != "f" and not accessors[index].flag("normalized"):
            values /= np.iinfo(whole).max
        return values

    def _decoded(self, name: str, dtype: np.dtype[Any]) -> np.ndarray:
        number = self._ids.integer(name, high=2**32) if self._ids is not None else 0
        for attribute in self._draco.attributes:
            if attribute["unique_id"] == number:
                return np.asarray(attribute["data"]).astype(dtype)
        return self._primitive.refuse(f"expected {name} as attribute {number} of its Draco data, got none")

    def morphed(self, name: str, kinds: tuple[str, ...], weights: Sequence[float]) -> np.ndarray | None:
        """An attribute plus the targets' differences by their weights (section 3.7.2.2)."""
        base = self._read(self._attributes, name, kinds)
        if base is None:
            return None
        for weight, target in zip(weights, self._primitive.entries("targets"), strict=True):
            change = self._read(target, name, ("VEC2", "VEC3", "VEC4")) if weight else None
            if change is not None:
                if change.shape != base.shape:
                    target.refuse(f"expected {base.shape} numbers, got {change.shape}", key=name)
                base = base + weight * change
        return base

    def influences(self, vertices: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Joints and weights, set by set."""
        number = 0
        accessors = self._gltf.lists["accessors"]
        while self._attributes.has(f"JOINTS_{number}"):
            weights = self._read(self._attributes, f"WEIGHTS_{number}", ("VEC4",))
            if self._ids is not None and self._ids.has(f"JOINTS_{number}"):
                joints = self._decoded(f"JOINTS_{number}", np.dtype(np.int64))
            else:
                index = self._attributes.index(f"JOINTS_{number}", accessors, "accessors")
                joints = read_integers(self._gltf, index or 0, "VEC4")
            if weights is None or weights.shape != (vertices, 4) or joints.shape != (vertices, 4):
                self._primitive.refuse(f"expected four joints and weights for each of {vertices:,} vertices",
                                       key="attributes")
            _check_finite(self._primitive, f"WEIGHTS_{number}", weights)
            yield joints, weights
            number += 1
        if not number:
            self._primitive.refuse("expected JOINTS_0, since its node has a skin", key="attributes")


def _draco(gltf: GltfFile, packed: Entry) -> Any:
    """The decoded stream of KHR_draco_mesh_compression."""
    number = packed.index("bufferView", gltf.lists["bufferViews"], "bufferViews")
    if number is None:
        packed.refuse("expected a bufferView, the key is missing")
    with missing_named():
        import DracoPy
    try:
        found = DracoPy.decode(gltf.view(number).tobytes())
    except (DracoPy.FileTypeException, ValueError, MemoryError, AssertionError) as error:
        packed.refuse(f"expected Draco data, got: {error}", "the file is damaged; export it again")
    if not isinstance(found, DracoPy.DracoMesh):
        packed.refuse("expected a mesh in its Draco data, got points")
    return found


def _triangles(primitive: Entry, indices: np.ndarray) -> np.ndarray:
    """(F, 3) of the indices of triangles, a strip, or a fan; those of a strip turn about (section 3.7.2.1)."""
    if indices.ndim == 2:
        return indices
    mode = mode_of(primitive)
    if mode == TRIANGLES:
        if len(indices) % 3:
            primitive.refuse(f"expected indices by threes, got {len(indices):,}")
        return indices.reshape(-1, 3)
    count = np.arange(max(len(indices) - 2, 0))
    if mode == FAN:
        corners = np.stack([count + 1, count + 2, np.zeros_like(count)], axis=1)
    else:
        corners = np.stack([count, count + 1 + count % 2, count + 2 - count % 2], axis=1)
    return indices[corners]


def _check_range(primitive: Entry, faces: np.ndarray, vertices: int) -> None:
    wrong = np.flatnonzero(faces.ravel() >= vertices)
    if len(wrong):
        primitive.refuse(f"expected indices below {vertices:,}, its number of vertices, got {len(wrong):,} of "
                         f"{faces.size:,} that are not, first {faces.ravel()[wrong[0]]:,} at corner {wrong[0]:,}",
                         "the file is damaged; export it again", key="indices")


def _check_finite(primitive: Entry, what: str, values: np.ndarray) -> None:
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        primitive.refuse(f"expected finite {what}, got {len(bad):,} with NaN or Inf, first at vertex {bad[0]}")


def _with_coverage(colors: np.ndarray) -> np.ndarray:
    return colors if colors.shape[1] == 4 else np.concatenate([colors, np.ones((len(colors), 1))], axis=1)

