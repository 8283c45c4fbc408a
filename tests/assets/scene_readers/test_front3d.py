"""Scenes of 3D-FRONT: every known fault lived with and named, and what is refused."""

import doctest
import json
import os

import numpy as np
import pytest

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_readers import front3d, front3d_building, front3d_models
from dataset_builder.assets.scene_readers.front3d_models import metres_per_unit
from dataset_builder.errors import UserError
from tests.front3d_faults import FAULTS
from tests.front3d_files import house
from tests.front3d_pieces import jid_of, png

SMALL = {"rooms": ("Bedroom-31", "Kitchen-44"), "models": ("bed", "nightstand", "wardrobe", "lshape", "stool")}
ONE = {"rooms": ("Kitchen-44",), "models": ("stool",)}


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    folder = tmp_path_factory.mktemp("house")
    return load(folder, house(**SMALL))


def load(folder, made):
    return load_scene(made.write(folder), folder, max_texture=64)


@pytest.mark.parametrize("module", [front3d, front3d_building, front3d_models])
def test_examples_in_docstrings_hold(module):
    found = doctest.testmod(module)
    assert (found.failed, found.attempted > 0) == (0, True)


def test_a_house_without_faults_has_none(clean):
    assert clean.faults == ()
    assert clean.left_out == ("no lights: scenes of 3D-FRONT have none, and lamps give no light",)
    assert clean.contains.startswith("2 rooms, 5 of 5 pieces of furniture, 5 models, 56 meshes of the building, ")


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_lived_with_and_named(tmp_path, clean, name):
    plant, kind, more = FAULTS[name]
    made = house(**SMALL)
    plant(made)
    model = load(tmp_path, made)
    assert len(model.things) == len(clean.things) + more
    assert [text for text in model.faults if kind in text]
    assert not [text for text in model.faults if str(tmp_path) in text]


def test_many_faults_at_once(tmp_path):
    """Those that do not undo each other; kinds are told once, with their number and the first three."""
    made = house(**SMALL)
    names = ("ref to nothing", "door to nothing", "null in uv", "no type", "texture not there", "emission", "no floor",
             "centimetres by size", "in a wall", "model not on disk")
    for name in names:
        FAULTS[name][0](made)
    for number in range(9):
        made.room("Kitchen-44")["children"].append({"ref": "", "instanceid": f"mesh/x{number}"})
    faults = load(tmp_path, made).faults
    assert all(any(FAULTS[name][1] in text for text in faults) for name in names)
    assert "left out (10): Kitchen-44/more/1 (8319/model), Kitchen-44/mesh/x0 (scene.room[1]." in " ".join(faults)
    assert any(text.endswith(" and 7 more") for text in faults)


@pytest.mark.parametrize("bbox", [[[1.8, 0.6, 2.3]], [1.8, 2.3, 0.6], ["1.8", "0.6", "2.3"], [], None, "x", [1, 2]])
def test_boxes_come_in_many_orders(tmp_path, bbox):
    made = house(rooms=("Bedroom-31",), models=("wardrobe",))
    width, depth, height = made.entry("wardrobe")["size"]
    fill = {1.8: width, 0.6: depth, 2.3: height}
    made.entry("wardrobe")["bbox"] = json.loads(json.dumps(bbox), parse_float=lambda text: fill[float(text)])
    made.entry("wardrobe").pop("size")
    assert load(tmp_path, made).faults == ()


@pytest.mark.parametrize(("extents", "sizes", "unit", "fault"), [
    ((60, 50, 40), [(0.6, 0.4, 0.5)], 0.01, "centimetres"),
    ((0.6, 0.5, 0.4), [(0.4, 0.5, 0.6), (0.6, 0.5, 0.4)], 1, ""),
    ((0.6, 0.5, 0.4), [(60, 50, 40)], 1, "declared in centimetres"),
    ((60, 50, 40), [(60, 50, 40)], 0.01, "centimetres"),
    ((200, 150, 1), [(2.0, 1.5, 0.02)], 0.01, "centimetres"),
    ((9.9, 1, 1), [], 1, ""),
    ((11, 1, 1), [], 0.01, "without a declared size"),
    ((0.6, 0.5, 0.4), [(0.6, 0.5, 0.3)], 1, "not the declared one"),
    ((7, 7, 7), [(1, 1, 1)], 1, "not the declared one"),
    ((13, 13, 13), [(1, 1, 1)], 0.01, "not the declared one"),
])
def test_units_are_judged_by_declared_sizes(extents, sizes, unit, fault):
    """7 is nearer to 1 than 0.07 is, 13 is not: the two meet at 10."""
    found, kind, _ = metres_per_unit(extents, sizes)
    assert found == unit
    assert fault in kind
    assert bool(kind) == bool(fault)


