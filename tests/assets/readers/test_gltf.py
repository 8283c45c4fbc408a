"""glTF files on their whole way to assets; real ones, and files that are damaged at random."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.readers import gltf
from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD_UVS, GltfMaker, load, png, texel_at, write_glb

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[4] / "shared" / "assets")
BASE = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def test_texture_rows_lie_where_gltf_puts_them(tmp_path: Path) -> None:
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


def test_front_of_a_gltf_file_comes_to_minus_y(tmp_path: Path) -> None:
    mesh = load(write_glb(tmp_path / "quad.glb")).mesh
    assert (mesh.area_normals @ (0, -1, 0) > 0).all()
    np.testing.assert_allclose(mesh.bounds, [(-0.5, 0, 0), (0.5, 0, 1)])


def test_materials_keep_exact_linear_factors_and_channels(tmp_path: Path) -> None:
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


def test_a_texture_is_found_under_its_decoded_name_or_named(tmp_path: Path) -> None:
    made = GltfMaker()
    made.add("images", uri="wood%20oak.png")
    made.add("textures", source=0)
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=made.add("materials", **BASE)))
    made.add("buffers", uri="quad.bin", byteLength=len(made.binary))
    (tmp_path / "quad.bin").write_bytes(made.binary)
    path = tmp_path / "quad.gltf"
    path.write_text(json.dumps(made.finished()))
    with pytest.raises(UserError, match=r"quad.gltf: images\[0\].uri: expected an existing file, got wood oak.png"):
        load(path)
    (tmp_path / "wood oak.png").write_bytes(b"not an image")
    with pytest.raises(UserError, match=r"images\[0\].uri: wood oak.png: expected a readable image"):
        load(path)
    (tmp_path / "wood oak.png").write_bytes(png(COLORS))
    assert load(path).materials[0].texture.base_color.shape == (2, 2, 3)
    (tmp_path / "quad.bin").unlink()
    with pytest.raises(UserError, match=r"buffers\[0\].uri: expected an existing file, got quad.bin"):
        load(path)


def test_an_embedded_image_that_is_none(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "a.glb", [b"not an image"], pbr={"baseColorTexture": {"index": 0}})
    with pytest.raises(UserError, match=r"a\.glb: images\[0\]: expected a PNG, JPEG, .* starts with b'not an i'"):
        load(path)
    cut = png(np.random.default_rng(0).integers(0, 255, (64, 64, 3), dtype=np.uint8))[:2000]
    path = write_glb(tmp_path / "b.glb", [cut], pbr={"baseColorTexture": {"index": 0}})
    with pytest.raises(UserError, match=r"b\.glb: images\[0\].*: expected a readable image"):
        load(path)


def real_models() -> list[Path | None]:
    found = sorted(ASSETS.rglob("*.gltf")) + sorted(ASSETS.rglob("*.glb")) if ASSETS.is_dir() else []
    return found or [None]


@pytest.mark.parametrize("path", real_models(), ids=lambda path: path.parent.name if path else "none")
def test_real_models_are_read_whole(path: Path | None) -> None:
    """Every triangle, without anything left out but what the file's maps share."""
    if path is None:
        pytest.skip("no real models: set THREEDF_ASSETS to a folder of .gltf files")
    model = gltf.read(path, 32)
    header = json.loads(path.read_text())
    stated = sum(header["accessors"][primitive["indices"]]["count"] // 3
                 for mesh in header["meshes"] for primitive in mesh["primitives"])
    assert sum(len(part.faces) for part in model.parts) == stated
    assert f"{stated:,} triangles of {stated:,}" in model.contains
    assert model.left_out == () and all(each.left_out == () for each in model.materials)
    lows, highs = ([header["accessors"][primitive["attributes"]["POSITION"]][key] for mesh in header["meshes"]
                    for primitive in mesh["primitives"]] for key in ("min", "max"))
    places = np.concatenate([part.positions for part in model.parts])
    if all("translation" not in node and "rotation" not in node for node in header["nodes"]):
        np.testing.assert_allclose(places.min(axis=0), np.min(lows, axis=0))
        np.testing.assert_allclose(places.max(axis=0), np.max(highs, axis=0))
