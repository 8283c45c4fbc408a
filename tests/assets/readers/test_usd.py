"""Mesh prims of USD stages come where the stage puts them; what is not taken is named, what is broken refused."""

import os
import resource
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, UsdUtils

from dataset_builder.assets.file_model import GREY
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.assets.readers.usd import read
from dataset_builder.errors import UserError
from dataset_builder.spec import usd_trial
from dataset_builder.spec.mesh_source import companions, mesh_source
from tests.assets.readers.usd_files import API, BOUND, HEAD, ST, material, mesh, painted, texture, write, write_image

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[4] / "shared" / "assets")
CONNECTED = "color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>"
BOX = {"points": "(0,0,0), (1,0,0), (1,2,0), (0,2,0), (0,0,3), (1,0,3), (1,2,3), (0,2,3)", "counts": "4, 4, 4, 4, 4, 4",
       "indices": "0,3,2,1, 4,5,6,7, 0,1,5,4, 1,2,6,5, 2,3,7,6, 3,0,4,7"}
"""1 x 2 x 3."""


def load(path):
    return load_mesh_file(path, name="a", category="b", licence="CC0-1.0")


def area(part):
    a, b, c = np.moveaxis(part.positions[part.faces], 1, 0)
    return np.cross(b - a, c - a)[:, 2].sum() / 2


def error_of(path):
    with pytest.raises(UserError) as caught:
        load(path)
    return str(caught.value)


@pytest.mark.parametrize(("head", "size"), [
    ('upAxis = "Y"\nmetersPerUnit = 1', (1, 3, 2)), ('upAxis = "Z"\nmetersPerUnit = 0.01', (0.01, 0.02, 0.03)),
    ('upAxis = "X"\nmetersPerUnit = 0.001', (0.002, 0.003, 0.001)), ("metersPerUnit = 2", (2, 6, 4)),
    ('upAxis = "Z"', (0.01, 0.02, 0.03))])
def test_units_and_axis_of_the_file_are_honoured(tmp_path, head, size):
    asset = load(write(tmp_path, f"#usda 1.0\n(\n{head}\n)\n{mesh(**BOX)}"))
    np.testing.assert_allclose(asset.mesh.bounds[1] - asset.mesh.bounds[0], size)
    assert asset.mesh.volume == pytest.approx(np.prod(size))
    assert ("no metersPerUnit, taken as 0.01" in asset.meta["left_out"]) == ("metersPerUnit" not in head)


@pytest.mark.parametrize("name", ["a.usda", "a.usd", "a.usdc"])
def test_text_and_binary_hold_the_same(tmp_path, name):
    model = read(write(tmp_path, HEAD + mesh(more=ST), name), 64)
    assert (area(model.parts[0]), model.parts[0].name) == (1, "/square")
    assert model.contains == "1 mesh prim, 2 triangles, 0 materials"
    assert model.left_out == ()


def test_a_package_holds_its_textures(tmp_path):
    write_image(tmp_path, "t.png", (255, 0, 0))
    write(tmp_path, painted(CONNECTED, nodes=texture("t", "t.png")))
    (out := tmp_path / "out").mkdir()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(out / "a.usdz"))
    assert companions(out / "a.usdz") == ()
    np.testing.assert_array_equal(read(out / "a.usdz", 64).materials[0].material.texture.base_color[0, 0], (1, 0, 0))


def test_transforms_mirrors_and_left_hands(tmp_path):
    """All four squares face +z, each at its own place."""
    left = 'uniform token orientation = "leftHanded"'
    text = HEAD + f"""
        def Xform "turned" {{
            double3 xformOp:translate = (10, 0, 0)
            float xformOp:rotateZ = 90
            double3 xformOp:scale = (2, 2, 2)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ", "xformOp:scale"]
            {mesh()}
        }}
        def Xform "mirrored" {{
            double3 xformOp:scale = (-1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"]
            {mesh("b")}
            {mesh("c", indices="3, 2, 1, 0", more=left)}
        }}
        {mesh("d", indices="3, 2, 1, 0", more=left)}"""
    parts = read(write(tmp_path, text), 64).parts
    assert [area(part) for part in parts] == pytest.approx([4, 1, 1, 1])
    np.testing.assert_allclose(parts[0].positions[1], (10, 2, 0), atol=1e-12)
    np.testing.assert_allclose(parts[1].positions[1], (-1, 0, 0))


