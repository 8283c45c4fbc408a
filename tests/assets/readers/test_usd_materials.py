"""UsdPreviewSurface becomes the material that it describes; what has no place there is named."""

import numpy as np
import pytest

from dataset_builder.assets.asset import reflectance_at
from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.usd import read
from dataset_builder.errors import UserError
from tests.assets.readers.usd_files import API, BOUND, HEAD, material, mesh, painted, texture, write, write_image

TRANSPARENT = "opacity of mode transparent, taken as presence: its highlights go with it"
COLOR = "color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>"


def made(folder, inputs, **what):
    """The only material, and what is left out of the file."""
    model = read(write(folder, painted(inputs, **what)), 64)
    return model.materials[0], model.left_out


def test_constants(tmp_path):
    file, left_out = made(tmp_path, """
        color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        color3f inputs:emissiveColor = (2, 0, 1)
        float inputs:roughness = 0.25
        float inputs:metallic = 0.5
        float inputs:clearcoat = 0.75
        float inputs:clearcoatRoughness = 0.125
        float inputs:opacity = 0.5
        float inputs:opacityThreshold = 0.25
        float inputs:ior = 2""")
    found = file.material
    assert found.base_color == pytest.approx((0.1, 0.2, 0.3)) and found.emission == (2, 0, 1)
    assert (found.roughness, found.metallic, found.coat, found.coat_roughness) == (0.25, 0.5, 0.75, 0.125)
    assert (found.alpha, found.alpha_cutoff, found.specular, found.texture) == (0.5, 0.25, reflectance_at(2), None)
    assert (found.name, file.left_out, left_out) == ("paint", (), ())


def test_defaults_are_those_of_the_specification(tmp_path):
    found = made(tmp_path, "")[0].material
    assert (found.base_color, found.roughness, found.metallic) == ((0.18,) * 3, 0.5, 0)
    assert found.specular == pytest.approx(0.04)
    assert (found.alpha, found.alpha_cutoff, found.coat, found.emission) == (1, None, 0, (0, 0, 0))


@pytest.mark.parametrize(("more", "mode", "expected"), [
    ("", "RGB", linear_from_srgb(0.4)), ('token inputs:sourceColorSpace = "auto"', "RGB", linear_from_srgb(0.4)),
    ('token inputs:sourceColorSpace = "raw"', "RGB", 0.4), ('token inputs:sourceColorSpace = "auto"', "L", 0.4),
    ('token inputs:sourceColorSpace = "sRGB"', "L", linear_from_srgb(0.4)),
    ('token inputs:sourceColorSpace = "raw"\nfloat4 inputs:scale = (0.5, 0.5, 0.5, 1)\n'
     "float4 inputs:bias = (0.25, 0.25, 0.25, 0)", "RGB", 0.45)])
def test_colour_space_scale_and_bias_of_a_texture(tmp_path, more, mode, expected):
    write_image(tmp_path, "t.png", (102,) * 3 if mode == "RGB" else 102, mode)
    found = made(tmp_path, COLOR, nodes=texture("t", "t.png", more=more))[0].material
    np.testing.assert_allclose(found.texture.base_color * found.base_color, np.full((2, 2, 3), expected), rtol=1e-5)


def test_channels_and_normals(tmp_path):
    write_image(tmp_path, "arm.png", (51, 102, 204, 153), "RGBA")
    write_image(tmp_path, "n.png", (255, 128, 128))
    raw = 'token inputs:sourceColorSpace = "raw"'
    vectors = raw + "\nfloat4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)"
    file, _ = made(tmp_path, """
        float inputs:roughness.connect = </paint/t.outputs:g>
        float inputs:metallic.connect = </paint/t.outputs:b>
        float inputs:opacity.connect = </paint/t.outputs:a>
        float inputs:occlusion.connect = </paint/t.outputs:r>
        float inputs:displacement = 0.5
        normal3f inputs:normal.connect = </paint/n.outputs:rgb>""",
                   nodes=texture("t", "arm.png", more=raw) + texture("n", "n.png", more=vectors))
    found = file.material.texture
    for channel, expected in ((found.roughness, 0.4), (found.metallic, 0.8), (found.alpha, 0.6)):
        np.testing.assert_allclose(channel, expected, rtol=1e-6)
    np.testing.assert_allclose(found.normal[0, 0], (1, 0, 0), atol=0.01)
    assert file.left_out == (TRANSPARENT, "displacement", "occlusion")


