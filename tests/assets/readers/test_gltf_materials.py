"""Materials of glTF: factors, coverage, and how textures lie."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.file_model import FileMaterial
from dataset_builder.errors import UserError
from tests.assets.gltf_files import COLORS, QUAD, QUAD_UVS, GltfMaker, one_texel, png, quad_of

BASE = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def read(tmp_path: Path, material: dict[str, Any], images: Any = ()) -> FileMaterial:
    return quad_of(material, images).model(tmp_path).materials[0]


def texture_of(found: FileMaterial) -> Texture:
    assert found.material.texture is not None
    return found.material.texture


def test_untouched_defaults_are_the_formats(tmp_path: Path) -> None:
    found = read(tmp_path, {})
    assert vars(found.material) == vars(Material(name="material_0", base_color=(1, 1, 1), roughness=1, metallic=1))
    assert found.left_out == ()


def test_names_are_made_unique(tmp_path: Path) -> None:
    made = GltfMaker()
    for name in ("wood", "wood", "wood_2", None):
        made.draw(made.primitive(material=made.add("materials", **({"name": name} if name else {}),
                                                   pbrMetallicRoughness={"roughnessFactor": 0.5})))
    names = [each.material.name for each in made.model(tmp_path).materials]
    assert names == ["wood", "wood_2", "wood_2_2", "material_3"]


def test_what_was_decided_about_materials_is_said(tmp_path: Path) -> None:
    made = quad_of({"name": "m"})
    assert made.model(tmp_path).left_out == ("one-sided surfaces are seen from both sides",)
    made.header["materials"][0]["doubleSided"] = True
    made.header["meshes"][0]["primitives"][0]["extensions"] = {"KHR_materials_variants": {"mappings": []}}
    made.use("KHR_materials_variants", required=True)
    assert made.model(tmp_path).left_out == ("of the material variants the default",)


def test_textures_in_many_materials_are_all_right(tmp_path: Path) -> None:
    """More of them than are kept decoded, and each used twice."""
    made = GltfMaker()
    for number in range(6):
        made.texture(one_texel(40 * number, 0, 0))
    for number in [*range(6), *range(6)]:
        material = made.add("materials", emissiveFactor=[1, 1, 1], emissiveTexture={"index": number},
                            normalTexture={"index": number})
        made.draw(made.primitive(material=material))
    model = made.model(tmp_path)
    reds = [float(texture_of(each).emission[0, 0, 0]) for each in model.materials]  # type: ignore[index]
    assert reds == sorted(set(reds)) * 2 and model.contains.endswith("12 materials, 6 images")


def test_materials_that_no_part_has_are_not_read(tmp_path: Path) -> None:
    made = GltfMaker()
    made.texture(b"not an image")
    made.add("materials", name="unused", **BASE)
    made.draw(made.primitive(material=made.add("materials", name="used")))
    model = made.model(tmp_path)
    assert [each.material.name for each in model.materials] == ["used"] and model.parts[0].material == 0
    assert model.contains.endswith("1 material, 0 images")


@pytest.mark.parametrize(("mode", "alpha", "cutoff"), [
    ({}, 1, None), ({"alphaMode": "OPAQUE"}, 1, None), ({"alphaMode": "MASK"}, 0.2, 0.5),
    ({"alphaMode": "MASK", "alphaCutoff": 0.1}, 0.2, 0.1), ({"alphaMode": "BLEND"}, 0.2, None)])
def test_coverage(tmp_path: Path, mode: dict[str, Any], alpha: float, cutoff: float | None) -> None:
    half = np.array([[[255, 0, 0, 255], [0, 255, 0, 51]]], np.uint8)
    base = {"baseColorFactor": [1, 1, 1, 0.2], "baseColorTexture": {"index": 0}}
    found = read(tmp_path, {"pbrMetallicRoughness": base, **mode}, [half])
    assert (found.material.alpha, found.material.alpha_cutoff) == (alpha, cutoff)
    texels = texture_of(found).alpha
    if alpha == 1:
        assert texels is None
    else:
        np.testing.assert_allclose(texels, [[1, 0.2]], rtol=1e-6)


def test_images_without_coverage_make_no_map_of_it(tmp_path: Path) -> None:
    assert texture_of(read(tmp_path, {**BASE, "alphaMode": "BLEND"}, [COLORS])).alpha is None
    with pytest.raises(UserError, match=r"materials\[0\].alphaMode: expected OPAQUE, MASK or BLEND, got GHOST"):
        read(tmp_path, {"alphaMode": "GHOST"})


@pytest.mark.parametrize("scale", [0, 0.5, 1, 2])
def test_normals_are_scaled_across(tmp_path: Path, scale: float) -> None:
    found = read(tmp_path, {"normalTexture": {"index": 0, "scale": scale}}, [one_texel(204, 128, 204)])
    tilt = np.array([scale * (2 * 204 / 255 - 1), scale * (2 * 128 / 255 - 1), 2 * 204 / 255 - 1])
    np.testing.assert_allclose(texture_of(found).normal, [[tilt / np.linalg.norm(tilt)]], atol=1e-6)


@pytest.mark.parametrize("texel", [(0, 0, 0), (127, 127, 127), (128, 128, 128), (128, 128, 0)])
def test_texels_that_are_no_normals_point_straight_out_and_are_named(tmp_path: Path, texel: Any) -> None:
    """Taken for vectors, black and grey would tilt a surface by 55 degrees."""
    why = "nowhere or into the surface (black or grey)"
    material = {"normalTexture": {"index": 0, "scale": 2}, **BASE}
    found = read(tmp_path, material, [png(np.full((2, 2, 3), texel, np.uint8))])
    assert texture_of(found).normal is None and found.left_out == (f"normalTexture, whose texels all point {why}",)
    found = read(tmp_path, material, [png(np.uint8([[texel, (204, 128, 204)], [(128, 128, 255), (255, 128, 128)]]))])
    assert found.left_out == (f"normalTexture in 1 of 4 texels, which point {why}: straight out instead",)
    normal = texture_of(found).normal
    assert normal is not None
    np.testing.assert_allclose(normal[0, 0], (0, 0, 1), atol=1e-6)
    np.testing.assert_allclose(normal[1], [(0, 0, 1), (1, 0, 0)], atol=0.02)     # Along the surface is a direction


def test_emission_with_its_strength(tmp_path: Path) -> None:
    extension = {"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}}
    material = {"emissiveFactor": [0.5, 0.25, 0], "emissiveTexture": {"index": 0}, **extension}
    found = read(tmp_path, material, [one_texel(255, 188, 0)])
    assert found.material.emission == (2, 1, 0)
    np.testing.assert_allclose(texture_of(found).emission, [[[1, 0.5029, 0]]], atol=1e-4)
    assert read(tmp_path, {"emissiveTexture": {"index": 0}}, [COLORS]).material.texture is None


def test_occlusion_is_named(tmp_path: Path) -> None:
    found = read(tmp_path, {"occlusionTexture": {"index": 0}}, [COLORS])
    assert found.left_out == ("occlusionTexture (light that is baked in)",)


def test_numbers_beyond_their_range_are_cut_and_named(tmp_path: Path) -> None:
    found = read(tmp_path, {"pbrMetallicRoughness": {"roughnessFactor": 1.5, "metallicFactor": -1,
                                                     "baseColorFactor": [2, 0, 0, 1]}})
    assert (found.material.roughness, found.material.metallic, found.material.base_color) == (1, 0, (1, 0, 0))
    assert found.left_out == ("baseColorFactor [2.0, 0.0, 0.0, 1.0], cut to [0, 1]", "roughnessFactor 1.5, taken as 1",
                              "metallicFactor -1, taken as 0")


def texel_under(made: GltfMaker, tmp_path: Path, place: tuple[float, float]) -> list[float]:
    """The texel that the asset has where the quad is, x and z from its lower left corner."""
    asset = made.asset(tmp_path)
    texels = asset.materials[0].texture.base_color  # type: ignore[union-attr]
    low = asset.mesh.bounds[0]
    for face, uvs in zip(asset.mesh.faces, asset.mesh.uvs, strict=True):
        corners = asset.mesh.positions[face][:, [0, 2]] - low[[0, 2]]
        shares = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), (*place, 1))
        if (shares >= -1e-9).all():
            u, v = shares @ uvs
            row, column = int((1 - v % 1) * texels.shape[0]), int(u % 1 * texels.shape[1])
            return [round(float(value), 3) for value in texels[row, column]]
    raise AssertionError(place)


@pytest.mark.parametrize(("transform", "seen"), [
    ({}, [0, 0, 1]), ({"offset": [0.5, 0]}, [1, 1, 1]), ({"offset": [0, 0.5]}, [1, 0, 0]),
    ({"scale": [0.5, 0.5]}, [1, 0, 0]),
    ({"rotation": np.pi / 2}, [1, 1, 1]), ({"rotation": np.pi / 2, "offset": [0, 1], "scale": [0.5, 1]}, [1, 1, 1])])
def test_texture_transforms_at_the_lower_left(tmp_path: Path, transform: dict[str, Any], seen: list[float]) -> None:
    """By hand, from (u, v) = (0.25, 0.75) of the file, v downwards, where the image is blue. A quarter turn brings it
    to (v, -u) = (0.75, -0.25), which is the lower right; scaled by a half before, to (0.75, -0.125), and by an offset
    of 1 to (0.75, 0.875)."""
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": info}}, [COLORS])
    made.use("KHR_texture_transform", required=True)
    assert texel_under(made, tmp_path, (0.25, 0.25)) == seen


def test_the_second_set_of_coordinates(tmp_path: Path) -> None:
    for info in ({"index": 0, "texCoord": 1}, {"index": 0, "extensions": {"KHR_texture_transform": {"texCoord": 1}}}):
        made = quad_of({"pbrMetallicRoughness": {"baseColorTexture": info}}, [COLORS], TEXCOORD_1=1 - QUAD_UVS)
        assert texel_under(made, tmp_path, (0.25, 0.25)) == [0, 1, 0]
        assert made.model(tmp_path).materials[0].uv_set == 1


def test_coordinates_that_a_part_lacks_are_named(tmp_path: Path) -> None:
    made = quad_of({"name": "m", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "texCoord": 3}}}, [COLORS])
    model = made.model(tmp_path)
    assert model.left_out[0] == "meshes[0].primitives[0]: the textures of m, since it has no TEXCOORD_3"
    np.testing.assert_array_equal(model.parts[0].uvs[3], np.broadcast_to((0, 1), (2, 3, 2)))


@pytest.mark.parametrize(("sampler", "wrap", "nearest"), [
    (None, ("repeat", "repeat"), False), ({"wrapS": 33071, "wrapT": 33648}, ("clamp", "mirror"), False),
    ({"magFilter": 9728}, ("repeat", "repeat"), True),
    ({"magFilter": 9729, "wrapT": 10497}, ("repeat", "repeat"), False)])
def test_samplers(tmp_path: Path, sampler: dict[str, int] | None, wrap: tuple[str, str], nearest: bool) -> None:
    made = GltfMaker()
    made.texture(COLORS, sampler=sampler)
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=made.add("materials", **BASE)))
    texture = texture_of(made.model(tmp_path).materials[0])
    assert (texture.wrap, texture.nearest) == (wrap, nearest)


def test_maps_that_lie_otherwise_are_replaced_by_their_mean(tmp_path: Path) -> None:
    surface = np.array([[[0, 0, 0], [0, 102, 204]]], np.uint8)
    base = {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1, "texCoord": 1}}
    found = read(tmp_path, {"pbrMetallicRoughness": base}, [COLORS, surface])
    texture = texture_of(found)
    assert texture.roughness is not None and texture.metallic is not None
    np.testing.assert_allclose(texture.roughness, np.full((2, 2), 0.2), rtol=1e-6)
    np.testing.assert_allclose(texture.metallic, np.full((2, 2), 0.4), rtol=1e-6)
    assert found.left_out == ("metallicRoughnessTexture, which lies otherwise than the other maps: its mean instead",)


def test_samplers_that_differ_are_named(tmp_path: Path) -> None:
    made = GltfMaker()
    made.texture(COLORS)
    made.texture(COLORS, sampler={"wrapS": 33071})
    material = made.add("materials", **BASE, normalTexture={"index": 1})
    made.draw(made.primitive(TEXCOORD_0=QUAD_UVS, material=material))
    found = made.model(tmp_path).materials[0]
    assert found.left_out[0] == "the sampler of normalTexture, which differs from the other maps'"
    assert texture_of(found).wrap == ("repeat", "repeat")


@pytest.mark.parametrize(("change", "rule"), [
    ({"textures": [{"source": 5}]}, r"textures\[0\].source: expected a whole number in \[0, 0\], got 5"),
    ({"textures": [{}]}, r"textures\[0\]: expected an image, got none that is read"),
    ({"textures": []}, "index: expected no such key, since the file has no textures"),
    ({"samplers": [{"wrapS": 3}], "textures": [{"source": 0, "sampler": 0}]},
     r"samplers\[0\].wrapS: expected one of 10497"),
    ({"images": [{}]}, r"images\[0\]: expected a uri or a bufferView"),
    ({"materials": [{"pbrMetallicRoughness": 3}]}, r"materials\[0\].pbrMetallicRoughness: expected an object, got 3"),
    ({"materials": [{"name": 3}]}, r"materials\[0\].name: expected text, got 3"),
    ({"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1]}}]},
     "baseColorFactor: expected 4 finite numbers"),
    ({"materials": [{"pbrMetallicRoughness": {"roughnessFactor": "all"}}]},
     "roughnessFactor: expected a finite number")])
def test_materials_that_break_the_format(tmp_path: Path, change: dict[str, Any], rule: str) -> None:
    made = quad_of(BASE, [COLORS])
    made.header |= change
    with pytest.raises(UserError, match=rf"a\.glb.*{rule}"):
        made.model(tmp_path)


def test_images_are_what_they_begin_like(tmp_path: Path) -> None:
    made = GltfMaker()
    made.texture(png(COLORS), mime="image/jpeg")
    made.draw(made.primitive(QUAD, TEXCOORD_0=QUAD_UVS, material=made.add("materials", **BASE)))
    assert texture_of(made.model(tmp_path).materials[0]).base_color.shape == (2, 2, 3)
    with pytest.raises(UserError, match=r"images\[0\]: expected a PNG, .* image, got one that starts with b'%!PS"):
        quad_of(BASE, [b"%!PS-Adobe-3.0 EPSF-3.0"]).model(tmp_path)
