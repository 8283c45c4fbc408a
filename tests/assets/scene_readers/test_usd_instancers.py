"""PointInstancers: each instance where its arrays put it, for scenes and for objects."""

import numpy as np
import pytest

from dataset_builder.assets.readers import usd_instancers
from dataset_builder.assets.readers.usd import read
from dataset_builder.assets.scene_readers import usd_scene
from tests.assets.readers.usd_files import write
from tests.assets.scene_readers.usd_stages import METRES, at, mesh, moved, names, place, prim, refused, scene


def grass(*, prototypes="</Grass/Blade>, </Grass/Stone>", indices="0, 1, 0", positions="(1,0,0), (2,0,0), (3,0,0)",
          more="", inner="", metadata=""):
    """An instancer of two prototypes, the first raised by 5."""
    return METRES + prim(
        "PointInstancer", "Grass", f"rel prototypes = [{prototypes}]", f"int[] protoIndices = [{indices}]",
        f"point3f[] positions = [{positions}]", more, prim("Xform", "Blade", at(0, 0, 5), mesh("m")),
        mesh("Stone", points="(0,0,0), (2,0,0), (2,2,0), (0,2,0)"), inner, metadata=metadata)


def test_each_instance_is_a_thing_and_prototypes_share(tmp_path):
    model = scene(tmp_path, grass())
    assert names(model) == ["/Grass[0]", "/Grass[1]", "/Grass[2]"]
    assert [place(thing) for thing in model.things] == [(1.5, 0.5, 5), (3, 1, 0), (3.5, 0.5, 5)]
    assert model.things[0].asset is model.things[2].asset and model.things[0].asset is not model.things[1].asset
    parts = read(write(tmp_path, grass(), "b.usda"), 16).parts
    assert [part.name for part in parts] == ["/Grass[0]/m", "/Grass[1]", "/Grass[2]/m"]
    # The stage's z is up, the model's y
    np.testing.assert_allclose([part.positions.min(axis=0) for part in parts], [(1, 5, -1), (2, 0, -2), (3, 5, -1)])


def test_scale_orientation_prototype_in_that_order(tmp_path):
    """Half a turn about z is (0, 0, 0, 1) as a quaternion with its real part first; then the instancer's own place."""
    more = "quath[] orientations = [(0, 0, 0, 1)]\nfloat3[] scales = [(2, 3, 4)]\n" + at(100)
    model = scene(tmp_path, grass(indices="0", positions="(10, 0, 0)", more=more))
    (thing,) = model.things
    found = thing.asset.mesh.positions @ thing.world[:3, :3].T + thing.world[:3, 3]
    np.testing.assert_allclose(found.min(axis=0), (110 - 2, -3, 20), atol=1e-6)
    np.testing.assert_allclose(found.max(axis=0), (110, 0, 20), atol=1e-6)


@pytest.mark.parametrize(("more", "metadata", "kept"), [
    ("int64[] invisibleIds = [1]", "", ["/Grass[0]", "/Grass[2]"]),
    ("int64[] ids = [7, 8, 9]\nint64[] invisibleIds = [7, 9]", "", ["/Grass[1]"]),
    ("", "inactiveIds = [0, 2]", ["/Grass[1]"])])
def test_instances_that_are_hidden_are_counted(tmp_path, more, metadata, kept):
    model = scene(tmp_path, grass(more=more, metadata=metadata))
    assert names(model) == kept
    assert f"{3 - len(kept)} invisible or inactive instances of /Grass" in model.left_out


def test_nested_instancers_are_part_of_the_outer_instance(tmp_path):
    inner = METRES + prim(
        "PointInstancer", "Trees", "rel prototypes = [</Trees/Tree>]", "int[] protoIndices = [0, 0]",
        "point3f[] positions = [(0,0,0), (50,0,0)]",
        prim("Xform", "Tree", mesh("trunk"), prim(
            "PointInstancer", "Leaves", "rel prototypes = [</Trees/Tree/Leaves/leaf>]", "int[] protoIndices = [0, 0]",
            "point3f[] positions = [(5,0,0), (7,0,0)]", mesh("leaf"))))
    model = scene(tmp_path, inner)
    assert names(model) == ["/Trees[0]", "/Trees[1]"]
    assert len(model.things[0].asset.mesh.faces) == 6 and model.things[0].asset is model.things[1].asset
    assert [place(thing)[0] for thing in model.things] == [4, 54]


