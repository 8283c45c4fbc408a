"""Splats of a glTF file: primitives of points with KHR_gaussian_splatting, where the scene puts them.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_gaussian_splatting (ratified): scales are
linear, opacities in [0, 1], quaternions x y z w.
"""

from pathlib import Path

import numpy as np

from dataset_builder.assets.file_model import counted, refuse
from dataset_builder.assets.readers.gltf import gltf_reading
from dataset_builder.assets.readers.gltf_accessors import count_of, read_numbers
from dataset_builder.assets.readers.gltf_file import GltfFile, listed
from dataset_builder.assets.readers.gltf_nodes import Placed, node_tree, place_meshes
from dataset_builder.assets.readers.gltf_values import Entry
from dataset_builder.assets.readers.splat_columns import SplatFile, check_count, checked_cloud
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_moves import joined, moved

SPLATTING = "KHR_gaussian_splatting"
ENCODINGS = {"srgb_rec709_display": True, "lin_rec709_display": False}
"""Whether a colour space is sRGB-encoded."""
POINTS = 0


def read(path: Path) -> SplatFile:
    """All splats of the scene, in the file's axes. Raises UserError where the file breaks the format, has none or too
    many, or asks for a kernel or colour space that is not read."""
    with gltf_reading(path, 1, besides=frozenset({SPLATTING})) as reading:
        gltf = reading.gltf
        placed = place_meshes(gltf, node_tree(gltf))
        return _read(gltf, placed)


def _read(gltf: GltfFile, placed: Placed) -> SplatFile:
    found = [(primitive, entry, place) for placement in placed.placements for place in placement.places
             for primitive in gltf.lists["meshes"][placement.mesh].entries("primitives")
             if (entry := primitive.extension(SPLATTING)) is not None]
    check_count(gltf.path, sum(_count(gltf, primitive) for primitive, _, _ in found))
    files = {primitive.at: _splats(gltf, primitive, entry) for primitive, entry, _ in found}
    clouds = [_placed(primitive, files[primitive.at].cloud, place) for primitive, _, place in found]
    if len({cloud.srgb for cloud in clouds}) > 1:
        gltf.root.refuse("expected splats of one colour space, got two", "take one mesh of the file")
    others = sum(len(mesh.entries("primitives")) for mesh in gltf.lists["meshes"]) - len(files)
    return SplatFile(cloud=joined(clouds), notes=(
        *(f"{at}: {note}" for at, each in files.items() for note in each.notes),
        *([f"{counted(others, 'primitive')} without splats"] if others else []), *placed.left_out, *placed.decided))


def _count(gltf: GltfFile, primitive: Entry) -> int:
    index = primitive.entry("attributes").index("POSITION", gltf.lists["accessors"], "accessors")
    return 0 if index is None else count_of(gltf, index)


def _splats(gltf: GltfFile, primitive: Entry, entry: Entry) -> SplatFile:
    """What a primitive holds, in its mesh's coordinates."""
    if primitive.integer("mode", 4) != POINTS:
        primitive.refuse(f"expected points, as {SPLATTING} has them, got mode {primitive.integer('mode', 4)}",
                         key="mode")
    if (kernel := entry.text("kernel", "ellipse")) != "ellipse":
        entry.refuse(f"expected the kernel ellipse, got {kernel}", key="kernel")
    if (space := entry.text("colorSpace", "srgb_rec709_display")) not in ENCODINGS:
        entry.refuse(f"expected {' or '.join(ENCODINGS)}, got {space}", key="colorSpace")
    attributes = primitive.entry("attributes")
    packed = entry.entry("extensions").value
    if packed and not attributes.has(f"{SPLATTING}:ROTATION"):
        entry.refuse(f"expected splats as they are, got them packed with {listed(list(packed))}",
                     "unpack the file, or write it as .ply")

    def column(key: str, kind: str) -> np.ndarray:
        index = attributes.index(key, gltf.lists["accessors"], "accessors")
        if index is None:
            attributes.refuse(f"expected the attribute {key}, got {listed(list(attributes.value)) or 'none'}")
        values = read_numbers(gltf, index, kind).astype(np.float32)
        if len(values) != count:
            attributes.refuse(f"expected {count:,} elements, as POSITION has, got {len(values):,}", key=key)
        return values

    count = _count(gltf, primitive)
    degree = max((d for d in range(1, 4) if attributes.has(f"{SPLATTING}:SH_DEGREE_{d}_COEF_0")), default=0)
    harmonics = np.empty((count, (degree + 1)**2, 3), np.float32)
    names = [f"SH_DEGREE_{d}_COEF_{n}" for d in range(degree + 1) for n in range(2 * d + 1)]
    for number, name in enumerate(names):
        harmonics[:, number] = column(f"{SPLATTING}:{name}", "VEC3")
    with np.errstate(all="ignore"):
        return checked_cloud(
            gltf.path, centres=column("POSITION", "VEC3"), scales=column(f"{SPLATTING}:SCALE", "VEC3"),
            turns=np.roll(column(f"{SPLATTING}:ROTATION", "VEC4"), 1, axis=1),
            opacities=column(f"{SPLATTING}:OPACITY", "SCALAR")[:, 0], harmonics=harmonics, srgb=ENCODINGS[space])


def _placed(primitive: Entry, cloud: SplatCloud, place: np.ndarray) -> SplatCloud:
    if np.allclose(place, np.eye(4), rtol=0, atol=1e-9):
        return cloud
    return placed_cloud(primitive.path, primitive.at, cloud, place)


def placed_cloud(path: Path, at: str, cloud: SplatCloud, place: np.ndarray) -> SplatCloud:
    """The splats moved by a node's (4, 4) matrix. Raises UserError where that flattens them, or moves them too far."""
    if not np.isfinite(place).all() or np.linalg.cond(place[:3, :3]) > 1e6:
        refuse(path, "expected a transform that keeps splats solid, got one that flattens them", at=at)
    with np.errstate(all="ignore"):
        cloud = moved(cloud, place)
    if not (np.isfinite(cloud.centres).all() and np.isfinite(cloud.scales).all() and (cloud.scales > 0).all()):
        refuse(path, "expected a transform that keeps splats finite", at=at)
    return cloud
