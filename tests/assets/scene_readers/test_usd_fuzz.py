"""Whatever the bytes are, a stage is a scene or is refused in a line."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import UsdUtils

from dataset_builder.assets.readers import usd_stage
from dataset_builder.assets.scene_file import load_scene
from dataset_builder.errors import UserError
from dataset_builder.label.scene_source import SceneSource
from tests.assets.readers.test_usd_surfaces import CUBE
from tests.assets.readers.usd_files import API, BOUND, ST, material, texture, write, write_image
from tests.assets.scene_readers.usd_stages import METRES, at, mesh, prim

INSTANCE = "instanceable = true; references = </Proto>"
SUBSET = ('def GeomSubset "top" (prepend apiSchemas = ["MaterialBindingAPI"]) {\nuniform token elementType = "face"\n'
          'uniform token familyName = "materialBind"\nint[] indices = [1]\nrel material:binding = </gold>\n}\n')
CREASES = "int[] creaseIndices = [0, 1, 2]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [2]\n"
EVERYTHING = METRES + prim(
    "Xform", "World",
    prim("Xform", "Chair", at(3), mesh("seat", more=f"{BOUND.format('paint')}\n{ST}", metadata=API),
         metadata='kind = "component"'),
    mesh("cube", **CUBE, more=CREASES + SUBSET, scheme="catmullClark"),
    prim("Sphere", "ball", "color3f[] primvars:displayColor = [(0, 0, 1)]"),
    prim("Capsule", "pill", "double radius = 1"),
    prim("Xform", "one", metadata=INSTANCE), prim("Xform", "two", at(4), metadata=INSTANCE),
    prim("PointInstancer", "Grass", "rel prototypes = [</World/Grass/Blade>]", "int[] protoIndices = [0, 0]",
         "point3f[] positions = [(1, 0, 0), (2, 0, 0)]", "quath[] orientations = [(1, 0, 0, 0), (0, 0, 0, 1)]",
         "float3[] scales = [(1, 1, 1), (2, 2, 2)]", prim("Xform", "Blade", mesh("m"))),
    prim("RectLight", "Lamp", at(0, 0, 3), "float inputs:intensity = 10", "float inputs:exposure = 2"),
    prim("Camera", "Eye", at(0, -5, 1), "float focalLength = 50")) + 'class Xform "Proto" {\n' + mesh("p") + "}\n"
EVERYTHING += material("color3f inputs:diffuseColor.connect = </paint/t.outputs:rgb>", nodes=texture("t", "t.png"))
EVERYTHING += material("float inputs:metallic = 1", name="gold")
NUMBERS = [found.span() for found in re.finditer(r"(?<=[\[(, =])-?[0-9.]+(?=[\]),\n ])", EVERYTHING)]
VALUES = ("-1", "0", "1e-30", "1e20", "1e39", "nan", "inf", "7", "2147483647", "None", '"a"', "0.5", "(1, 2)")


def outcome(folder, name):
    """Read a scene, and hold it to what scenes promise; False where it is refused."""
    try:
        model = load_scene(SceneSource(source=name, licence="CC0-1.0"), folder, max_texture=16)
    except UserError as error:
        assert name in str(error) and "\n" not in str(error)
        return False
    assert len({thing.name for thing in model.things}) == len(model.things) > 0
    for thing in model.things:
        assert np.isfinite(thing.world).all() and np.isfinite(thing.asset.mesh.positions).all()
    return True


def test_the_stage_that_is_broken_is_whole(tmp_path):
    write_image(tmp_path, "t.png", (255, 0, 0))
    write(tmp_path, EVERYTHING)
    assert outcome(tmp_path, "a.usda") and len(NUMBERS) > 150


@settings(max_examples=60, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.lists(st.tuples(st.integers(0, len(NUMBERS) - 1), st.sampled_from(VALUES)), min_size=1, max_size=2))
def test_other_numbers(tmp_path, monkeypatch, changes):
    """Text lies about nothing's length: it needs no trial."""
    monkeypatch.setattr(usd_stage, "trial_problem", lambda *_: "")
    write_image(tmp_path, "t.png", (255, 0, 0))
    text = EVERYTHING
    for number, value in sorted(dict(changes).items(), reverse=True):
        first, last = NUMBERS[number]
        text = text[:first] + value + text[last:]
    write(tmp_path, text)
    outcome(tmp_path, "a.usda")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    write_image(folder, "t.png", (255, 0, 0))
    write(folder, EVERYTHING, "a.usdc")
    UsdUtils.CreateNewUsdzPackage(str(folder / "a.usdc"), str(folder / "a.usdz"))
    return folder


@settings(max_examples=12, derandomize=True, deadline=None)
@given(suffix=st.sampled_from(["usdc", "usdz"]), at=st.floats(0, 1, exclude_max=True), value=st.binary(max_size=4),
       cut=st.booleans())
def test_other_bytes(sound, suffix, at, value, cut):
    content = (sound / f"a.{suffix}").read_bytes()
    where = int(at * len(content))
    rest = b"" if cut else content[where + len(value):]
    (sound / f"b.{suffix}").write_bytes(content[:where] + value + rest)
    outcome(sound, f"b.{suffix}")
