"""Accessors of a glTF file -> arrays (glTF 2.0, section 3.6.2), held to the bytes that there are before any is made."""

from typing import Any

import numpy as np

from dataset_builder.assets.readers.gltf_file import GltfFile
from dataset_builder.assets.readers.gltf_values import Entry

COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"), 5121: np.dtype("<u1"), 5122: np.dtype("<i2"), 5123: np.dtype("<u2"),
    5125: np.dtype("<u4"), 5126: np.dtype("<f4")}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MOST_ZEROS = 2**22
"""Elements of an accessor that no bytes stand for."""


def read_numbers(gltf: GltfFile, index: int, *kinds: str) -> np.ndarray:
    """(N, width) float64 of an accessor of one of some `kinds`; normalised integers in [-1, 1]. Raises UserError."""
    entry = gltf.lists["accessors"][index]
    return dequantised(_elements(gltf, entry, kinds), entry)


def read_integers(gltf: GltfFile, index: int, kind: str) -> np.ndarray:
    """(N, width) int64 of an accessor of unsigned integers. Raises UserError."""
    entry = gltf.lists["accessors"][index]
    found = _elements(gltf, entry, (kind,))
    if found.dtype.kind != "u":
        entry.refuse(f"expected unsigned integers, got {entry.value.get('componentType')}", key="componentType")
    return found.astype(np.int64)


def count_of(gltf: GltfFile, index: int) -> int:
    """How many elements an accessor states. Raises UserError."""
    return gltf.lists["accessors"][index].integer("count", low=1)


def has_bytes(gltf: GltfFile, index: int) -> bool:
    """Whether an accessor has values of its own."""
    entry = gltf.lists["accessors"][index]
    return entry.has("bufferView") or entry.has("sparse")


def dequantised(values: np.ndarray, accessor: Entry) -> np.ndarray:
    """Values as float64; those of an accessor that is `normalized` by the equations of section 3.6.2.2."""
    numbers = values.astype(np.float64)
    if not accessor.flag("normalized") or values.dtype.kind == "f":
        return numbers
    return np.maximum(numbers / np.iinfo(values.dtype).max, -1.0)


def component_type(entry: Entry) -> np.dtype[Any]:
    """The type of an accessor's numbers. Raises UserError for none of the six."""
    kind = entry.integer("componentType")
    if kind not in COMPONENTS:
        entry.refuse(f"expected one of {', '.join(map(str, COMPONENTS))}, got {kind}", key="componentType")
    return COMPONENTS[kind]


def _elements(gltf: GltfFile, entry: Entry, kinds: tuple[str, ...]) -> np.ndarray:
    """(N, width) as stored, sparse values put in."""
    kind = entry.text("type")
    if kind not in kinds:
        entry.refuse(f"expected {' or '.join(kinds)}, got {kind or 'nothing'}", key="type")
    dtype, count = component_type(entry), entry.integer("count", low=1)
    if entry.has("bufferView"):
        found = _stored(gltf, entry, dtype, count, WIDTHS[kind])
    elif count > MOST_ZEROS:
        entry.refuse(f"expected at most {MOST_ZEROS:,} elements without a bufferView, got {count:,}", key="count")
    else:
        found = np.zeros((count, WIDTHS[kind]), dtype)
    return _with_sparse(gltf, entry, found) if entry.has("sparse") else found


def _stored(gltf: GltfFile, entry: Entry, dtype: np.dtype[Any], count: int, width: int) -> np.ndarray:
    """(count, width) elements that a bufferView holds, `byteStride` apart."""
    number = entry.index("bufferView", gltf.lists["bufferViews"], "bufferViews")
    if number is None:
        entry.refuse("expected a bufferView, the key is missing")
    view, element = gltf.view(number), dtype.itemsize * width
    start = entry.integer("byteOffset", 0)
    stride = gltf.lists["bufferViews"][number].integer("byteStride", element, low=1, high=256)
    if stride < element:
        gltf.lists["bufferViews"][number].refuse(f"expected at least {element}, the size of an element of {entry.at}, "
                                                 f"got {stride}", key="byteStride")
    if (needed := start + stride * (count - 1) + element) > len(view):
        entry.refuse(f"expected {count:,} elements in bufferViews[{number}], which has {len(view):,} bytes, got a need "
                     f"of {needed:,}", "the file is damaged; export it again")
    return np.ndarray((count, width), dtype, view, start, (stride, dtype.itemsize))


def _with_sparse(gltf: GltfFile, entry: Entry, base: np.ndarray) -> np.ndarray:
    """The elements, with those that `sparse` names replaced (section 3.6.2.3)."""
    sparse = entry.entry("sparse")
    count = sparse.integer("count", low=1, high=len(base))
    kind = sparse.entry("indices")
    places = _stored(gltf, kind, component_type(kind), count, 1)[:, 0]
    if places.dtype.kind != "u" or places.max() >= len(base):
        kind.refuse(f"expected whole numbers below {len(base):,}, got {places.max()}")
    values = _stored(gltf, sparse.entry("values"), base.dtype, count, base.shape[1])
    found = base.copy()
    found[places] = values
    return found