def test_references_payloads_and_instances(tmp_path):
    (tmp_path / "sub").mkdir()
    write(tmp_path / "sub", HEAD.replace("(\n", '(\n defaultPrim = "square"\n', 1) + mesh(), "part.usda")
    place = ('{{\n double3 xformOp:translate = ({}, 0, 0)\n uniform token[] xformOpOrder = ["xformOp:translate"]\n }}')
    text = HEAD + f"""
        def "chair" (instanceable = true; references = @./sub/part.usda@) {place.format(3)}
        def "one" (instanceable = true; references = @./inner.usda@</two>) {{}}
        def "paid" (payload = @sub/part.usda@) {place.format(5)}
        def "local" (references = </paid>) {{}}"""
    write(tmp_path, HEAD + f'def Xform "two" {{ {mesh()} {mesh("b")} }}', "inner.usda")
    path = write(tmp_path, text)
    assert companions(path) == ("inner.usda", "sub/part.usda")
    assert sorted(part.positions[:, 0].min() for part in read(path, 64).parts) == [0, 0, 3, 5, 5]
    before = mesh_source(path, companions(path)).digest
    write(tmp_path / "sub", HEAD.replace("(\n", '(\n defaultPrim = "square"\n', 1) + mesh(more=ST), "part.usda")
    assert mesh_source(path, companions(path)).digest != before
    (tmp_path / "sub/part.usda").unlink()
    assert "layer: expected an existing file, got part.usda" in error_of(path)


@pytest.mark.parametrize(("written", "error"), [
    ("../b.usda", "in the folder of the mesh or below it, got '../b.usda'"),
    ("/etc/passwd.usda", "in the folder of the mesh"),
    ("https://example.org/b.usda", "expected a file, got 'https://example.org/b.usda'"),
    ("b.abc", "expected layers that end in one of .usd .usda .usdc .usdz, got 'b.abc'"), ("c.usda", "got c.usda"),
    ("link.usda", "in the folder of the mesh or below it")])
def test_nothing_outside_of_the_folder_is_opened(tmp_path, written, error, monkeypatch):
    (folder := tmp_path / "chair").mkdir()
    write(tmp_path, HEAD + mesh(), "b.usda")
    (folder / "link.usda").symlink_to("../b.usda")
    path = write(folder, HEAD + f'def "a" (references = @{written}@</square>) {{}}')
    monkeypatch.chdir(tmp_path)
    opened = []
    find = Sdf.Layer.FindOrOpen
    monkeypatch.setattr(Sdf.Layer, "FindOrOpen", lambda name, *how: opened.append(Path(name).name) or find(name, *how))
    assert error in error_of(path)
    assert opened == ["a.usda"]


def test_what_is_not_drawn_is_named(tmp_path):
    text = HEAD + mesh() + mesh("hidden", more='token visibility = "invisible"') + "".join(
        mesh(purpose, more=f'uniform token purpose = "{purpose}"') for purpose in ("render", "proxy", "guide")) + """
        def Volume "smoke" {}
        def Points "cloud" {}
        def BasisCurves "hair" {}
        def SphereLight "lamp" {}
        def Camera "eye" {}
        def Skeleton "bones" {}
        over "nothing" {
            def Mesh "undefined" {}
        }
        class Mesh "abstract" {}"""
    model = read(write(tmp_path, text), 64)
    assert [part.name for part in model.parts] == ["/square", "/render"]
    assert set(model.left_out) == {
        "invisible Mesh /hidden", "Mesh /proxy of purpose proxy", "Mesh /guide of purpose guide", "Volume", "Points",
        "BasisCurves", "light of SphereLight", "Camera", "Skeleton",
        "meshes of 2 root prims, whatever defaultPrim says"}
    assert "expected mesh prims, got Points" in error_of(write(tmp_path, HEAD + 'def Points "cloud" {}', "b.usda"))