@pytest.mark.parametrize("colour", [(0, 0, 0), (127, 127, 127)])
def test_a_black_or_grey_map_of_normals_is_named(tmp_path, colour):
    write_image(tmp_path, "n.png", colour)
    vectors = 'token inputs:sourceColorSpace = "raw"\nfloat4 inputs:scale = (2, 2, 2, 1)\n' \
              "float4 inputs:bias = (-1, -1, -1, 0)"
    file, _ = made(tmp_path, "normal3f inputs:normal.connect = </paint/n.outputs:rgb>",
                   nodes=texture("n", "n.png", more=vectors))
    assert file.material.texture is None
    assert file.left_out == ("normal map, whose texels all point nowhere or into the surface (black or grey)",)


@pytest.mark.parametrize(("wraps", "expected"), [
    (("repeat", "mirror"), ("repeat", "mirror")), (("clamp", "black"), ("clamp", "clamp")),
    (("useMetadata", "repeat"), ("repeat", "repeat"))])
def test_beyond_the_edges(tmp_path, wraps, expected):
    write_image(tmp_path, "t.png", (9, 9, 9))
    more = "\n".join(f'token inputs:wrap{axis} = "{wrap}"' for axis, wrap in zip("ST", wraps, strict=True))
    far = 'texCoord2f[] primvars:st = [(0,0), (2,0), (2,1), (0,1)] ( interpolation = "vertex" )'
    file, left_out = made(tmp_path, COLOR, nodes=texture("t", "t.png", more=more), more=far)
    assert file.material.texture.wrap == expected
    assert left_out == (("black beyond the edges of textures of paint",) if "black" in wraps else ())


def test_coordinates_are_scaled_turned_and_moved(tmp_path):
    """UsdTransform2d: scale, then rotation against the clock, then translation."""
    write_image(tmp_path, "t.png", (9, 9, 9))
    nodes = texture("t", "t.png", coordinates="map1").replace("t_st.outputs", "move.outputs")
    nodes += """
            def Shader "move" {
                uniform token info:id = "UsdTransform2d"
                float2 inputs:in.connect = </paint/t_st.outputs:result>
                float inputs:rotation = 90
                float2 inputs:scale = (2, 4)
                float2 inputs:translation = (0.5, 0.25)
                float2 outputs:result
            }"""
    uvs = 'texCoord2f[] primvars:map1 = [(0,0), (1,0), (1,1), (0,1)] ( interpolation = "vertex" )'
    path = write(tmp_path, painted(COLOR, nodes=nodes, more=uvs))
    mesh_made = load_mesh_file(path, name="a", category="b", licence="CC0-1.0").mesh
    # (u, v) -> (2u, 4v) -> (-4v, 2u) -> (-4v + 0.5, 2u + 0.25); the square stands upright, centred
    found = {(x + 0.5, z): tuple(uv) for face, uvs in zip(mesh_made.faces, mesh_made.uvs, strict=True)
             for (x, _, z), uv in zip(mesh_made.positions[face], uvs, strict=True)}
    assert found[1, 0] == pytest.approx((0.5, 2.25)) and found[0, 1] == pytest.approx((-3.5, 0.25))


@pytest.mark.parametrize(("inputs", "named"), [
    ("float inputs:opacity = 0.5", (TRANSPARENT,)),
    ('float inputs:opacity = 0.5\ntoken inputs:opacityMode = "transparent"', (TRANSPARENT,)),
    ('float inputs:opacity = 0.5\ntoken inputs:opacityMode = "presence"', ()),
    ("float inputs:opacity = 0.5\nfloat inputs:opacityThreshold = 0.1", ()),
    ("float inputs:ior = 0.5", ("ior 0.5, taken as 1",))])
