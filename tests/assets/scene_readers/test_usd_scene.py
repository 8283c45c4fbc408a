"""Stages as scenes: what they are composed of, what of them is drawn, and what is refused."""

import struct
import zipfile

import numpy as np
import pytest
from pxr import UsdUtils

from dataset_builder.assets.readers.usd import read
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.errors import UserError
from dataset_builder.label.scene_source import SceneSource
from dataset_builder.spec.mesh_source import companions
from tests.assets.readers.usd_files import API, BOUND, material, texture, write, write_image
from tests.assets.scene_readers.usd_stages import METRES, at, mesh, names, place, prim, refused, scene

CHAIR = prim("Xform", "Chair", mesh("seat"))
ROOM = METRES + prim("Xform", "World", CHAIR, prim("Xform", "Lamp", at(2), prim("SphereLight", "Bulb")),
                     prim("Camera", "Eye", at(0, -5, 1)))


@pytest.mark.parametrize("name", ["a.usda", "a.usd", "a.usdc"])
def test_text_and_binary_make_the_same_scene(tmp_path, name):
    model = scene(tmp_path, ROOM, name)
    assert model.contains == "1 thing, 1 light, 1 camera, 2 triangles"
    assert (names(model), model.lights[0].name, model.cameras[0].name) == (
        ["/World/Chair"], "/World/Lamp/Bulb", "/World/Eye")
    assert model.lights[0].light.position == (2, 0, 0) and model.faults == ()


def test_a_package_is_a_scene_with_its_textures(tmp_path):
    write_image(tmp_path, "t.png", (255, 0, 0))
    red = material("color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>", nodes=texture("t", "t.png"))
    st = 'texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] ( interpolation = "vertex" )'
    painted = mesh("m", more=f"{BOUND.format('paint')}\n{st}", metadata=API)
    write(tmp_path, METRES + prim("Xform", "World", painted) + red)
    (out := tmp_path / "out").mkdir()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(out / "a.usdz"))
    (thing,) = load_scene(SceneSource(source="a.usdz", licence="CC0-1.0"), out).things
    np.testing.assert_array_equal(thing.asset.materials[0].texture.base_color[0, 0], (1, 0, 0))


def test_what_is_alike_of_several_cameras_is_told_once(tmp_path):
    """Exporters write some attributes for each of them."""
    near = "float2 clippingRange = (0.1, 1000)"
    eyes = [prim("Camera", f"Eye{k}", at(0, -5, k), near) for k in range(5)]
    blurred = prim("Camera", "Off", at(1), "float fStop = 2")
    model = scene(tmp_path, METRES + prim("Xform", "World", CHAIR, *eyes, blurred))
    assert model.left_out == (
        "5 cameras (/World/Eye0, /World/Eye1, /World/Eye2 and 2 more): clipping range 0.1 to 1000",
        "camera /World/Off: depth of field (fStop 2)")


@pytest.mark.parametrize("unit", ["metersPerUnit = 2", ""])
@pytest.mark.parametrize(("axis", "top"), [("X", (2, 3, 1)), ("Y", (1, -3, 2)), ("Z", (1, 2, 3)), ("", (1, -3, 2))])
def test_units_and_axis(tmp_path, unit, axis, top):
    """Where the stage's (1, 2, 3) is, in metres with z up."""
    text = f'#usda 1.0\n(\n{unit}\n' + (f'upAxis = "{axis}"\n' if axis else "") + ")\n"
    model = scene(tmp_path, text + prim("Xform", "World", prim("Xform", "a", at(1, 2, 3), mesh("m"))), scale=3.0)
    metres = 2 if unit else 0.01
    np.testing.assert_allclose(model.things[0].world[:3, 3], np.array(top) * metres * 3)
    assert ("no metersPerUnit, taken as 0.01" in model.left_out) == (not unit)


def test_layers_of_every_kind_are_followed(tmp_path):
    (tmp_path / "sub").mkdir()
    head = METRES.replace("(\n", '(\n defaultPrim = "Part"\n', 1)
    write(tmp_path / "sub", head + prim("Xform", "Part", mesh("p")), "part.usda")
    write(tmp_path, METRES + prim("Xform", "World", prim("Xform", "FromSublayer", mesh("m"))), "under.usda")
    text = METRES.replace("(\n", "(\n subLayers = [@./under.usda@]\n", 1)
    text += 'class Xform "_base" {\n' + mesh("m") + "}\n"
    text += 'over "World" {\n' + "".join((
        prim("Xform", "Referred", metadata="references = @./sub/part.usda@"),
        prim("Xform", "Paid", metadata="payload = @./sub/part.usda@"),
        prim("Xform", "Heir", metadata="inherits = </_base>"),
        prim("Xform", "Special", metadata="specializes = </_base>"),
        prim("Xform", "Off", mesh("m"), metadata="active = false"))) + "}\n"
    model = scene(tmp_path, text)
    assert names(model) == [f"/World/{name}" for name in ("FromSublayer", "Referred", "Paid", "Heir", "Special")]
    assert companions(tmp_path / "a.usda") == ("sub/part.usda", "under.usda")
    assert len(read(tmp_path / "a.usda", 16).parts) == 5


