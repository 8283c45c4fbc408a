"""What a glTF file holds against what was taken of it, in words."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping

from dataset_builder.assets.file_model import counted
from dataset_builder.assets.readers.gltf_file import GltfFile, listed
from dataset_builder.assets.readers.gltf_nodes import Placed
from dataset_builder.assets.readers.gltf_primitives import corner_count, mode_of, triangle_count
from dataset_builder.assets.readers.gltf_values import Entry

MODES = ("points", "lines", "line loops", "line strips")
SILENT = ("KHR_xmp", "KHR_xmp_json_ld", "KHR_lights_punctual", "KHR_animation_pointer")
"""Extensions of which nothing is to be said, or more than their name."""
KNOWN_ATTRIBUTES = ("POSITION", "NORMAL", "TANGENT", "COLOR_0", "TEXCOORD_", "JOINTS_", "WEIGHTS_")
"""Those that are taken, or follow from what is: normals are made anew from the shape."""


def contents(gltf: GltfFile, placed: Placed, taken: Mapping[str, Entry], *, materials: int, images: int) -> str:
    """`2 meshes, 3 primitives, 36 triangles of 36, 2 materials, 1 image`; taken: what was read, by its place."""
    whole = sum(triangle_count(gltf, primitive) for mesh in gltf.lists["meshes"]
                for primitive in mesh.entries("primitives"))
    triangles = sum(triangle_count(gltf, primitive) for primitive in taken.values())
    meshes = len({placement.mesh for placement in placed.placements})
    places = sum(len(placement.places) for placement in placed.placements)
    words = [counted(meshes, "mesh", "meshes"), counted(len(taken), "primitive"),
             f"{triangles:,} triangles of {whole:,}", counted(materials, "material"), counted(images, "image")]
    return ", ".join([*words, *([f"in {places:,} places"] if places > meshes else [])])


def left_aside(gltf: GltfFile, honoured: Collection[str], besides: Collection[str]) -> list[str]:
    """What the file holds besides and is not honoured. besides: of cameras and lights, what is not."""
    lists = gltf.lists
    modes: Counter[str] = Counter()
    attributes: list[str] = []
    for mesh in lists["meshes"]:
        for primitive in mesh.entries("primitives"):
            if (mode := mode_of(primitive)) < len(MODES):
                modes[MODES[mode]] += corner_count(gltf, primitive)
            attributes += primitive.entry("attributes").value
    found = [f"{kind} ({counted(count, 'vertex', 'vertices')})" for kind, count in modes.items()]
    others = [name for name in attributes if not name.startswith(KNOWN_ATTRIBUTES)]
    found += [f"the attributes {listed(others)}"] if others else []
    found += [counted(len(lists[kind]), kind[:-1]) for kind in ("animations", "cameras")
              if lists[kind] and kind in ("animations", *besides)]
    lights = gltf.root.extension("KHR_lights_punctual")
    if "lights" in besides and lights is not None and (count := len(lights.entries("lights"))):
        found.append(counted(count, "light"))
    unknown = [name for name in dict.fromkeys([*gltf.root.names("extensionsUsed"), *_undeclared(gltf)])
               if name not in honoured and name not in SILENT and not name.startswith("KHR_materials_")]
    found += [f"the extensions {listed(unknown)}"] if unknown else []
    return [*found, *gltf.container.left_out]


def _undeclared(gltf: GltfFile) -> Iterator[str]:
    """Extensions where they stand, outside of materials, which name their own: `extensionsUsed` may lack them."""
    primitives = [primitive for mesh in gltf.lists["meshes"] for primitive in mesh.entries("primitives")]
    for entry in (gltf.root, *primitives, *(entry for kind, entries in gltf.lists.items() if kind != "materials"
                                            for entry in entries)):
        if entry.has("extensions"):
            yield from entry.entry("extensions").value