def test_variants_animation_and_subdivision_are_said(tmp_path):
    text = HEAD + f"""
        def Xform "chair" (variants = {{ string size = "large" }}; prepend variantSets = "size") {{
            double3 xformOp:translate.timeSamples = {{ 1: (5, 0, 0), 2: (9, 0, 0) }}
            uniform token[] xformOpOrder = ["xformOp:translate"]
            variantSet "size" = {{
                "large" {{
                    {mesh(scheme="catmullClark")}
                }}
                "small" {{
                }}
            }}
        }}"""
    model = read(write(tmp_path, text), 64)
    assert model.parts[0].positions[:, 0].min() == 5
    assert model.left_out == (
        "variants as selected: /chair size=large", "animation at its first time",
        "subdivision surfaces (catmullClark) taken after two rounds, values of face corners linear")


def test_subsets_have_materials_of_their_own(tmp_path):
    subset = ('def GeomSubset "{}" ({}) {{\n uniform token elementType = "face"\n'
              'uniform token familyName = "materialBind"\nint[] indices = [{}]\n {}\n }}\n')
    more = BOUND.format("paint") + "\n" + subset.format("top", API, "1", BOUND.format("gold"))
    two = {"points": "(0,0,0), (1,0,0), (1,1,0), (0,1,0), (2,0,0), (2,1,0)", "counts": "4, 4",
           "indices": "0,1,2,3, 1,4,5,2"}
    others = material("float inputs:roughness = 1") + material("float inputs:roughness = 0", name="gold")
    model = read(write(tmp_path, HEAD + mesh(more=more, metadata=API, **two) + others), 64)
    assert [(model.materials[part.material].material.name, part.positions[part.faces][..., 0].max())
            for part in model.parts] == [("paint", 1), ("gold", 2)]
    for faces, error in (("1, 2", "/square/top: expected faces in [0, 2), got 1 others, first 2"),
                         ("1, 0", "/square/low: expected faces that no other subset has, got 1 that one has")):
        bad = subset.format("top", API, faces, BOUND.format("gold")) + subset.format("low", API, "0", "")
        text = HEAD + mesh(more=bad, metadata=API, **two) + others
        assert error in error_of(write(tmp_path, text, f"{len(error)}.usda"))


def test_holes_and_concave_polygons(tmp_path):
    notch = {"points": "(0,0,0), (2,0,0), (2,2,0), (1,0.5,0), (0,2,0)", "counts": "5, 3, 3",
             "indices": "0,1,2,3,4, 0,1,2, 0,1,3"}
    (part,) = read(write(tmp_path, HEAD + mesh(more="int[] holeIndices = [1]", **notch)), 64).parts
    assert area(part) == pytest.approx(2.5 + 0.5)


@pytest.mark.parametrize(("how", "values", "indices", "expected"), [
    ("vertex", "(0,0), (1,0), (1,1), (0,1)", "", [(0, 0), (1, 0), (1, 1), (0, 1)]),
    ("varying", "(0,0), (1,0), (1,1), (0,1)", "", [(0, 0), (1, 0), (1, 1), (0, 1)]),
    ("vertex", "(0,0), (1,1)", "0, 1, 1, 0", [(0, 0), (1, 1), (1, 1), (0, 0)]),
    ("faceVarying", "(0.5,0), (1,0), (1,1)", "2, 1, 0, 0", [(1, 1), (1, 0), (0.5, 0), (0.5, 0)]),
    ("constant", "(0.25, 0.5)", "", [(0.25, 0.5)] * 4), ("uniform", "(0.5, 0.75)", "0", [(0.5, 0.75)] * 4)])
