"""glTF files made in code, for tests."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.assets.asset import Asset, Texture
from dataset_builder.assets.file_model import FileModel
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers import gltf

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
QUAD_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
"""glTF's v points down: (0, 0) is the upper left corner of the image."""
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)
COLORS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], dtype=np.uint8)
"""Image order: red and green on top, blue and white below."""
COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def png(texels: np.ndarray, kind: str = "PNG", **how: Any) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(texels).save(stream, kind, **how)
    return stream.getvalue()


def one_texel(*values: int) -> bytes:
    return png(np.array([[values]], dtype=np.uint8))


def glb(header: dict[str, Any] | bytes, binary: bytes | None, *, pad: bytes = b" ", version: int = 2) -> bytes:
    """A .glb file of its two chunks."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    text = text.ljust(-(-len(text) // 4) * 4, pad)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary is not None:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks)) + chunks


class GltfMaker:
    """A file under construction; every method that adds something returns its index."""

    def __init__(self) -> None:
        self.header: dict[str, Any] = {"asset": {"version": "2.0"}}
        self.binary = b""

    def add(self, kind: str, **entry: Any) -> int:
        entries = self.header.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, **more: Any) -> int:
        index = self.add("bufferViews", buffer=0, byteOffset=len(self.binary), byteLength=len(data), **more)
        self.binary += data.ljust(-(-len(data) // 4) * 4, b"\0")
        return index

    def accessor(self, values: np.ndarray, **more: Any) -> int:
        """An array whose last axis are components; `view` says where it lies, None that it lies nowhere."""
        values = np.asarray(values)
        values = values[:, None] if values.ndim == 1 else values
        view = more.pop("view", -1)
        view = self.view(values.tobytes()) if view == -1 else view
        place = {} if view is None else {"bufferView": view}
        return self.add("accessors", **place, componentType=COMPONENTS[values.dtype.name], count=len(values),
                        type=TYPES[values.shape[1]], **more)

    def texture(self, image: bytes | np.ndarray, *, sampler: dict[str, int] | None = None,
                mime: str = "image/png") -> int:
        content = image if isinstance(image, bytes) else png(image)
        source = self.add("images", bufferView=self.view(content), mimeType=mime)
        more = {} if sampler is None else {"sampler": self.add("samplers", **sampler)}
        return self.add("textures", source=source, **more)

    def primitive(self, positions: np.ndarray = QUAD, faces: np.ndarray | None = QUAD_FACES,
                  **attributes: Any) -> dict[str, Any]:
        """A primitive; attributes in small letters are its other keys, and all may be arrays or accessors."""
        found = {"POSITION": positions, **{key: value for key, value in attributes.items() if key.isupper()}}
        made: dict[str, Any] = {key: value for key, value in attributes.items() if not key.isupper()}
        made["attributes"] = {key: value if isinstance(value, int) else self.accessor(value)
                              for key, value in found.items()}
        if faces is not None:
            made["indices"] = self.accessor(faces)
        return made

    def draw(self, *primitives: dict[str, Any], mesh: dict[str, Any] | None = None, **node: Any) -> int:
        """A mesh in a node of its own."""
        return self.add("nodes", mesh=self.add("meshes", primitives=list(primitives), **(mesh or {})), **node)

    def use(self, *names: str, required: bool = False) -> None:
        self.header.setdefault("extensionsUsed", []).extend(names)
        if required:
            self.header.setdefault("extensionsRequired", []).extend(names)

    def finished(self) -> dict[str, Any]:
        """The header, with a scene of all nodes without parents unless there is one."""
        children = {child for node in self.header.get("nodes", []) for child in node.get("children", [])}
        roots = [number for number in range(len(self.header.get("nodes", []))) if number not in children]
        buffers = self.header.get("buffers") or [{"byteLength": len(self.binary)}]
        return {"scene": 0, "scenes": [{"nodes": roots}], **self.header, "buffers": buffers}

    def write(self, path: Path) -> Path:
        path.write_bytes(glb(self.finished(), self.binary))
        return path

    def model(self, folder: Path) -> FileModel:
        return gltf.read(self.write(folder / "a.glb"), 1024)

    def asset(self, folder: Path) -> Asset:
        return load(self.write(folder / "a.glb"))


def quad_of(material: dict[str, Any], images: Any = (), **attributes: Any) -> GltfMaker:
    """One quad of a material whose textures are `images`."""
    made = GltfMaker()
    for image in images:
        made.texture(image)
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=made.add("materials", **material), **attributes))
    return made


def load(path: Path, **how: Any) -> Asset:
    return load_mesh_file(path, name="thing", category="chair", licence="CC0-1.0", **how)


def texel_at(texture: Texture, uv: np.ndarray) -> np.ndarray:
    """Nearest texel under the Texture convention: row 0 at v = 1."""
    height, width = texture.base_color.shape[:2]
    return texture.base_color[min(int((1 - uv[1]) * height), height - 1), min(int(uv[0] * width), width - 1)]


def write_glb(path: Path, images: Any = (), *, pbr: Any = None, extra: Any = None, nodes: Any = ({"mesh": 0},),
              roots: Any = (0,), positions: np.ndarray = QUAD) -> Path:
    """One quad with one material, by nodes."""
    made = GltfMaker()
    for image in images:
        made.texture(image)
    made.add("materials", name="m", pbrMetallicRoughness=pbr or {}, doubleSided=True, **(extra or {}))
    made.add("meshes", primitives=[made.primitive(positions, TEXCOORD_0=QUAD_UVS, material=0)])
    made.header |= {"nodes": list(nodes), "scene": 0, "scenes": [{"nodes": list(roots)}]}
    return made.write(path)