def test_other_folders_are_read_if_the_spec_names_them(tmp_path):
    for folder in ("scene", "library", "private"):
        (tmp_path / folder).mkdir()
    head = METRES.replace("(\n", '(\n defaultPrim = "Part"\n', 1)
    for folder in ("library", "private"):
        write(tmp_path / folder, head + prim("Xform", "Part", mesh("p")), "part.usda")
    text = METRES + prim("Xform", "World", prim("Xform", "a", metadata="references = @../library/part.usda@"))
    write(tmp_path / "scene", text)
    source = SceneSource(source="scene/a.usda", licence="CC0-1.0")
    assert names(load_scene(source.model_copy(update={"roots": ("library",)}), tmp_path)) == ["/World/a"]
    for roots in ((), ("private",)):
        with pytest.raises(UserError, match=r"expected a file in the folder of the mesh or below it"):
            load_scene(source.model_copy(update={"roots": roots}), tmp_path)
    write(tmp_path / "scene", text.replace("../library/part.usda", "https://example.org/part.usda"))
    with pytest.raises(UserError, match=r"expected a file, got 'https://example\.org/part\.usda'"):
        load_scene(source, tmp_path)


@pytest.mark.parametrize(("text", "error"), [
    (prim("Xform", "a", mesh("m"), metadata="references = </b>") + prim("Xform", "b", metadata="references = </a>"),
     "expected references that come to an end, got a circle"),
    (prim("Xform", "a", mesh("m"), metadata="references = @./a.usda@</a>"), "got a circle"),
    (prim("Xform", "a", mesh("m"), metadata="references = @./gone.usda@"),
     "layer: expected an existing file, got gone.usda"),
    (prim("Xform", "a"), "expected things with triangles, got none"),
    (prim("Points", "a"), "expected things with triangles, got none (Points)"),
    (prim("Xform", "a", mesh("m", indices="0,1,2,9")), "/a/m: expected indices in [0, 4), got 1 faces with others"),
    (prim("Xform", "a", "matrix4d xformOp:transform = ((1,0,0,0), (0,1,0,0), (0,0,1,0), (nan,0,0,1))\n"
          'uniform token[] xformOpOrder = ["xformOp:transform"]', mesh("m")), "/a: expected an affine transform"),
    (prim("Mesh", "a", "double points = 3", "int[] faceVertexCounts = [3]"), "/a: "),
    (prim("Xform", "a", 'token[] xformOpOrder = ["xformOp:x"]\nstring xformOp:x = "y"', mesh("m")), "/a: "),
    ("".join(f'def "p{n}" {{\n' for n in range(600)) + mesh("m") + "}\n" * 600, "expected prims at most 500 deep")])
def test_what_makes_no_scene_is_refused(tmp_path, text, error):
    assert error in refused(tmp_path, METRES + text)


def test_a_circle_of_sublayers_is_refused(tmp_path):
    write(tmp_path, METRES.replace("(\n", "(\n subLayers = [@./a.usda@]\n", 1) + CHAIR, "b.usda")
    assert "got a circle" in refused(tmp_path, METRES.replace("(\n", "(\n subLayers = [@./b.usda@]\n", 1))


def test_a_reference_to_no_prim_is_named(tmp_path):
    model = scene(tmp_path, METRES + prim("Xform", "World", CHAIR, prim("Xform", "a", metadata="references = </gone>")))
    assert any(line.startswith("not composed: Unresolved reference prim path") for line in model.left_out)


def test_what_is_not_drawn_is_named(tmp_path):
    """Purpose and visibility hold for all below; a purpose may be another's again further down."""
    model = scene(tmp_path, METRES + prim(
        "Xform", "World", CHAIR, prim("Xform", "off", 'token visibility = "invisible"', mesh("m")),
        prim("Xform", "guides", 'uniform token purpose = "guide"', mesh("a"), mesh("b"), mesh(
            "c", more='uniform token purpose = "render"')),
        prim("Points", "cloud"), prim("BasisCurves", "hair"), prim("Volume", "smoke"),
        prim("ParticleField3DGaussianSplat", "splat")))
    assert set(names(model)) == {"/World/Chair", "/World/guides"}
    assert {"invisible Xform /World/off", "Xform /World/guides of purpose guide", "Points", "BasisCurves",
            "Volume"} <= set(model.left_out)
    assert any("Splat" in line for line in model.left_out)