@pytest.mark.parametrize("where", ["folder", "file"])
def test_no_link_leads_out_of_the_folders(tmp_path, where):
    made = house(**ONE)
    source = made.write(tmp_path / "data")
    inside, outside = tmp_path / "data" / "models" / jid_of("stool"), tmp_path / "elsewhere"
    os.rename(inside, outside)
    if where == "folder":
        inside.symlink_to(outside)
    else:
        inside.mkdir()
        (inside / "raw_model.obj").symlink_to(outside / "raw_model.obj")
    model = load_scene(source, tmp_path / "data", max_texture=64)
    assert [thing for thing in model.things if thing.category == "barstool"] == []
    assert any("models that are not there, left out (1): " + jid_of("stool") in text for text in model.faults)


@pytest.mark.parametrize("jid", ["../x", "a/b", "/etc", "..", ".", "a\\b", "a\0b", "\ud800", "x" * 300, "", 7, ["a"],
                                 {}])
def test_jids_are_names_of_folders(tmp_path, jid):
    made = house(**ONE)
    made.entry("stool")["jid"] = made.material("wood")["jid"] = jid
    model = load(tmp_path, made)
    assert {thing.role for thing in model.things} == {"floor", "walls", "ceiling"}


def test_without_folders_colours_are_plain_and_furniture_is_left_out(tmp_path):
    source = house(**ONE).write(tmp_path).model_copy(update={"models": "", "textures": ""})
    model = load_scene(source, tmp_path)
    assert model.left_out[1:] == ("1 piece of furniture: the spec names no folder of models",
                                  "textures of 1 material: the spec names no folder of textures")


def test_the_normalised_model_stands_in_and_other_files_do_not_count(tmp_path):
    made = house(**ONE)
    folder = f"models/{jid_of('stool')}"
    made.files[f"{folder}/normalized_model.obj"] = made.files.pop(f"{folder}/raw_model.obj")
    made.files[f"{folder}/image.jpg"] = b"broken"
    assert load(tmp_path, made).faults == ()


def test_textures_of_older_files_are_found_by_their_address(tmp_path):
    made = house(**ONE)
    made.material("wood").update(jid="", texture="https://example.com/a/b/bbbb-wood/wallfloor.jpg")
    floor = next(thing for thing in load(tmp_path, made).things if thing.role == "floor")
    assert floor.asset.materials[0].texture is not None


def test_a_texture_takes_the_place_of_the_colour(tmp_path):
    made = house(**ONE)
    made.files["textures/bbbb-wood/texture.png"] = png(np.full((4, 4, 3), 128))
    made.material("wood")["color"] = [10, 20, 30, 51]
    material = next(thing for thing in load(tmp_path, made).things if thing.role == "floor").asset.materials[0]
    assert material.base_color == (1, 1, 1)
    assert material.alpha == pytest.approx(0.2)
    assert material.texture.base_color[0, 0] == pytest.approx([0.21586] * 3, abs=1e-4)


@pytest.mark.parametrize(("content", "rule"), [
    (b"", "line 1, column 1: expected JSON"), (b"[1, 2]", "an object with the key scene, got [1, 2]"),
    (b'{"a": 1}', "got one without it: ['a']"), (b'{"scene": 3}', "got one without it"),
    (b"\xff\xfe\0", "expected text in UTF-8, got UTF-16"),
    (b'{"scene": {}, "x": ' + b"[" * 100_000, "not nested without end"),
    (b"[" + b"[]," * 1_100_000, "at most 1,048,576 objects and lists"),
    (b'{"scene": {}}', "expected walls, floors or furniture"),
    (b'{"scene": {"room": [{"children": [{"ref": "x"}]}]}}', "references to nothing"),
    (b'{"scene": {}, "x": ' + b"9" * 5000 + b"}", "expected a readable scene"),
])
def test_other_files_are_refused_in_one_line(tmp_path, content, rule):
    source = house(**ONE).write(tmp_path)
    (tmp_path / "house.json").write_bytes(content)
    with pytest.raises(UserError) as raised:
        load_scene(source, tmp_path)
    (problem,) = raised.value.problems
    assert rule in str(problem)
    assert str(problem).startswith(f"{tmp_path}/house.json: ")
    assert "\n" not in str(problem)


@pytest.mark.parametrize(("key", "hint"), [("models", "models is relative"), ("textures", "Textures is there")])
def test_folders_that_are_missing_are_refused(tmp_path, key, hint):
    source = house(**ONE).write(tmp_path)
    os.rename(tmp_path / key, tmp_path / ("Textures" if key == "textures" else "elsewhere"))
    with pytest.raises(UserError, match=f"expected the folder of the {key} that the spec names.*{hint}"):
        load_scene(source, tmp_path)
