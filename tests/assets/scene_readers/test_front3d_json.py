"""The JSON of 3D-FRONT scenes: what is taken of it, and damaged and hostile bytes."""

import json
import tracemalloc

import numpy as np
import pytest

from dataset_builder.assets.scene_file import load_scene
from dataset_builder.assets.scene_readers.front3d_json import read_front3d
from dataset_builder.errors import UserError
from dataset_builder.seeding import rng
from dataset_builder.spec.front3d_references import ARRAYS, front3d_document
from tests.front3d_files import house

ONE = {"rooms": ("Kitchen-44",), "models": ("stool",)}
JUNK = (None, True, -1, 0, 1e300, float("nan"), float("-inf"), 10**400, "", "x", "1", "../..", "\0\ud800\x1b[2J", [],
        {}, [[]], [None] * 3, ["1", None, {}], {"uid": 1}, [{"uid": "0/model"}], "0/model", "0/mesh")
"""What stands in for any value of a scene."""


def test_all_of_a_scene_is_taken(tmp_path):
    made = house()
    made.document["extension"]["snapshots"] = [{}, {}]
    made.write(tmp_path)
    scene = read_front3d(tmp_path / "house.json")
    assert (scene.uid, scene.version, scene.views, scene.faults) == ("aaaa-house", "2.0", 2, ())
    assert [room.kind for room in scene.rooms] == ["LivingDiningRoom", "Bedroom", "Kitchen"]
    assert sum(len(room.children) for room in scene.rooms) == len(made.document["mesh"]) + 13
    assert len(scene.meshes) == len(made.document["mesh"])
    assert len(scene.furniture) == 12
    assert len(scene.doors) == 3
    mesh, entry = scene.meshes["0/mesh"], made.document["mesh"][0]
    assert mesh.positions.ravel().tolist() == entry["xyz"]
    assert mesh.uvs is not None
    assert mesh.uvs.ravel().tolist() == entry["uv"]
    assert mesh.faces.ravel().tolist() == entry["faces"]
    assert scene.materials["blue"].color == (90 / 255, 120 / 255, 160 / 255, 1)


@pytest.mark.parametrize("most", [None, 20_000])
def test_json_cut_at_every_kilobyte_is_refused_in_one_line(tmp_path, most):
    """The first 20 kB at every 97th byte, too."""
    made = house()
    made.write(tmp_path)
    data = (tmp_path / "house.json").read_bytes()
    path = tmp_path / "cut.json"
    for end in range(0, len(data) - 1 if most is None else most, 1024 if most is None else 97):
        path.write_bytes(data[:end])
        with pytest.raises(UserError) as raised:
            read_front3d(path)
        (problem,) = raised.value.problems
        assert "the file ends early" in str(problem)
        assert str(problem).startswith(f"{path}: expected a readable scene of 3D-FRONT, got: line 1, column ")


def nodes(value, found):
    """(container, key) of every value of a document."""
    for key, child in value.items() if isinstance(value, dict) else enumerate(value):
        found.append((value, key))
        if isinstance(child, dict | list):
            nodes(child, found)
    return found


def test_values_of_other_kinds_are_lived_with(tmp_path):
    """A few values of a scene replaced by junk: it is read with faults, or refused; what stands is finite."""
    generator = rng(0, "front3d", "junk")
    refused = 0
    for _ in range(25):
        made = house(**ONE)
        places = nodes(made.document, [])
        # Rather keys than numbers of long lists
        keys = [place for place in places if isinstance(place[1], str)]
        for _ in range(generator.integers(1, 6)):
            among = keys if generator.random() < 0.8 else places
            container, key = among[generator.integers(len(among))]
            container[key] = JUNK[generator.integers(len(JUNK))]
        refused += not survives(made, tmp_path)
    assert refused < 15


def survives(made, folder):
    """Whether a house is read; what is read is finite, and the rest is refused."""
    try:
        model = load_scene(made.write(folder), folder, max_texture=16)
    except UserError as error:
        assert len(str(error).splitlines()) == 1
        return False
    for thing in model.things:
        assert np.isfinite(thing.world).all()
        assert np.isfinite(thing.asset.mesh.uvs).all()
        assert len(thing.asset.mesh.faces)
        assert thing.name.isprintable()
    assert all(text.isprintable() for text in (*model.faults, *model.left_out, model.contains))
    json.dumps([model.faults, model.left_out, [thing.name for thing in model.things]]).encode()
    return True


def test_bytes_that_are_changed_are_read_or_refused(tmp_path):
    generator = rng(0, "front3d", "bytes")
    house(**ONE).write(tmp_path)
    data = (tmp_path / "house.json").read_bytes()
    path = tmp_path / "changed.json"
    for _ in range(200):
        changed = bytearray(data)
        for _ in range(generator.integers(1, 8)):
            changed[generator.integers(len(changed))] = generator.integers(256)
        path.write_bytes(changed)
        try:
            read_front3d(path)
        except UserError as error:
            assert len(str(error).splitlines()) == 1


def test_large_lists_take_bounded_memory(tmp_path):
    """Lists of numbers become arrays one by one: a file of 40 equal meshes takes less than five times its size, itself
    as bytes and as text included, where Python's numbers alone would take that."""
    mesh = {"uid": "m", "xyz": [0.1 + n for n in range(3_000)], "uv": [0.5] * 2_000, "faces": list(range(999))}
    text = json.dumps({"scene": {}, "mesh": [{**mesh, "uid": str(n)} for n in range(40)]})
    (tmp_path / "large.json").write_text(text)
    tracemalloc.start()
    try:
        scene = read_front3d(tmp_path / "large.json")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert len(scene.meshes) == 40
    assert peak < 5 * len(text)


def test_lists_can_be_left_unread(tmp_path):
    made = house(**ONE)
    made.mesh("Floor")["uv"] = ["0.5", None, float("nan"), 1e-3]
    made.document["note"] = 'a text with \\"xyz\\": [1, 2] in it'
    made.write(tmp_path)
    document = front3d_document(tmp_path / "house.json", without=ARRAYS)
    assert all(mesh[key] == [] for mesh in document["mesh"] for key in ARRAYS)
    whole = front3d_document(tmp_path / "house.json")
    assert document["note"] == whole["note"] == made.document["note"]
    assert document["scene"] == whole["scene"]
