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
            "Xform", "Lamp", prim("Xform", "Shade", mesh("ShadeMesh")), prim("Scope", "Geom", mesh("Stand"))),
        prim("Scope", "Looks"), mesh("Floor")))
    assert names(model) == ["/root/Chair", "/root/Lamp/Shade", "/root/Lamp/Geom/Stand", "/root/Floor"]
    assert [thing.category for thing in model.things[:2]] == ["chair", "object"]
    assert place(model.things[0]) == (3.5, 0.5, 0)
    assert model.things[3].role == "floor"


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
    ("/World/Chair/Seat/a", ["/World/Chair/Seat/a", "/World/Chair/Seat/c", "/World/Chair/Back", "/World/Table"])])
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
    ((), "/World/Table"), ((("/World/Table", "size", "large"),), "/World/Table/Leaf"),
    ((("/World/Table/Leaf", "side", "right"), ("/World/Table", "size", "large")), "/World/Table/Leaf")])
def test_variants_that_the_spec_chooses_may_bring_prims_into_being(tmp_path, chosen, expected):
    text = METRES + prim("Xform", "World", prim(
        "Xform", "Table", TWO, metadata='prepend variantSets = "size"; variants = { string size = "small" }'),
        mesh("floor"))
    model = scene(tmp_path, text, variants=tuple(choose(*choice) for choice in chosen))
    assert names(model) == [expected, "/World/floor"]
    (said,) = (line for line in model.left_out if line.startswith("variants as selected"))
    assert all(f"{path} {name}={variant}" in said for path, name, variant in chosen)


@pytest.mark.parametrize(("chosen", "error"), [
    (("/World/Tible", "size", "large"), "expected a prim of the stage, got /World/Tible (nearest: /World/Table"),
    (("/World/Table", "siz", "large"), "/World/Table: expected a variant set, got siz (nearest: size)"),
    (("/World/Table", "size", "lage"), "/World/Table: size: expected a variant, got lage (nearest: large"),
    (("/World/Table/Leaf", "side", "right"), "expected a prim of the stage, got /World/Table/Leaf"),
    (("no path", "size", "large"), "expected the path of a prim")])
def test_variants_that_are_not_there_are_refused(tmp_path, chosen, error):
    text = METRES + prim("Xform", "World", prim(
        "Xform", "Table", TWO, metadata='prepend variantSets = "size"; variants = { string size = "small" }'))
    assert error in refused(tmp_path, text, variants=(choose(*chosen),))
