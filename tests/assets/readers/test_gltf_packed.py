"""glTF with compressed parts: Draco, meshoptimizer, Basis Universal, WebP; and where a package for it is missing."""

import base64
import sys
import zlib
from pathlib import Path
from typing import Any

import DracoPy
import meshopt
import numpy as np
import pytest
from PIL import features

from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD, QUAD_FACES, QUAD_UVS, GltfMaker, load, png, quad_of

RED_BLUE = zlib.decompress(base64.b85decode(
    "c-mX-9TK5nWU!l;ONxsD2pEBw1Bh7|5P%ViK_CN&b%1yZltu>!ptJ%S4O7d+puw<=k%@tsnSnt7uB#r-`VR#1KpN<*@}kU=)FK9_#Ny0ih0wgrvecsD"
    "#2f`9JwpSC`|5$(uFEhykS{>kFV1k_k37Qxm~$Bb?}i(M"))
"""8 x 4 texels of UASTC in KTX2, red on the left and blue on the right, 230 in sRGB."""
DRACO = "KHR_draco_mesh_compression"
MESHOPT = "EXT_meshopt_compression"


def draco_quad(made: GltfMaker, shift: float, *, plain: bool = False, **more: Any) -> dict[str, Any]:
    """A quad in a Draco stream, with bytes for its accessors beside it or without."""
    packed = DracoPy.encode(QUAD + np.float32(shift), QUAD_FACES.reshape(-1, 3), quantization_bits=16,
                            preserve_order=True, tex_coord=QUAD_UVS.astype(np.float64),
                            colors=np.full((4, 4), 51, np.uint8))
    kinds = {"POSITION": (QUAD + 100).astype(np.float32), "TEXCOORD_0": QUAD_UVS, "COLOR_0": np.zeros((4, 4), np.uint8)}
    names = {"POSITION": 0, "COLOR_0": 2, "TEXCOORD_0": 3}
    ids = {name: next(each["unique_id"] for each in DracoPy.decode(packed).attributes if each["attribute_type"] == kind)
           for name, kind in names.items()}
    where = {} if plain else {"view": None}
    attributes = {name: made.accessor(values, normalized=name == "COLOR_0", **where) for name, values in kinds.items()}
    return {"attributes": attributes, "indices": made.accessor(QUAD_FACES, **where), **more,
            "extensions": {DRACO: {"bufferView": made.view(packed), "attributes": ids}}}


def test_draco_beside_a_plain_primitive(tmp_path: Path) -> None:
    made = GltfMaker()
    material = made.add("materials", alphaMode="BLEND")
    made.draw(draco_quad(made, 5, material=material), made.primitive())
    made.use(DRACO, required=True)
    model = made.model(tmp_path)
    assert "2 primitives, 4 triangles of 4" in model.contains
    packed, plain = model.parts
    np.testing.assert_allclose(sorted(packed.positions.tolist()), sorted((QUAD + 5).tolist()), atol=1e-4)
    assert packed.colors is not None
    np.testing.assert_allclose(packed.colors, 0.2, rtol=1e-6)
    np.testing.assert_array_equal(plain.positions, QUAD)


def test_coordinates_come_out_of_draco(tmp_path: Path) -> None:
    made = GltfMaker()
    made.texture(COLORS)
    material = made.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    strip = draco_quad(made, 0, material=material, mode=5)
    made.header["accessors"][strip["indices"]]["count"] = 4
    made.draw(strip)
    made.use(DRACO, required=True)
    part, = made.model(tmp_path).parts
    np.testing.assert_allclose(part.uvs[0], part.positions[part.faces][..., :2], atol=1e-4)