def test_prototypes_below_an_over_are_drawn_by_instances_alone(tmp_path):
    text = grass(prototypes="</Kept/Blade>", indices="0").replace("(1,0,0), (2,0,0), (3,0,0)", "(1,0,0)")
    text += 'over "Kept" {\n' + prim("Xform", "Blade", mesh("b")) + "}\n"
    assert names(scene(tmp_path, text)) == ["/Grass[0]"]


@pytest.mark.parametrize(("what", "error"), [
    ({"indices": "0, 2, 0"}, "/Grass: expected protoIndices in [0, 2), got 1 others, first 2"),
    ({"positions": "(1,0,0)"}, "/Grass: expected 3 positions, one for each of protoIndices, got 1"),
    ({"more": "float3[] scales = [(1,1,1)]"}, "/Grass: expected 3 scales"),
    ({"more": "quath[] orientations = [(1,0,0,0)]"}, "/Grass: expected 3 orientations"),
    ({"more": "int64[] ids = [1]"}, "/Grass: expected 3 ids"),
    ({"prototypes": "</Grass/Blade>, </Grass/Gone>"}, "/Grass: expected prototypes that are prims, got /Grass/Gone"),
    ({"positions": "(1,0,0), (nan,0,0), (3,0,0)"}, "/Grass: expected 3 instances at finite places"),
    ({"prototypes": "</Grass/Blade>, </Grass>"}, "expected prototypes that are not instances of themselves")])
def test_arrays_that_do_not_belong_together_are_refused(tmp_path, what, error):
    assert error in refused(tmp_path, grass(**what))


def test_too_many_instances_are_refused_by_name(tmp_path, monkeypatch):
    many = usd_instancers.MOST_INSTANCES + 1
    text = grass(indices=", ".join(["0"] * many), positions=", ".join(["(0,0,0)"] * many))
    assert f"/Grass: expected at most 20,000 instances of PointInstancers in all, got {many:,}" in refused(
        tmp_path, text)


def test_too_many_triangles_of_instances_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(usd_scene, "MOST_TRIANGLES", 5)
    assert "expected at most 5 triangles, instances counted each, got 6" in refused(tmp_path, grass())


def test_instances_of_instances_are_counted_each(tmp_path):
    levels = "".join(prim("PointInstancer", f"l{level}", f"rel prototypes = [</l{level + 1}>]",
                          f"int[] protoIndices = [{', '.join(['0'] * 50)}]",
                          f"point3f[] positions = [{', '.join(['(0,0,0)'] * 50)}]") for level in range(5))
    assert "instances of PointInstancers in all" in refused(tmp_path, METRES + levels + mesh("l5"))


def test_transforms_of_all_kinds(tmp_path):
    """Inverses, pivots and resets: each square is where its point (0, 0, 0) is worked out to be."""
    pivot = [("float3", "translate:pivot", "(1, 0, 0)"), ("float", "rotateZ", "180"),
             ("", "!invert!xformOp:translate:pivot", "")]
    cases = {
        "pivot": (moved(pivot), (2, 0, 0)),
        "matrix": (moved([("matrix4d", "transform", "((0,1,0,0), (-1,0,0,0), (0,0,1,0), (7,8,9,1))")]), (7, 8, 9)),
        "orient": (moved([("double3", "translate", "(1,2,3)"), ("quatf", "orient", "(0, 0, 0, 1)"),
                          ("double3", "translate:b", "(1,0,0)")]), (0, 2, 3)),
        "XYZ": (moved([("float3", "rotateXYZ", "(90, 0, 90)"), ("double3", "translate", "(0,0,1)")]), (1, 0, 0)),
        "ZYX": (moved([("float3", "rotateZYX", "(90, 0, 90)"), ("double3", "translate", "(0,0,1)")]), (0, -1, 0)),
        "axes": (moved([("double", "translateX", "4"), ("double", "scaleX", "2"), ("double", "translateX:b", "1")]),
                 (6, 0, 0)),
        "reset": ("double3 xformOp:translate = (0,0,2)\n"
                  'uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]', (0, 0, 2))}
    inner = [prim("Xform", name, ops, mesh("m")) for name, (ops, _) in cases.items()]
    model = scene(tmp_path, METRES + prim("Xform", "World", at(1000), *inner))
    for thing, (name, (_, expected)) in zip(model.things, cases.items(), strict=True):
        shift = (0, 0, 0) if name == "reset" else (1000, 0, 0)
        np.testing.assert_allclose(thing.world[:3, 3], np.add(expected, shift), atol=1e-6, err_msg=name)
    assert "/World/bad: expected xformOps that the prim has, got xformOp:gone" in refused(tmp_path, METRES + prim(
        "Xform", "World", prim("Xform", "bad", 'uniform token[] xformOpOrder = ["xformOp:gone"]', mesh("m"))))
