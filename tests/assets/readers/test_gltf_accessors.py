"""Numbers of glTF accessors: types, strides, sparse values, and claims that the bytes do not bear out."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.readers.gltf_accessors import read_integers, read_numbers
from dataset_builder.assets.readers.gltf_file import GltfFile, open_gltf
from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD, GltfMaker, load, quad_of


def opened(tmp_path: Path, made: GltfMaker) -> GltfFile:
    return open_gltf(made.write(tmp_path / "a.glb"))


@pytest.mark.parametrize("name", ["int8", "uint8", "int16", "uint16"])
def test_normalised_integers_by_the_formats_equations(tmp_path: Path, name: str) -> None:
    kind = np.iinfo(name)
    made = GltfMaker()
    values = np.array([[kind.min, 0], [kind.max, 1]], dtype=name)
    index, plain = made.accessor(values, normalized=True), made.accessor(values)
    least = -1.0 if kind.min < 0 else 0.0
    np.testing.assert_allclose(read_numbers(opened(tmp_path, made), index, "VEC2"), [[least, 0], [1, 1 / kind.max]])
    np.testing.assert_array_equal(read_numbers(opened(tmp_path, made), plain, "VEC2"), values)


def test_whole_and_floating_numbers(tmp_path: Path) -> None:
    made = GltfMaker()
    wide, real = made.accessor(np.array([7, 2**32 - 1], np.uint32)), made.accessor(np.array([[0.5, -2, 3]], np.float32))
    file = opened(tmp_path, made)
    np.testing.assert_array_equal(read_integers(file, wide, "SCALAR")[:, 0], [7, 2**32 - 1])
    np.testing.assert_array_equal(read_numbers(file, real, "VEC3"), [[0.5, -2, 3]])
    with pytest.raises(UserError, match=r"accessors\[1\].componentType: expected unsigned integers, got 5126"):
        read_integers(file, real, "VEC3")
    with pytest.raises(UserError, match=r"accessors\[0\].type: expected VEC2, got SCALAR"):
        read_numbers(file, wide, "VEC2")


def test_elements_that_are_a_stride_apart(tmp_path: Path) -> None:
    made = GltfMaker()
    rows = np.zeros(4, dtype=[("position", "<f4", 3), ("uv", "<u2", 2)])
    rows["position"], rows["uv"] = QUAD, [[0, 65535], [65535, 65535], [65535, 0], [0, 0]]
    view = made.view(rows.tobytes(), byteStride=16)
    positions = made.accessor(QUAD, view=view)
    uvs = made.accessor(rows["uv"], view=view, byteOffset=12, normalized=True)
    file = opened(tmp_path, made)
    np.testing.assert_array_equal(read_numbers(file, positions, "VEC3"), QUAD)
    np.testing.assert_array_equal(read_numbers(file, uvs, "VEC2"), [[0, 1], [1, 1], [1, 0], [0, 0]])


def sparse(made: GltfMaker, places: Any, values: Any) -> dict[str, Any]:
    return {"count": len(places), "indices": {"bufferView": made.view(np.array(places, np.uint16).tobytes()),
                                              "componentType": 5123},
            "values": {"bufferView": made.view(np.array(values, np.float32).tobytes())}}


@pytest.mark.parametrize("based", [True, False])
def test_sparse_values_replace_what_is_there_or_zeros(tmp_path: Path, based: bool) -> None:
    made = GltfMaker()
    view = made.view(QUAD.tobytes()) if based else None
    index = made.accessor(QUAD, view=view, sparse=sparse(made, [1, 3], [[5, 6, 7], [8, 9, 10]]))
    expected = QUAD.copy() if based else np.zeros_like(QUAD)
    expected[[1, 3]] = [[5, 6, 7], [8, 9, 10]]
    np.testing.assert_array_equal(read_numbers(opened(tmp_path, made), index, "VEC3"), expected)


def test_sparse_places_beyond_the_end(tmp_path: Path) -> None:
    made = GltfMaker()
    index = made.accessor(QUAD, sparse=sparse(made, [4], [[0, 0, 0]]))
    with pytest.raises(UserError, match=r"sparse\.indices: expected whole numbers below 4, got 4"):
        read_numbers(opened(tmp_path, made), index, "VEC3")


@pytest.mark.parametrize(("change", "rule"), [
    ({"count": 2**31}, r"expected 2,147,483,648 elements in bufferViews\[0\], which has 48 bytes, got a need of"),
    ({"byteOffset": 4}, "which has 48 bytes, got a need of 52"),
    ({"count": 0}, r"count: expected a whole number in \[1, "), ({"count": "4"}, "count: expected a whole number"),
    ({"count": 1.5}, "count: expected a whole number"), ({"byteOffset": -4}, "byteOffset: expected a whole number"),
    ({"componentType": 5124}, "componentType: expected one of 5120, "), ({"type": "VEC9"}, "type: expected VEC3, got"),
    ({"bufferView": 1}, r"bufferView: expected a whole number in \[0, 0\], got 1"),
    ({"bufferView": None}, "bufferView: expected a whole number"),
    ({"normalized": 1}, "normalized: expected true or false")])
def test_claims_that_no_bytes_bear_out(tmp_path: Path, change: dict[str, Any], rule: str) -> None:
    made = GltfMaker()
    index = made.accessor(QUAD)
    made.header["accessors"][0] |= change
    with pytest.raises(UserError, match=rf"a\.glb: accessors\[0\].*{rule}"):
        read_numbers(opened(tmp_path, made), index, "VEC3")


def test_zeros_that_nothing_stands_for_are_bounded(tmp_path: Path) -> None:
    made = GltfMaker()
    index = made.accessor(QUAD, view=None)
    assert not read_numbers(opened(tmp_path, made), index, "VEC3").any()
    made.header["accessors"][0]["count"] = 2**31
    with pytest.raises(UserError, match=r"count: expected at most 4,194,304 elements without a bufferView"):
        read_numbers(opened(tmp_path, made), index, "VEC3")


@pytest.mark.parametrize(("view", "rule"), [
    ({"byteLength": 49}, r"expected bytes of buffers\[0\], which has 48, got 0 to 49"),
    ({"byteOffset": 2**40}, r"expected bytes of buffers\[0\]"),
    ({"buffer": 3}, r"buffer: expected a whole number in \[0, 0\]"),
    ({"byteStride": 8}, r"byteStride: expected at least 12, the size of an element of accessors\[0\], got 8")])
def test_views_that_their_buffer_does_not_have(tmp_path: Path, view: dict[str, int], rule: str) -> None:
    made = GltfMaker()
    index = made.accessor(QUAD)
    made.header["bufferViews"][0] |= view
    with pytest.raises(UserError, match=rf"bufferViews\[0\].*{rule}"):
        read_numbers(opened(tmp_path, made), index, "VEC3")


def test_quantised_positions_and_coordinates_come_out_as_they_were(tmp_path: Path) -> None:
    """KHR_mesh_quantization as gltfpack writes it: normalised numbers, and a node that scales them back."""
    made = GltfMaker()
    made.use("KHR_mesh_quantization", required=True)
    positions = made.accessor(np.array([[0, 0, 0], [32767, 0, 0], [32767, 32767, 0], [0, 32767, 0]], np.int16),
                              normalized=True, min=[0, 0, 0], max=[9, 9, 9])
    uvs = made.accessor(np.array([[0, 255], [255, 255], [255, 0], [0, 0]], np.uint8), normalized=True)
    material = made.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": made.texture(COLORS)}})
    made.draw(made.primitive(positions, TEXCOORD_0=uvs, material=material), scale=[0.6, 0.6, 0.6])
    mesh = load(made.write(tmp_path / "a.glb")).mesh
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), (0.6, 0, 0.6))
    np.testing.assert_allclose(mesh.uvs[0], [(0, 0), (1, 0), (1, 1)])


def test_values_that_are_not_numbers_are_counted(tmp_path: Path) -> None:
    positions = QUAD.copy()
    positions[[1, 2], 0] = np.nan, np.inf
    made = GltfMaker()
    made.draw(made.primitive(positions))
    with pytest.raises(UserError, match=r"meshes\[0\].primitives\[0\]: expected finite vertices, got 2 with NaN or "
                                        "Inf, first at vertex 1"):
        made.model(tmp_path)
    uvs = np.full((4, 2), np.nan, np.float32)
    made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, [COLORS])
    made.header["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = made.accessor(uvs)
    with pytest.raises(UserError, match="expected finite TEXCOORD_0, got 4 with NaN"):
        made.model(tmp_path)


def test_bytes_stay_little_endian(tmp_path: Path) -> None:
    made = GltfMaker()
    index = made.add("accessors", bufferView=made.view(struct.pack("<3f", 1, 2, 3)), componentType=5126, count=1,
                     type="VEC3")
    np.testing.assert_array_equal(read_numbers(opened(tmp_path, made), index, "VEC3"), [[1, 2, 3]])
