"""What of a stage is one thing, where it stands, and what it shares."""

import numpy as np
import pytest

from dataset_builder.label.scene_source import PartPatterns
from tests.assets.scene_readers.usd_stages import METRES, at, choose, mesh, moved, names, place, prim, refused, scene

COMPONENT = 'kind = "component"'


def test_the_lowest_xform_is_a_thing(tmp_path):
    """As Blender exports it: an Xform for each object, its mesh below."""
    model = scene(tmp_path, METRES + prim(
        "Xform", "root", prim("Xform", "Chair", at(3), mesh("ChairMesh")), prim(
            "Xform", "Post", prim("Xform", "Sign", mesh("SignMesh")), prim("Scope", "Geom", mesh("Stand"))),
        prim("Scope", "Looks"), mesh("Floor")))
    assert names(model) == ["/root/Chair", "/root/Post/Sign", "/root/Post/Geom/Stand", "/root/Floor"]
    assert [thing.category for thing in model.things[:2]] == ["chair", "object"]
    assert place(model.things[0]) == (3.5, 0.5, 0)
    assert model.things[3].role == "floor"


def test_an_xform_that_is_called_after_one_thing_is_that_thing(tmp_path):
    """As Blender exports objects with a parent: each an Xform, in that of its parent."""
    legs = [prim("Xform", f"leg{k}", at(k), mesh("m")) for k in range(2)]
    model = scene(tmp_path, METRES + prim(
        "Xform", "root", prim("Xform", "Table", at(5), prim("Xform", "Table_top", mesh("m")), *legs),
        prim("Xform", "Chairs", *(prim("Xform", f"Chair_{k}", at(k), prim("Xform", "seat", mesh("m")))
                                  for k in range(2))),
        prim("Xform", "Bedroom", prim("Xform", "Bits", mesh("m"))),
        prim("Xform", "Door", prim("Xform", "b", mesh("m")))))
    assert names(model) == ["/root/Table", "/root/Chairs/Chair_0", "/root/Chairs/Chair_1", "/root/Bedroom/Bits",
                            "/root/Door/b"]
    assert [thing.category for thing in model.things[:3]] == ["table", "chair", "chair"]
    np.testing.assert_allclose(model.things[0].asset.mesh.size, (2, 1, 0))
    instance = 'instanceable = true; references = </Proto>'
    proto = 'class Xform "Proto" {\n' + prim("Xform", "Seat", mesh("a")) + "}\n"
    assert names(scene(tmp_path, METRES + proto + prim(
        "Xform", "World", prim("Xform", "c", metadata=instance), prim("Xform", "Sofa", prim(
            "Xform", "left", metadata=instance), prim("Xform", "right", at(1), metadata=instance))))) == [
        "/World/c", "/World/Sofa"]


def test_root_prims_of_their_own_are_things(tmp_path):
    two = METRES + prim("Xform", "Chair", mesh("seat"), mesh("back")) + prim("Xform", "Table", mesh("top"))
    assert names(scene(tmp_path, two)) == ["/Chair", "/Table"]
    one = METRES + prim("Xform", "World", mesh("seat"), mesh("back"))
    assert names(scene(tmp_path, one)) == ["/World/seat", "/World/back"]


def test_components_are_things_whatever_is_below(tmp_path):
    model = scene(tmp_path, METRES + prim(
        "Xform", "World",
        prim("Xform", "Chair", prim("Xform", "Seat", mesh("a"), metadata='kind = "subcomponent"'),
             prim("Xform", "Back", mesh("b")), metadata=COMPONENT),
        prim("Xform", "Room", prim("Xform", "Shelf", mesh("c"), metadata='kind = "subcomponent"'),
             metadata='kind = "group"'), metadata='kind = "assembly"'))
    assert names(model) == ["/World/Chair", "/World/Room/Shelf"]
    assert len(model.things[0].asset.mesh.faces) == 2, "two squares in the same place are one"


@pytest.mark.parametrize(("pattern", "expected"), [
    ("/World/Chair", ["/World/Chair", "/World/Table"]),
    ("/World/Chair/Seat/a", ["/World/Chair/Seat/a", "/World/Chair", "/World/Table"])])
def test_a_prim_that_the_spec_names_is_a_thing(tmp_path, pattern, expected):
    text = METRES + prim("Xform", "World", prim("Xform", "Chair", prim("Xform", "Seat", mesh("a"), mesh(
        "c", points="(5,0,0), (6,0,0), (6,1,0), (5,1,0)")), prim("Xform", "Back", mesh("b"))),
        prim("Xform", "Table", mesh("top")))
    named = (PartPatterns(part="object", patterns=(pattern,)),)
    assert names(scene(tmp_path, text, parts=named)) == expected


def test_instances_share_an_asset_each_at_its_place(tmp_path):
    shared = 'instanceable = true; references = </Proto>'
    proto = 'class Xform "Proto" {\n' + prim("Xform", "Seat", mesh("a")) + mesh("b") + "}\n"
    model = scene(tmp_path, METRES + proto + prim(
        "Xform", "World", *(prim("Xform", f"c{number}", at(10 * number), metadata=shared) for number in range(3)),
        prim("Xform", "other", mesh("a", points="(0,0,0), (2,0,0), (2,1,0), (0,1,0)"))))
    assert names(model) == ["/World/c0", "/World/c1", "/World/c2", "/World/other"]
    assert [place(thing)[0] for thing in model.things] == [0.5, 10.5, 20.5, 1]
    assert len({id(thing.asset) for thing in model.things}) == 2
    assert len({thing.content for thing in model.things}) == 2