def test_what_opacity_means_is_said(tmp_path, inputs, named):
    assert made(tmp_path, inputs)[0].left_out == named


def test_colours_of_vertices_are_read_where_the_material_asks(tmp_path):
    reader = """
            def Shader "colors" {
                uniform token info:id = "UsdPrimvarReader_float3"
                string inputs:varname = "displayColor"
                float3 outputs:result
            }"""
    shown = "color3f[] primvars:displayColor = [(0.25, 0.5, 0.75)]"
    plain = read(write(tmp_path, painted("", more=shown)), 64)
    assert plain.parts[0].colors is None
    asked = "color3f inputs:diffuseColor.connect = </paint/colors.outputs:result>"
    model = read(write(tmp_path, painted(asked, nodes=reader, more=shown), "b.usda"), 64)
    assert model.materials[0].material.base_color == (1, 1, 1)
    np.testing.assert_array_equal(model.parts[0].colors[0, 0], (0.25, 0.5, 0.75, 1))


@pytest.mark.parametrize(("color", "specular", "named"), [
    ("(0.05, 0.05, 0.05)", 0.05, False), ("(0.9, 0.6, 0.3)", 0.16, True)])
def test_the_specular_workflow_is_kept_or_named(tmp_path, color, specular, named):
    file, _ = made(tmp_path, f"int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = {color}")
    assert file.material.specular == pytest.approx(specular) and file.material.metallic == 0
    assert file.left_out == (("specularColor, taken as a grey that dielectrics have",) if named else ())


def test_other_surfaces_give_way_to_the_display_colour_and_are_named(tmp_path):
    surface = material("", identifier="ND_standard_surface_surfaceshader")
    text = HEAD + mesh(more=f"{BOUND.format('paint')}\ncolor3f[] primvars:displayColor = [(1, 0, 0)]", metadata=API)
    model = read(write(tmp_path, text + surface), 64)
    np.testing.assert_array_equal(model.parts[0].colors[0, 0], (1, 0, 0, 1))
    assert (model.parts[0].material, model.materials) == (-1, ())
    assert model.left_out == ("material paint, which has no UsdPreviewSurface; displayColor is taken for it",)


def test_values_come_through_the_interface_of_the_material(tmp_path):
    text = HEAD + mesh(more=BOUND.format("paint"), metadata=API) + material(
        "float inputs:roughness.connect = </paint.inputs:gloss>").replace(
        'def Material "paint" {', 'def Material "paint" {\n float inputs:gloss = 0.125')
    assert read(write(tmp_path, text), 64).materials[0].material.roughness == 0.125


def test_textures_without_coordinates_unknown_nodes_and_tiles(tmp_path):
    write_image(tmp_path, "t.png", (9, 9, 9))
    _, left_out = made(tmp_path, COLOR, nodes=texture("t", "t.png"), more="")
    assert left_out == ("textures of paint on a mesh without texture coordinates st",)
    noise = texture("t", "t.png").replace('"UsdUVTexture"', '"MyNoise"')
    file, _ = made(tmp_path, COLOR, nodes=noise)
    assert (file.left_out, file.material.base_color) == (("diffuseColor from MyNoise",), (0.18,) * 3)
    with pytest.raises(UserError, match=r"expected one image, got the tiles t\.<UDIM>\.png"):
        made(tmp_path, COLOR, nodes=texture("t", "t.<UDIM>.png"))


@pytest.mark.parametrize("name", ["gone.png", "../t.png"])
def test_a_texture_that_is_not_there_is_refused_by_name(tmp_path, name):
    write_image(tmp_path, "t.png", (9, 9, 9))
    (folder := tmp_path / "chair").mkdir()
    path = write(folder, painted(COLOR, nodes=texture("t", name)))
    with pytest.raises(UserError, match=f"inputs:file: expected .*{name.rpartition('/')[2]}"):
        load_mesh_file(path, name="a", category="b", licence="CC0-1.0")
    with pytest.raises(UserError, match="expected an existing file in its folder"):
        read(path, 64)