def test_what_is_there_without_draco_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that a file means the same whatever is installed."""
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    made = GltfMaker()
    made.draw(draco_quad(made, 5, plain=True))
    made.use(DRACO)
    np.testing.assert_array_equal(made.model(tmp_path).parts[0].positions, QUAD + 100)


def test_damaged_draco(tmp_path: Path) -> None:
    made = GltfMaker()
    primitive = draco_quad(made, 0)
    made.draw(primitive)
    made.use(DRACO, required=True)
    whole = made.binary
    made.binary = whole[:40].ljust(len(whole), b"\7")
    with pytest.raises(UserError, match=rf"primitives\[0\].extensions.{DRACO}: expected Draco data, got"):
        made.model(tmp_path)
    made.binary = whole
    ids = primitive["extensions"][DRACO]["attributes"]
    right, ids["POSITION"] = ids["POSITION"], 77
    with pytest.raises(UserError, match="expected POSITION as attribute 77 of its Draco data, got none"):
        made.model(tmp_path)
    ids["POSITION"] = ids["TEXCOORD_0"]
    with pytest.raises(UserError, match="expected POSITION of VEC3 in its Draco data, got 2 numbers a vertex"):
        made.model(tmp_path)
    ids["POSITION"] = right
    made.header["accessors"][primitive["indices"]]["count"] = 9
    with pytest.raises(UserError, match="expected 3 triangles in its Draco data, got 2"):
        made.model(tmp_path)


def meshopt_quad(*, fallback: bool = True, name: str = MESHOPT, **change: Any) -> GltfMaker:
    """A quad whose positions and indices are compressed views, as gltfpack writes them."""
    made = GltfMaker()
    padded = np.zeros((4, 4), np.int16)
    padded[:, :3] = QUAD * 32767
    streams = [(padded, "ATTRIBUTES", 8), (QUAD_FACES, "TRIANGLES", 2)]
    made.header["buffers"] = [{}, {"byteLength": 100, "extensions": {name: {"fallback": True}} if fallback else {}}]
    for values, mode, stride in streams:
        packed = meshopt.encode_gltf_buffer(values, mode)
        made.view(packed)
        where = made.header["bufferViews"].pop() | {"count": len(values), "byteStride": stride, "mode": mode}
        made.add("bufferViews", buffer=1, byteLength=values.nbytes, **({"byteStride": 8} if stride == 8 else {}),
                 extensions={name: where | change})
    made.header["buffers"][0] = {"byteLength": len(made.binary)}
    positions = made.add("accessors", bufferView=0, componentType=5122, normalized=True, count=4, type="VEC3")
    made.draw({"attributes": {"POSITION": positions},
               "indices": made.add("accessors", bufferView=1, componentType=5123, count=6, type="SCALAR")})
    made.use(name, "KHR_mesh_quantization", required=True)
    return made


@pytest.mark.parametrize(("fallback", "name"), [(True, MESHOPT), (False, MESHOPT), (True, "KHR_meshopt_compression")])
def test_meshoptimizer(tmp_path: Path, fallback: bool, name: str) -> None:
    part, = meshopt_quad(fallback=fallback, name=name).model(tmp_path).parts
    corners = {tuple(sorted(map(tuple, part.positions[face].tolist()))) for face in part.faces}
    assert corners == {((0, 0, 0), (1, 0, 0), (1, 1, 0)), ((0, 0, 0), (0, 1, 0), (1, 1, 0))}


def test_a_buffer_that_stands_there_plainly_is_taken(tmp_path: Path) -> None:
    made = GltfMaker()
    made.draw(made.primitive())
    made.header["bufferViews"][0]["extensions"] = {MESHOPT: {"buffer": 0, "byteLength": 1, "count": 1}}
    made.use(MESHOPT)
    np.testing.assert_array_equal(made.model(tmp_path).parts[0].positions, QUAD)


@pytest.mark.parametrize(("change", "rule"), [
    ({"count": 2**31}, "expected at most .* bytes out of"),
    ({"mode": "POINTS"}, "expected data compressed by meshoptimizer"),
    ({"byteOffset": 3}, "expected data compressed by meshoptimizer, got: Malformed"),
    ({"byteStride": 3}, "expected data"),
    ({"filter": "NOISE"}, "expected data compressed")])
def test_damaged_meshoptimizer(tmp_path: Path, change: dict[str, Any], rule: str) -> None:
    with pytest.raises(UserError, match=rf"bufferViews\[0\].extensions.{MESHOPT}: {rule}"):
        meshopt_quad(**change).model(tmp_path)


def with_basis(made: GltfMaker, key: str = "baseColorTexture") -> GltfMaker:
    """Its first texture in KTX2, with what was its image as a fallback."""
    image = made.add("images", bufferView=made.view(RED_BLUE), mimeType="image/ktx2")
    made.header["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": image}}
    made.use("KHR_texture_basisu")
    return made


@pytest.mark.parametrize("material", [
    {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, {"normalTexture": {"index": 0}}])
def test_basis_universal_where_there_is_nothing_else(tmp_path: Path, material: dict[str, Any]) -> None:
    made = with_basis(quad_of(material, [COLORS]))
    del made.header["textures"][0]["source"]
    texture = made.model(tmp_path).materials[0].material.texture
    assert texture is not None and texture.base_color.shape == (4, 8, 3)
    if "normalTexture" in material:
        # Red points along the surface or into it, and is no normal; dark blue is one
        assert texture.normal is not None and texture.normal[0, 0].tolist() == [0, 0, 1]
        assert texture.normal[-1, -1, 0] < -0.4 and texture.normal[-1, -1, 2] > 0.3
    else:
        np.testing.assert_allclose(texture.base_color[:, [0, 7]], [[(0.7913, 0, 0), (0, 0, 0.7913)]] * 4, atol=1e-4)


def test_a_fallback_of_basis_universal_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    made = with_basis(quad_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [COLORS]))
    texture = made.model(tmp_path).materials[0].material.texture
    assert texture is not None and texture.base_color.shape == (2, 2, 3)


def test_basis_universal_that_is_damaged(tmp_path: Path) -> None:
    for cut in (RED_BLUE[:60], RED_BLUE[:200], RED_BLUE[:20] + b"\xff\xff\xff\x7f" + RED_BLUE[24:]):
        made = quad_of({"normalTexture": {"index": 0}}, [cut])
        with pytest.raises(UserError, match=r"images\[0\]: expected a"):
            made.model(tmp_path)


def test_images_in_ktx2_may_lie_beside(tmp_path: Path) -> None:
    made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [COLORS])
    made.header["images"][0] = {"uri": "red.ktx2"}
    path = made.write(tmp_path / "a.glb")
    (tmp_path / "red.ktx2").write_bytes(RED_BLUE)
    assert load(path).materials[0].texture.base_color.shape == (4, 8, 3)  # type: ignore[union-attr]


@pytest.mark.parametrize("kind", ["webp", "avif"])
def test_webp_and_avif_come_before_their_fallback(tmp_path: Path, kind: str) -> None:
    if not features.check(kind):
        pytest.skip(f"Pillow was built without {kind}")
    made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [COLORS])
    other = made.add("images", bufferView=made.view(png(np.full((4, 4, 3), 9, np.uint8), kind.upper())))
    made.header["textures"][0]["extensions"] = {f"EXT_texture_{kind}": {"source": other}}
    made.use(f"EXT_texture_{kind}", required=True)
    texture = made.model(tmp_path).materials[0].material.texture
    assert texture is not None and texture.base_color.shape == (4, 4, 3)


@pytest.mark.parametrize("package", ["DracoPy", "meshopt", "opengl_basisu"])
def test_a_missing_package_is_named_with_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                         package: str) -> None:
    if package == "meshopt":
        made = meshopt_quad()
    elif package == "DracoPy":
        made = GltfMaker()
        made.draw(draco_quad(made, 0))
    else:
        made = quad_of({"normalTexture": {"index": 0}}, [RED_BLUE])
    path = made.write(tmp_path / "a.glb")
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UserError, match=rf"a\.glb: expected the package {package}, which is not installed; "
                                        r'pip install "3df-lighting-builder\[gltf\]"'):
        load(path)