def test_things_that_share_an_asset_are_called_each_by_its_own_name(tmp_path):
    proto = 'class Xform "Proto" {\n' + mesh("a") + "}\n"
    model = scene(tmp_path, METRES + proto + prim("Xform", "World", *(
        prim("Xform", name, metadata="instanceable = true; references = </Proto>")
        for name in ("thing", "Chair", "Lamp"))))
    assert len({id(thing.asset) for thing in model.things}) == 1
    assert [thing.category for thing in model.things] == ["object", "chair", "lamp"]


def test_instances_with_materials_or_colours_of_their_own_do_not_share(tmp_path):
    shared = 'instanceable = true; references = </Proto>'
    red = "color3f[] primvars:displayColor = [(1, 0, 0)]"
    model = scene(tmp_path, METRES + 'class Xform "Proto" {\n' + mesh("b") + "}\n" + prim(
        "Xform", "World", prim("Xform", "c0", metadata=shared), prim("Xform", "c1", red, metadata=shared)))
    assert [[each.base_color for each in thing.asset.materials] for thing in model.things] == [
        [(0.6, 0.6, 0.6)], [(1, 0, 0)]]


def test_equal_things_of_different_scenes_have_equal_content(tmp_path):
    one = scene(tmp_path, METRES + prim("Xform", "World", prim("Xform", "Chair", at(1), mesh("m"))), "a.usda").things[0]
    two = scene(tmp_path, METRES + prim("Xform", "Hall", prim("Xform", "C", at(9, 3), mesh("n"))), "b.usdc").things[0]
    assert one.content == two.content and (one.world != two.world).any()


def test_transforms_come_whole_mirrors_and_all(tmp_path):
    """world = metres * up axis * stage transform; a mirrored thing keeps its winding in its own frame."""
    ops = [("double3", "translate", "(100, 200, 300)"), ("float3", "rotateXYZ", "(0, 0, 90)"),
           ("float3", "scale", "(-2, 1, 1)")]
    text = '#usda 1.0\n( upAxis = "Y" )\n' + prim("Xform", "World", prim("Xform", "a", moved(ops), mesh("m")))
    (thing,) = scene(tmp_path, text).things
    # In the stage (x, y, z) -> (100 - y, 200 - 2 x, 300 + z); its y is up, so that world z = y and world y = -z
    np.testing.assert_allclose(thing.world @ (0.01, 0, 0, 1), (1, -3, 1.98, 1), atol=1e-12)
    np.testing.assert_allclose(thing.world @ (0, 0, 0.01, 1), (0.99, -3, 2, 1), atol=1e-12)
    assert np.linalg.det(thing.world[:3, :3]) == pytest.approx(-2)
    np.testing.assert_allclose(thing.asset.mesh.size, (0.01, 0, 0.01))
    assert (thing.asset.mesh.area_normals[:, 1] < 0).all(), "the square faces +z of the stage, -y of the world"


def test_a_thing_without_a_volume_is_a_fault(tmp_path):
    flat = moved([("float3", "scale", "(1, 0, 1)")])
    bad = mesh("m", points="(0,0,0), (0,0,0), (0,0,0), (0,0,0)")
    model = scene(tmp_path, METRES + prim("Xform", "World", prim("Xform", "a", flat, mesh("m")),
                                          prim("Xform", "b", bad), prim("Xform", "c", mesh("m"))))
    assert names(model) == ["/World/c"]
    assert [fault.partition(":")[0] for fault in model.faults] == ["/World/a", "/World/b"]


TWO = f"""
    variantSet "size" = {{
        "large" {{
            def Xform "Leaf" (prepend variantSets = "side"; variants = {{ string side = "left" }}) {{
                variantSet "side" = {{
                    "left" {{
                        {mesh("l")}
                    }}
                    "right" {{
                        {mesh("r")}
                    }}
                }}
            }}
        }}
        "small" {{
            {mesh("s")}
        }}
    }}"""


@pytest.mark.parametrize(("chosen", "expected"), [
    ((), "/World/Kit"), ((("/World/Kit", "size", "large"),), "/World/Kit/Leaf"),
    ((("/World/Kit/Leaf", "side", "right"), ("/World/Kit", "size", "large")), "/World/Kit/Leaf")])
def test_variants_that_the_spec_chooses_may_bring_prims_into_being(tmp_path, chosen, expected):
    text = METRES + prim("Xform", "World", prim(
        "Xform", "Kit", TWO, metadata='prepend variantSets = "size"; variants = { string size = "small" }'),
        mesh("floor"))
    model = scene(tmp_path, text, variants=tuple(choose(*choice) for choice in chosen))
    assert names(model) == [expected, "/World/floor"]
    (said,) = (line for line in model.left_out if line.startswith("variants as selected"))
    assert all(f"{path} {name}={variant}" in said for path, name, variant in chosen)


@pytest.mark.parametrize(("chosen", "error"), [
    (("/World/Kitt", "size", "large"), "expected a prim of the stage, got /World/Kitt (nearest: /World/Kit"),
    (("/World/Kit", "siz", "large"), "/World/Kit: expected a variant set, got siz (nearest: size)"),
    (("/World/Kit", "size", "lage"), "/World/Kit: size: expected a variant, got lage (nearest: large"),
    (("/World/Kit/Leaf", "side", "right"), "expected a prim of the stage, got /World/Kit/Leaf"),
    (("no path", "size", "large"), "expected the path of a prim")])
def test_variants_that_are_not_there_are_refused(tmp_path, chosen, error):
    text = METRES + prim("Xform", "World", prim(
        "Xform", "Kit", TWO, metadata='prepend variantSets = "size"; variants = { string size = "small" }'))
    assert error in refused(tmp_path, text, variants=(choose(*chosen),))
