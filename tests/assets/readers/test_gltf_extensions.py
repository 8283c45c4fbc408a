"""Material extensions of glTF: their factors, their textures, and what is said of those that are not taken."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.file_model import FileMaterial
from dataset_builder.assets.readers.specular_workflow import metallic_roughness
from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, GltfMaker, one_texel, png, quad_of


def entry(name: str = "m", **extensions: Any) -> dict[str, Any]:
    return {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.25},
            "extensions": {f"KHR_materials_{key}": value for key, value in extensions.items()}}


def read(tmp_path: Path, images: Any = (), **extensions: Any) -> FileMaterial:
    return quad_of(entry(**extensions), images).model(tmp_path).materials[0]


def texture_of(found: FileMaterial) -> Texture:
    assert found.material.texture is not None
    return found.material.texture


def test_without_extensions_nothing_changes(tmp_path: Path) -> None:
    found = read(tmp_path)
    assert vars(found.material) == vars(Material(name="m", base_color=(1, 1, 1), roughness=0.25))
    assert found.left_out == ()


def test_transmission_without_thickness_is_a_thin_pane(tmp_path: Path) -> None:
    for more in ({}, {"volume": {}}, {"volume": {"thicknessFactor": 0}}):
        found = read(tmp_path, transmission={"transmissionFactor": 0.9}, dispersion={"dispersion": 0.4}, **more)
        assert (found.material.transmission, found.material.thin, found.material.abbe) == (0.9, True, 0)


def test_solid_glass_with_its_index_its_dispersion_and_its_tint(tmp_path: Path) -> None:
    volume = {"thicknessFactor": 0.2, "attenuationDistance": 0.1, "attenuationColor": [1, 0.5, 0.25]}
    glass = {"transmission": {"transmissionFactor": 1}, "ior": {"ior": 1.8}, "dispersion": {"dispersion": 0.5}}
    found = read(tmp_path, volume=volume, **glass)
    material = found.material
    assert (material.transmission, material.thin, material.ior, material.abbe) == (1, False, 1.8, 40)
    assert material.specular == pytest.approx((0.8 / 2.8) ** 2)
    assert material.base_color == pytest.approx((1, 0.25, 0.0625))
    assert found.left_out == ("absorption in the body, taken as a tint for its stated thickness",)
    halved = read(tmp_path, [one_texel(0, 51, 0)], volume=volume | {"thicknessTexture": {"index": 0}}, **glass)
    assert halved.material.base_color == pytest.approx((1, 0.25**0.2, 0.0625**0.2))
    assert "thicknessTexture: its mean instead" in halved.left_out


def test_a_volume_of_what_does_not_transmit_means_nothing(tmp_path: Path) -> None:
    found = read(tmp_path, volume={"thicknessFactor": 1, "attenuationColor": [0, 0, 0], "attenuationDistance": 1})
    assert found.material.transmission == 0 and found.material.base_color == (1, 1, 1)


def test_coats_sheen_and_specular(tmp_path: Path) -> None:
    material = read(tmp_path, clearcoat={"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.2},
                    sheen={"sheenColorFactor": [0.1, 0.2, 0.3], "sheenRoughnessFactor": 0.4},
                    specular={"specularFactor": 0.5}).material
    assert (material.coat, material.coat_roughness) == (0.7, 0.2)
    assert (material.sheen, material.sheen_roughness) == ((0.1, 0.2, 0.3), 0.4)
    assert material.specular == pytest.approx(0.02)


@pytest.mark.parametrize(("ior", "index", "specular", "said"), [
    (1.0, 1.0, 0.0, 0), (1.5, 1.5, 0.04, 0), (2.5, 2.5, 0.16, 1), (0.0, 1.0, 0.16, 1),
    (0.5, 1.0, 0.0, 1), (4, 3, 0.16, 2)])
def test_indices_at_their_limits(tmp_path: Path, ior: float, index: float, specular: float, said: int) -> None:
    """An index of 0 stands for a reflectance of 1 (KHR_materials_ior)."""
    found = read(tmp_path, ior={"ior": ior})
    assert (found.material.ior, found.material.specular) == (index, pytest.approx(specular))
    assert len(found.left_out) == said


@pytest.mark.parametrize(("extension", "factors", "texture", "field", "channel"), [
    ("transmission", {"transmissionFactor": 1}, "transmissionTexture", "transmission", 0),
    ("clearcoat", {"clearcoatFactor": 1}, "clearcoatTexture", "coat", 0),
    ("clearcoat", {"clearcoatFactor": 1}, "clearcoatRoughnessTexture", "coat_roughness", 1),
    ("sheen", {"sheenColorFactor": [1, 1, 1]}, "sheenRoughnessTexture", "sheen_roughness", 3),
    ("specular", {}, "specularTexture", "specular", 3)])
def test_textures_by_the_channel_that_they_use(tmp_path: Path, extension: str, factors: dict[str, Any], texture: str,
                                               field: str, channel: int) -> None:
    values = (51, 102, 153, 204)
    found = read(tmp_path, [one_texel(*values)], **{extension: {**factors, texture: {"index": 0}}})
    np.testing.assert_allclose(getattr(texture_of(found), field), [[values[channel] / 255]], rtol=1e-6)
    assert found.left_out == ()


def test_colours_of_sheen_are_encoded(tmp_path: Path) -> None:
    sheen = {"sheenColorFactor": [1, 1, 1], "sheenColorTexture": {"index": 0}}
    found = read(tmp_path, [one_texel(188, 0, 255)], sheen=sheen)
    np.testing.assert_allclose(texture_of(found).sheen, [[[0.5029, 0, 1]]], atol=1e-4)


def test_unlit_surfaces_send_their_colour_out_and_reflect_nothing(tmp_path: Path) -> None:
    material = entry(unlit={}, clearcoat={"clearcoatFactor": 1}) | {"emissiveFactor": [1, 1, 1], "alphaMode": "BLEND"}
    material["pbrMetallicRoughness"] = {"baseColorFactor": [0.5, 1, 1, 0.5], "baseColorTexture": {"index": 0},
                                        "metallicRoughnessTexture": {"index": 0}}
    made = quad_of(material, [png(COLORS)], COLOR_0=np.ones((4, 4), np.float32))
    model = made.model(tmp_path)
    found, texture = model.materials[0].material, texture_of(model.materials[0])
    assert (found.base_color, found.emission, found.specular, found.metallic) == ((0, 0, 0), (0.5, 1, 1), 0, 0)
    assert (found.alpha, found.coat) == (0.5, 0) and texture.roughness is None
    np.testing.assert_array_equal(texture.emission, COLORS // 255)
    assert model.parts[0].colors is None
    assert "meshes[0].primitives[0]: vertex colours, since m is unlit" in model.left_out


@pytest.mark.parametrize(("extension", "value", "said"), [
    ("anisotropy", {"anisotropyStrength": 0.5}, "KHR_materials_anisotropy"), ("anisotropy", {}, None),
    ("iridescence", {"iridescenceFactor": 1}, "KHR_materials_iridescence"),
    ("diffuse_transmission", {"diffuseTransmissionFactor": 1}, "KHR_materials_diffuse_transmission"),
    ("velvet_of_the_future", {}, "KHR_materials_velvet_of_the_future"),
    ("clearcoat", {"clearcoatFactor": 1, "clearcoatNormalTexture": {"index": 0}}, "clearcoatNormalTexture"),
    ("specular", {"specularColorFactor": [1, 0, 0]}, "the specular colour"),
    ("specular", {"specularColorTexture": {"index": 0}}, "the specular colour"),
    ("specular", {"specularColorFactor": [1, 1, 1]}, None)])
def test_what_is_not_taken_is_named(tmp_path: Path, extension: str, value: dict[str, Any], said: str | None) -> None:
    made = quad_of(entry(**{extension: value}), [COLORS])
    assert made.model(tmp_path).materials[0].left_out == ((said,) if said else ())
    assert made.asset(tmp_path).meta["left_out"].startswith(f"m: {said}" if said else "one-sided surfaces")


def test_materials_are_told_apart_by_their_index(tmp_path: Path) -> None:
    """Two of one name, one of them glass, both used."""
    made = GltfMaker()
    for extension in ({}, {"transmission": {"transmissionFactor": 1}}):
        made.draw(made.primitive(material=made.add("materials", **entry("a", **extension))))
    found = made.model(tmp_path).materials
    assert [(each.material.name, each.material.transmission) for each in found] == [("a", 0), ("a_2", 1)]


@pytest.mark.parametrize("wrong", [{"transmissionFactor": "all"}, [1], {"transmissionFactor": {}}])
def test_extensions_that_break_their_format_are_refused(tmp_path: Path, wrong: Any) -> None:
    with pytest.raises(UserError, match=r"materials\[0\]\.extensions\.KHR_materials_transmission.*expected"):
        read(tmp_path, transmission=wrong)


def test_specular_glossiness_of_a_dielectric_and_of_metals() -> None:
    """By hand: a reflectance of 0.04 is no metal, and its base colour the diffuse one; black with a bright reflectance
    is all metal of that colour."""
    diffuse = np.array([[0.5, 0.25, 0.1], [0, 0, 0], [0, 0, 0]])
    specular = np.array([[0.04, 0.04, 0.04], [0.9, 0.6, 0.3], [0.02, 0.02, 0.02]])
    base, metallic = metallic_roughness(diffuse, specular)
    np.testing.assert_allclose(metallic, [0, 1, 0], atol=1e-9)
    np.testing.assert_allclose(base[0], diffuse[0], atol=1e-6)
    np.testing.assert_allclose(base[1], specular[1], atol=1e-6)


def test_specular_glossiness_gives_back_what_metallic_roughness_says() -> None:
    """There and back, where base colours are grey: diffuse = base (1 - m), and reflectance 0.04 (1 - m) + base m."""
    base, metallic = np.meshgrid(np.linspace(0.1, 0.9, 9), [0, 0.25, 0.5, 1])
    specular = 0.04 * (1 - metallic) + base * metallic
    diffuse = base * (1 - metallic) * 0.96 / (1 - specular)
    found, share = metallic_roughness(*(np.repeat(grey[..., None], 3, axis=2) for grey in (diffuse, specular)))
    np.testing.assert_allclose(share, metallic, atol=1e-6)
    np.testing.assert_allclose(found[..., 0], base, atol=1e-6)


def test_specular_glossiness_between_dielectric_and_metal_is_mixed_by_the_square() -> None:
    """Metallic as a root of its equation, then colours of both kinds mixed by its square, as Khronos converts."""
    diffuse, specular, weights = np.array([0.3, 0.1, 0.05]), np.array([0.5, 0.3, 0.2]), np.array([0.299, 0.587, 0.114])
    dark, bright = (np.sqrt(np.sum(weights * colour**2)) for colour in (diffuse, specular))
    share = max(np.roots([0.04, dark * 0.5 / 0.96 + bright - 0.08, 0.04 - bright]).real)
    assert 0.2 < share < 0.9
    scattered, reflected = diffuse * 0.5 / 0.96 / (1 - share), (specular - 0.04 * (1 - share)) / share
    base, metallic = metallic_roughness(diffuse, specular)
    assert metallic == pytest.approx(share)
    np.testing.assert_allclose(base, np.clip(scattered + (reflected - scattered) * share**2, 0, 1), atol=1e-9)


def test_specular_glossiness_of_a_file(tmp_path: Path) -> None:
    glossy = {"diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.9, 0.6, 0.3], "glossinessFactor": 0.75}
    found = read(tmp_path, pbrSpecularGlossiness=glossy)
    assert found.material.base_color == pytest.approx((0.9, 0.6, 0.3), abs=1e-6)
    assert (found.material.metallic, found.material.roughness) == (pytest.approx(1), 0.25)
    assert found.left_out == ("specular-glossiness, converted to metallic-roughness",)
    textured = {"specularGlossinessTexture": {"index": 0}, "diffuseTexture": {"index": 1}}
    images = [np.array([[[0, 0, 0, 255], [255, 255, 255, 51]]], np.uint8), one_texel(255, 0, 0)]
    texture = texture_of(read(tmp_path, images, pbrSpecularGlossiness=textured))
    assert texture.roughness is not None and texture.metallic is not None
    np.testing.assert_allclose(texture.roughness, [[0, 0.8]], atol=1e-6)
    np.testing.assert_allclose(texture.metallic, [[0, 1]], atol=1e-6)
    np.testing.assert_allclose(texture.base_color, [[[1, 0, 0], [1, 1, 1]]], atol=1e-6)