def test_materials_bound_to_collections_and_by_strength(tmp_path):
    """The weaker binding of the mesh gives way to a stronger one above it, and to none that is not."""
    paints = "".join(material(f"float inputs:roughness = {number}", name=name)
                     for number, name in ((0.25, "low"), (0.75, "high")))
    strong = 'rel material:binding = </high> ( bindMaterialAs = "strongerThanDescendants" )'
    chosen = ("prepend rel collection:some:includes = </World/c/m>\n"
              "rel material:binding:collection:some = [</World/c.collection:some>, </high>]")
    inner = mesh("m", more=BOUND.format("low"), metadata=API)
    model = scene(tmp_path, METRES + paints + prim(
        "Xform", "World", prim("Xform", "a", strong, inner, metadata=API),
        prim("Xform", "b", BOUND.format("high"), inner, metadata=API),
        prim("Xform", "c", chosen, mesh("m"),
             metadata='prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"]'),
        prim("Xform", "d", mesh("m", more="rel material:binding:preview = </low>", metadata=API))))
    assert [thing.asset.materials[0].roughness for thing in model.things] == [0.75, 0.25, 0.75, 0.25]


def rewritten(path, change):
    """A package with its list of files changed, the files as they were."""
    with zipfile.ZipFile(path) as package:
        members = [(member, package.read(member)) for member in package.infolist()]
    with zipfile.ZipFile(path, "w") as package:
        for member, content in members:
            name, how = change(member.filename)
            package.writestr(name, content, how)


@pytest.mark.parametrize(("change", "error"), [
    (lambda name: (name, zipfile.ZIP_DEFLATED), "expected a package without compression or encryption, got 'a.usdc'"),
    (lambda name: (f"../{name}", zipfile.ZIP_STORED), "expected files within a.usdz, got one called '../a.usdc'"),
    (lambda name: (f"/{name}", zipfile.ZIP_STORED), "expected files within a.usdz"),
    (lambda name: (f"x\\..\\{name}", zipfile.ZIP_STORED), "expected files within a.usdz")])
def test_packages_that_lie_are_refused(tmp_path, change, error):
    write(tmp_path, ROOM, "a.usdc")
    UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usdc"), str(tmp_path / "a.usdz"))
    rewritten(tmp_path / "a.usdz", change)
    with pytest.raises(UserError) as caught:
        load_scene(SceneSource(source="a.usdz", licence="CC0-1.0"), tmp_path)
    assert error in str(caught.value)


def test_a_package_of_overlapping_files_is_refused(tmp_path):
    """A list of a thousand names for one file: more bytes than the package has."""
    write(tmp_path, ROOM, "a.usdc")
    UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usdc"), str(tmp_path / "a.usdz"))
    content = (tmp_path / "a.usdz").read_bytes()
    start = content.index(b"PK\x01\x02")
    entry = content[start:content.index(b"PK\x05\x06")]
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 1000, 1000, 1000 * len(entry), start, 0)
    (tmp_path / "a.usdz").write_bytes(content[:start] + entry * 1000 + end)
    with pytest.raises(UserError, match=r"expected files that are no larger than a\.usdz itself"):
        load_scene(SceneSource(source="a.usdz", licence="CC0-1.0"), tmp_path)


def test_one_side_and_category_labels_are_said(tmp_path):
    label = 'token[] semantics:labels:class = ["sofa"]'
    model = scene(tmp_path, METRES + prim("Xform", "World", prim("Xform", "x12", label, mesh(
        "m", more="uniform bool doubleSided = 0")), mesh("n")))
    assert model.things[0].category == "sofa" and place(model.things[1]) == (0.5, 0.5, 0)
    assert "surfaces of one side are seen from both" in model.left_out


def test_images_of_lights_are_companions_where_they_may_be_read(tmp_path):
    """One that is not there, or elsewhere, is said with its light, which is there without it."""
    (tmp_path / "in").mkdir()
    for folder in (tmp_path, tmp_path / "in"):
        write_image(folder, "sky.png", (255, 255, 255))
    dome = 'float inputs:intensity = 1\nasset inputs:texture:file = @{}@'
    text = METRES + prim("Xform", "World", CHAIR, *(prim("DomeLight", name, dome.format(file)) for name, file in (
        ("here", "sky.png"), ("gone", "none.png"), ("elsewhere", "../sky.png"))))
    write(tmp_path / "in", text)
    assert companions(tmp_path / "in/a.usda") == ("sky.png",)
    model = load_scene(SceneSource(source="a.usda", licence="CC0-1.0"), tmp_path / "in")
    assert len(model.lights) == 3
    for name, file in (("gone", "none.png"), ("elsewhere", "../sky.png")):
        assert any(f"/World/{name}" in line and file in line for line in model.left_out)