def test_coordinates_of_every_interpolation(tmp_path, how, values, indices, expected):
    write_image(tmp_path, "t.png", (255, 0, 0))
    st_of = f'texCoord2f[] primvars:st = [{values}] ( interpolation = "{how}" )\n'
    st_of += f"int[] primvars:st:indices = [{indices}]" if indices else ""
    (part,) = read(write(tmp_path, painted(CONNECTED, nodes=texture("t", "t.png"), more=st_of)), 64).parts
    corners = zip(part.faces.reshape(-1), part.uvs[0].reshape(-1, 2).tolist(), strict=True)
    found = {tuple(part.positions[vertex, :2].tolist()): tuple(uv) for vertex, uv in corners}
    assert [found[place] for place in [(0, 0), (1, 0), (1, 1), (0, 1)]] == expected


@pytest.mark.parametrize(("how", "colors"), [
    ("constant", "(0.1, 0.2, 0.3)"), ("uniform", "(0.1, 0.2, 0.3)"), ("vertex", ", ".join(["(0.1, 0.2, 0.3)"] * 4)),
    ("faceVarying", ", ".join(["(0.1, 0.2, 0.3)"] * 4))])
def test_display_colour_is_linear_and_opacity_coverage(tmp_path, how, colors):
    opacity = "float[] primvars:displayOpacity = [0.5]"
    more = f'color3f[] primvars:displayColor = [{colors}] ( interpolation = "{how}" )\n{opacity}'
    model = read(write(tmp_path, HEAD + mesh(more=more)), 64)
    np.testing.assert_allclose(model.parts[0].colors, np.broadcast_to((0.1, 0.2, 0.3, 0.5), (2, 3, 4)), rtol=1e-6)
    opaque = read(write(tmp_path, HEAD + mesh(more=opacity), "b.usda"), 64)
    np.testing.assert_allclose(opaque.parts[0].colors, np.broadcast_to((GREY, GREY, GREY, 0.5), (2, 3, 4)), rtol=1e-6)


def test_colours_that_nothing_reads_are_named(tmp_path):
    colors = 'color3f[] primvars:{} = [(0.1, 0.2, 0.3)] ( interpolation = "constant" )'
    model = read(write(tmp_path, HEAD + mesh(more=colors.format("Col"))), 64)
    assert model.parts[0].colors is None and model.left_out == ("colours Col, which no material reads",)
    assert read(write(tmp_path, HEAD + mesh(more=colors.format("displayColor"))), 64).left_out == ()


def test_a_mesh_of_loose_edges_beside_others_is_named(tmp_path):
    model = read(write(tmp_path, HEAD + mesh() + mesh("edges", counts="", indices="")), 64)
    assert [part.name for part in model.parts] == ["/square"]
    assert model.left_out == ("mesh /edges, which has no faces",)


@pytest.mark.parametrize(("text", "error"), [
    (HEAD + mesh(counts="4, 3"), "/square: expected faceVertexCounts that sum to the 4 faceVertexIndices, got 7"),
    (HEAD + mesh(indices="0, 1, 2, 9"), "/square: expected indices in [0, 4), got 1 faces with others"),
    (HEAD + mesh(counts="2, 2"), "got 2 with fewer, first at face 0"),
    (HEAD + mesh(counts="", indices=""), "expected mesh prims, got mesh /square, which has no faces"),
    (HEAD + mesh(points="(0,0,0), (nan,0,0), (1,1,0), (0,1,0)"), "got 1 with NaN or Inf, first at vertex 1"),
    (HEAD, "expected mesh prims, got none"),
    (HEAD.replace("metersPerUnit = 1", "metersPerUnit = -1") + mesh(), "expected metersPerUnit > 0, got -1"),
    (HEAD.replace('"Y"', '"up"') + mesh(), "expected upAxis to be X, Y or Z, got 'up'"),
    (HEAD + mesh(more='color3f[] primvars:displayColor = [(0,0,0), (1,1,1)] ( interpolation = "vertex" )'),
     "/square.displayColor: expected 4 values, one for each vertex, got 2"),
    (HEAD + mesh(more="color3f[] primvars:displayColor = [(0,0,0)]\nint[] primvars:displayColor:indices = [3]"),
     "expected indices in [0, 1), got 1 others, first 3"),
    (HEAD + "def Mesh", "expected a readable .usda file, got: a.usda:6:1: cannot be parsed at"),
    ("#usdx", "expected it to start with #usda 1."),
])
def test_what_makes_no_surface_is_refused(tmp_path, text, error):
    assert error in error_of(write(tmp_path, text))


