"""Glass, coats and sheen of mesh files: glTF's extensions."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.gltf_extensions import extended
from dataset_builder.errors import UserError

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)


def gltf(folder: Path, *materials: dict[str, Any]) -> Path:
    """One triangle of each material, side by side."""
    places = [TRIANGLE + np.array([2 * k, 0, 0]) for k in range(len(materials))]
    (folder / "a.bin").write_bytes(b"".join(place.astype(np.float32).tobytes() for place in places))
    count = range(len(materials))
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(count)}],
        "nodes": [{"mesh": k} for k in count], "materials": list(materials),
        "meshes": [{"primitives": [{"attributes": {"POSITION": k}, "material": k}]} for k in count],
        "accessors": [{"bufferView": k, "componentType": 5126, "count": 3, "type": "VEC3"} for k in count],
        "bufferViews": [{"buffer": 0, "byteOffset": 36 * k, "byteLength": 36} for k in count],
        "buffers": [{"uri": "a.bin", "byteLength": 36 * len(materials)}]}
    (folder / "a.gltf").write_text(json.dumps(header))
    return folder / "a.gltf"


def load(path: Path) -> Asset:
    return load_mesh_file(path, name="thing", category="thing", licence="CC0-1.0")


def entry(name: str = "m", **extensions: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.25},
            "extensions": {f"KHR_materials_{key}": value for key, value in extensions.items()}}


def made(tmp_path: Path, **extensions: dict[str, Any]) -> Material:
    return load(gltf(tmp_path, entry(**extensions))).materials[0]


def test_without_extensions_nothing_changes(tmp_path: Path) -> None:
    asset = load(gltf(tmp_path, entry()))
    material, plain = asset.materials[0], Material(name="m", base_color=(1, 1, 1), roughness=0.25)
    assert {**vars(material)} == {**vars(plain)} and asset.meta["left_out"] == ""


def test_transmission_without_thickness_is_a_thin_pane(tmp_path: Path) -> None:
    for more in ({}, {"volume": {}}, {"volume": {"thicknessFactor": 0}}):
        material = made(tmp_path, transmission={"transmissionFactor": 0.9}, dispersion={"dispersion": 0.4}, **more)
        assert (material.transmission, material.thin, material.abbe) == (0.9, True, 0)


def test_solid_glass_with_its_index_its_dispersion_and_its_tint(tmp_path: Path) -> None:
    volume = {"thicknessFactor": 0.2, "attenuationDistance": 0.1, "attenuationColor": [1, 0.5, 0.25]}
    path = gltf(tmp_path, entry(transmission={"transmissionFactor": 1}, volume=volume, ior={"ior": 1.8},
                                dispersion={"dispersion": 0.5}))
    asset = load(path)
    material = asset.materials[0]
    assert (material.transmission, material.thin, material.ior, material.abbe) == (1, False, 1.8, 40)
    assert material.specular == pytest.approx((0.8 / 2.8) ** 2)
    assert material.base_color == pytest.approx((1, 0.25, 0.0625))
    assert asset.meta["left_out"] == "m: absorption in the body, taken as a tint for its stated thickness"


def test_a_volume_of_what_does_not_transmit_means_nothing(tmp_path: Path) -> None:
    material = made(tmp_path, volume={"thicknessFactor": 1, "attenuationColor": [0, 0, 0], "attenuationDistance": 1})
    assert material.transmission == 0 and material.base_color == (1, 1, 1)


def test_coats_sheen_and_specular(tmp_path: Path) -> None:
    material = made(tmp_path, clearcoat={"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.2},
                    sheen={"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.4},
                    specular={"specularFactor": 0.5})
    assert (material.coat, material.coat_roughness) == (0.7, 0.2)
    assert (material.sheen, material.sheen_roughness) == ((0.1, 0.2, 0.3), 0.4)
    assert material.specular == pytest.approx(0.02)


@pytest.mark.parametrize(("ior", "index", "specular"), [(1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (2.5, 2.5, 0.16)])
def test_indices_at_their_limits(tmp_path: Path, ior: float, index: float, specular: float) -> None:
    material = made(tmp_path, ior={"ior": ior})
    assert (material.ior, material.specular) == (index, pytest.approx(specular))


def test_what_is_not_taken_is_named() -> None:
    said = entry(transmission={"transmissionFactor": 1, "transmissionTexture": {"index": 0}}, iridescence={})
    found = extended(Material(name="m", base_color=(1, 1, 1)), {**said, "emissiveFactor": [0, 1, 0]})
    assert found.left_out == ("KHR_materials_iridescence", "emission",
                              "KHR_materials_transmission.transmissionTexture")


def test_materials_are_told_apart_by_name(tmp_path: Path) -> None:
    glass = {"transmissionFactor": 1}
    asset = load(gltf(tmp_path, entry("a"), entry("b", transmission=glass)))
    assert {material.name: material.transmission for material in asset.materials} == {"a": 0, "b": 1}
    alike = load(gltf(tmp_path, entry("a", transmission=glass), entry("a", transmission=glass)))
    assert [material.transmission for material in alike.materials] == [1, 1]


def test_glass_is_never_lost_among_materials_of_one_name(tmp_path: Path) -> None:
    for first in ("a", None):
        pair = [entry(), entry(transmission={"transmissionFactor": 1})]
        for each in pair:
            each.pop("name")
            each.update({"name": first} if first else {})
        with pytest.raises(UserError, match=r"two of ('a'|no name) with different extensions"):
            load(gltf(tmp_path, *pair))


@pytest.mark.parametrize("wrong", [{"transmissionFactor": "all"}, [1], {"transmissionFactor": {}}])
def test_extensions_that_break_their_format_are_refused(tmp_path: Path, wrong: Any) -> None:
    with pytest.raises(UserError, match="materials in a valid format"):
        load(gltf(tmp_path, entry(transmission=wrong)))
