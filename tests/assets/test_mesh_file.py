"""Mesh files become assets: places, textures, units, and what is wrong with them."""

import io
import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.errors import UserError
from dataset_builder.geometry.edges import corner_normals, edges_of
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base
from dataset_builder.seeding import rng
from dataset_builder.spec.mesh_source import MESH_SUFFIXES

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[3] / "shared" / "assets")
COLORS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], dtype=np.uint8)
"""Image order: red and green on top, blue and white below."""
QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float32)
QUAD_UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
"""glTF's v points down: (0, 0) is the upper left corner of the image."""
QUAD_FACES = np.array([0, 1, 2, 0, 2, 3], dtype=np.uint16)


def load(path, **how):
    return load_mesh_file(path, name="thing", category="chair", licence="CC0-1.0", **how)


def png(texels):
    stream = io.BytesIO()
    Image.fromarray(texels).save(stream, "PNG")
    return stream.getvalue()


def gltf(blobs, *, material, nodes, roots=(0,), positions=QUAD):
    """glTF header and binary chunk of one quad; `blobs` are its images."""
    parts = [positions.tobytes(), QUAD_UVS.tobytes(), QUAD_FACES.tobytes(), *blobs]
    offsets = np.cumsum([0, *(-(-len(part) // 4) * 4 for part in parts)])
    views = [{"buffer": 0, "byteOffset": int(at), "byteLength": len(part)}
             for at, part in zip(offsets, parts, strict=False)]
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(roots)}], "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0] * 3, "max": [1] * 3},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": views, "buffers": [{"byteLength": int(offsets[-1])}], "materials": [material],
        "images": [{"bufferView": 3 + index, "mimeType": "image/png"} for index in range(len(blobs))],
        "textures": [{"source": index} for index in range(len(blobs))],
    }
    return header, b"".join(part.ljust(-(-len(part) // 4) * 4, b"\0") for part in parts)


def write_glb(path, images=(), *, pbr=None, extra=None, nodes=({"mesh": 0},), roots=(0,), positions=QUAD):
    material = {"name": "m", "pbrMetallicRoughness": pbr or {}, **(extra or {})}
    header, binary = gltf(list(images), material=material, nodes=list(nodes), roots=roots, positions=positions)
    text = json.dumps(header).encode()
    text = text.ljust(-(-len(text) // 4) * 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def texel_at(texture, uv):
    """Nearest texel under the Texture convention: row 0 at v = 1."""
    height, width = texture.base_color.shape[:2]
    return texture.base_color[min(int((1 - uv[1]) * height), height - 1), min(int(uv[0] * width), width - 1)]


def test_texture_rows_lie_where_gltf_puts_them(tmp_path):
    """The quad stands upright with the image on it: red is upper left."""
    path = write_glb(tmp_path / "quad.glb", [png(COLORS)], pbr={"baseColorTexture": {"index": 0}})
    asset = load(path)
    mesh, texture = asset.mesh, asset.materials[0].texture
    expected = {(-0.5, 1.0): (1, 0, 0), (0.5, 1.0): (0, 1, 0), (-0.5, 0.0): (0, 0, 1), (0.5, 0.0): (1, 1, 1)}
    seen = set()
    for face, uvs in zip(mesh.faces, mesh.uvs, strict=True):
        for vertex, uv in zip(face, uvs, strict=True):
            place = (mesh.positions[vertex, 0], mesh.positions[vertex, 2])
            np.testing.assert_array_equal(texel_at(texture, np.clip(uv, 0.01, 0.99)), expected[place])
            seen.add(place)
    assert len(seen) == 4


def test_front_of_a_gltf_file_comes_to_minus_y(tmp_path):
    mesh = load(write_glb(tmp_path / "quad.glb")).mesh
    assert (mesh.area_normals @ (0, -1, 0) > 0).all()
    np.testing.assert_allclose(mesh.bounds, [(-0.5, 0, 0), (0.5, 0, 1)])


@pytest.mark.parametrize(("up", "size"), [("x", (2, 3, 1)), ("y", (1, 3, 2)), ("z", (1, 2, 3))])
def test_up_and_scale(tmp_path, up, size):
    path = tmp_path / "tetra.obj"
    path.write_text("v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    mesh = load(path, up=up, scale=0.1).mesh
    np.testing.assert_allclose(mesh.bounds, [(-size[0] / 2, -size[1] / 2, 0), (size[0] / 2, size[1] / 2, size[2])])
    assert mesh.volume == pytest.approx(1)


def test_nodes_are_moved_turned_and_mirrored(tmp_path):
    nodes = [{"mesh": 0}, {"children": [2], "translation": [0, 2, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}]
    mesh = load(write_glb(tmp_path / "nodes.glb", nodes=nodes, roots=(0, 1))).mesh
    np.testing.assert_allclose(mesh.bounds, [(-1, 0, 0), (1, 0, 3)])
    np.testing.assert_allclose(mesh.area_normals, np.broadcast_to((0, -1, 0), (4, 3)))


def test_materials_keep_exact_linear_factors_and_channels(tmp_path):
    arm = np.array([[[9, 51, 204]]], dtype=np.uint8)
    bump = np.array([[[128, 128, 255]]], dtype=np.uint8)
    pbr = {"baseColorFactor": [0.001, 0.5, 1, 1], "baseColorTexture": {"index": 0}, "roughnessFactor": 0.5,
           "metallicRoughnessTexture": {"index": 1}}
    images = [png(COLORS), png(arm), png(bump)]
    path = write_glb(tmp_path / "m.glb", images, extra={"normalTexture": {"index": 2}}, pbr=pbr)
    material = load(path).materials[0]
    assert material.base_color == (0.001, 0.5, 1.0)
    assert (material.roughness, material.metallic) == (0.5, 1.0)
    texture = material.texture
    assert texture.roughness.shape == texture.metallic.shape == (2, 2) and texture.normal.shape == (2, 2, 3)
    np.testing.assert_allclose(texture.roughness, 51 / 255, rtol=1e-6)
    np.testing.assert_allclose(texture.metallic, 204 / 255, rtol=1e-6)
    np.testing.assert_allclose(texture.normal, np.broadcast_to((0, 0, 1), (2, 2, 3)), atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(texture.normal, axis=2), 1, rtol=1e-6)
    assert {array.dtype for array in (texture.base_color, texture.roughness, texture.normal)} == {np.dtype(np.float32)}




def test_meta_records_what_was_done(tmp_path):
    meta = load(write_glb(tmp_path / "quad.glb")).meta
    assert meta["licence"] == "CC0-1.0" and meta["source"] == "quad.glb"
    assert meta["moved"].startswith("-0.5 m, ")


def broken_gltf(folder):
    header, binary = gltf([png(COLORS)], material={"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}},
                          nodes=[{"mesh": 0}])
    header["buffers"][0]["uri"] = "quad.bin"
    header["images"] = [{"uri": "wood%20oak.png"}]
    (folder / "quad.bin").write_bytes(binary)
    (folder / "quad.gltf").write_text(json.dumps(header))
    return folder / "quad.gltf"


def test_a_texture_is_found_under_its_decoded_name_or_named(tmp_path):
    path = broken_gltf(tmp_path)
    with pytest.raises(UserError, match=r"quad.gltf: images\[0\].uri: expected an existing file, got wood oak.png"):
        load(path)
    (tmp_path / "wood oak.png").write_bytes(b"not an image")
    with pytest.raises(UserError, match=r"images\[0\].uri: expected a readable image"):
        load(path)
    (tmp_path / "wood oak.png").write_bytes(png(COLORS))
    assert load(path).materials[0].texture.base_color.shape == (2, 2, 3)
    (tmp_path / "quad.bin").unlink()
    with pytest.raises(UserError, match=r"buffers\[0\].uri: expected an existing file, got quad.bin"):
        load(path)


def test_no_such_file_and_unsupported(tmp_path):
    with pytest.raises(UserError, match=r"none\.glb: expected an existing file, got none"):
        load(tmp_path / "none.glb")
    with pytest.raises(UserError, match=r"got 'a.FBX': FBX is not read \(export glTF from Blender\)"):
        load(tmp_path / "a.FBX")
    with pytest.raises(UserError, match=r"expected a file that ends in one of .*, got 'a.jpg'"):
        load(tmp_path / "a.jpg")


@pytest.mark.parametrize("suffix", [suffix for suffix in MESH_SUFFIXES if not suffix.startswith(".usd")])
def test_every_format_is_read(tmp_path, suffix):
    written = trimesh.creation.box(extents=(1, 2, 4)).export(file_type=suffix[1:])
    for name, content in (written if isinstance(written, dict) else {f"model{suffix}": written}).items():
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    asset = load(tmp_path / f"model{suffix}", up="z", scale=0.5)
    np.testing.assert_allclose(asset.mesh.bounds, [(-0.25, -0.5, 0), (0.25, 0.5, 2)])
    assert asset.mesh.volume == pytest.approx(1) and len(asset.materials) == 1


@pytest.mark.parametrize("suffix", ["glb", "gltf", "ply"])
@pytest.mark.parametrize("content", [b"", b"nonsense", b"[1, 2]", b"glTF" + bytes(40), b"ply\nformat ascii 1.0\nelem"])
def test_unreadable_files(tmp_path, suffix, content):
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(content)
    with pytest.raises(UserError, match=f"a.{suffix}: expected"):
        load(path)


def test_an_embedded_image_that_is_none(tmp_path):
    path = write_glb(tmp_path / "a.glb", [b"not an image"], pbr={"baseColorTexture": {"index": 0}})
    with pytest.raises(UserError, match=r"a\.glb: material m: baseColorTexture: expected PNG or JPEG images"):
        load(path)
    cut = png(np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8))[:2000]
    path = write_glb(tmp_path / "b.glb", [cut], pbr={"baseColorTexture": {"index": 0}})
    with pytest.raises(UserError, match=r"b\.glb: expected readable textures"):
        load(path)


def test_empty_and_flat_meshes(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\n")
    with pytest.raises(UserError, match=r"a\.obj: expected"):
        load(tmp_path / "a.obj")
    flat = QUAD * np.array([1, 0, 0], dtype=np.float32)
    with pytest.raises(UserError, match=r"flat\.glb: mesh: expected at least one face with an area"):
        load(write_glb(tmp_path / "flat.glb", positions=flat))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_vertices_that_are_not_finite(tmp_path, value):
    positions = QUAD.copy()
    positions[2, 1] = value
    with pytest.raises(UserError, match="got 1 with NaN or Inf, first at vertex 2"):
        load(write_glb(tmp_path / "nan.glb", positions=positions))


def real_models():
    found = sorted(path for path in ASSETS.rglob("*") if path.suffix in (".gltf", ".obj")) if ASSETS.is_dir() else []
    return found or [None]


@pytest.mark.parametrize("path", real_models(), ids=lambda path: path.parent.name if path else "none")
def test_real_models_survive_the_whole_way(path):
    if path is None:
        pytest.skip("no real models: set THREEDF_ASSETS to a folder of .gltf and .obj files")
    asset = load(path, max_texture=64)
    assert asset.mesh.bounds[0, 2] == 0 and 0.1 < np.ptp(asset.mesh.bounds, axis=0).max() < 3
    np.testing.assert_allclose(asset.mesh.bounds.mean(axis=0)[:2], 0, atol=1e-9)
    assert all(material.texture is not None for material in asset.materials)
    base = rough_base(asset.mesh, edge_length=0.08, rounds=1, crease_angle=30)
    rough = displace(base.mesh, sigma=0.004, radius=bounding_radius(asset.mesh), direction="normal", rng=rng(0))
    np.testing.assert_allclose(np.ptp(base.mesh.bounds, axis=0), np.ptp(asset.mesh.bounds, axis=0), rtol=0.005)
    open_before, open_after = (edges_of(mesh.faces).face_count % 2 == 1 for mesh in (asset.mesh, rough))
    assert open_after.any() == open_before.any()
    np.testing.assert_allclose(np.linalg.norm(corner_normals(rough, creases=base.creases), axis=2), 1, rtol=1e-9)


def test_a_gltf_whose_buffer_is_too_short_is_told(tmp_path: Path) -> None:
    """Its one view asks for 36 bytes of a buffer of 12."""
    path = tmp_path / "short.gltf"
    path.write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAA"}]}))
    with pytest.raises(UserError, match=r"short\.gltf: expected a readable \.gltf file, got: data that ends early"):
        load_mesh_file(path, name="short", category="box", licence="CC0-1.0")