def test_without_openusd_the_line_to_type_is_said(tmp_path, monkeypatch):
    path = write(tmp_path, HEAD + mesh())
    for name in [name for name in sys.modules if name.partition(".")[0] == "pxr"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pxr", None)
    assert 'pip install "3df-lighting-builder[usd]"' in error_of(path)


@pytest.mark.skipif(not ASSETS.is_dir(), reason="needs the models that are not part of the repository")
def test_a_real_stage_of_payloads_and_variants():
    asset = load(ASSETS / "usd_teapot" / "Teapot.usd")
    np.testing.assert_allclose(asset.mesh.bounds[1] - asset.mesh.bounds[0], (0.30, 0.49, 0.23), atol=0.005)
    assert asset.meta["contains"].startswith("1 mesh prim, 39,552 triangles, 1 material")
    assert "modelVariant=Utah" in asset.meta["left_out"]


def test_a_length_that_is_wrong_takes_no_memory(tmp_path):
    path = write(tmp_path, HEAD + mesh(points="(7,0,0), (1,0,0), (1,1,0), (0,1,0)"), "a.usdc")
    points = np.array([7, 0, 0, 1], "<f4").tobytes()
    content = path.read_bytes()
    assert content.count(points) == 1 and content[:content.index(points)].endswith((4).to_bytes(8, "little"))
    path.write_bytes(content.replace((4).to_bytes(8, "little") + points, (2**28).to_bytes(8, "little") + points))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "expected a readable .usdc file" in error_of(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**19, "half a gigabyte, in kilobytes"


def test_a_stage_without_end_takes_no_memory(tmp_path, monkeypatch):
    """Ten copies of ten copies: a billion prims of three kilobytes."""
    levels = "".join(f'def "l{level}" {{\n' + "".join(
        f'def "c{copy}" (references = </l{level + 1}>) {{}}\n' for copy in range(10)) + "}\n" for level in range(9))
    path = write(tmp_path, HEAD + levels + mesh("l9"))
    monkeypatch.setattr(usd_trial, "BASE_BYTES", 2**26)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "bytes of memory" in error_of(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 2**19, "half a gigabyte, in kilobytes"


SOUND = painted("color3f inputs:diffuseColor = (1,0,0)")


@settings(max_examples=25, derandomize=True, deadline=None)
@given(at=st.integers(0, 1000), gone=st.integers(0, 20), put=st.text('0129-.,"[]()@<>{}= \nabc', max_size=6),
       suffix=st.sampled_from(["usda", "usdc"]))
def test_no_bytes_raise_anything_but_a_user_error(tmp_path_factory, at, gone, put, suffix):
    folder = tmp_path_factory.mktemp("fuzz")
    path = write(folder, SOUND, f"a.{suffix}")
    content = path.read_bytes()
    at %= len(content)
    rest = content[at + (gone if suffix == "usda" else len(put)):]
    (folder / f"b.{suffix}").write_bytes(content[:at] + put.encode() + rest)
    try:
        model = read(folder / f"b.{suffix}", 16)
    except UserError:
        return
    assert all(np.isfinite(part.positions).all() for part in model.parts)
