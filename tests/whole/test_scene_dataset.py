"""A dataset whose scene is a file, built: its two objects are targets in turn, and everything seen is told of."""

import json
import tarfile
from pathlib import Path

import pytest

from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import verify
from tests.gltf_scenes import CHAIR, DATASET, ROOM, TABLE, write_dataset, write_gltf
from tests.small_specs import run_build

TWO_SPLITS = DATASET + ("  - name: test\n    objects: {from: [stool.yaml], count: 1}\n"
                        "    scenes: {count: 1, from: [other.yaml]}\n")
OTHER = """\
file:
  path: other.gltf
  licence: CC-BY-SA-4.0
  slot: {category: chair}
furniture:
  - {object: stool.yaml, place: near}
"""
"""A scene whose chair gives way to a stool, with another stool beside it."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    write_gltf(folder / "other.gltf", [*ROOM, CHAIR, {**TABLE, "color": (0.1, 0.5, 0.2)}])
    run_build(write_dataset(folder, dataset=TWO_SPLITS, other=OTHER, stool="family: stool\n"), folder / "out")
    return folder / "out"


def labels(folder: Path) -> dict[str, dict]:  # type: ignore[type-arg]
    found = {}
    for shard in sorted((folder / "shards").iterdir()):
        with tarfile.open(shard) as archive:
            for member in archive.getmembers():
                if member.name.endswith(".json"):
                    stream = archive.extractfile(member)
                    assert stream is not None
                    found[member.name] = json.loads(stream.read())
    return found


def test_each_object_is_a_target_and_the_other_stands_there(built: Path) -> None:
    made = {name: label for name, label in labels(built).items() if label["split"] == "train"}
    assert len(made) == 2
    for label in made.values():
        plan, layers = label["plan"], label["layers"]
        target, others = plan["target"]["object"], plan["room"]["scene"]["things"]
        assert plan["room"]["kind"] == "file" and plan["room"]["scene"]["hidden"] == [target["thing"]]
        assert {target["thing"], *(each["name"] for each in others)} == {"Chair_01", "Table"}
        assert {target["licence"], *(each["licence"] for each in others)} == {"CC-BY-4.0"}
        assert layers["instance"]["max"] >= 1 and layers["mask"]["mean"] > 0.02 and layers["s_prime"]["mean"] > 0
        said = {decision["choice"]: decision["reason"] for decision in plan["effects"]["decisions"]
                if decision["effect"] == "scene file"}
        assert said["contains"].startswith("5 things") and said["taken away"] == target["thing"]


def test_a_target_takes_a_slot_and_furniture_is_numbered_after_things(built: Path) -> None:
    plan = next(label["plan"] for label in labels(built).values() if label["split"] == "test")
    assert plan["target"]["object"]["kind"] == "procedural"
    assert plan["room"]["scene"]["hidden"] == ["Chair_01"]
    assert [(each["name"], each["instance"]) for each in plan["room"]["scene"]["things"]] == [("Table", 3)]
    assert [piece["instance"] for piece in plan["furniture"]] in ([4], [])
    assert plan["furniture"] or any("left out" in note for note in plan["notes"])


def test_licences_of_a_scene_stand_in_manifest_card_and_croissant(built: Path) -> None:
    manifest = load_manifest(built)
    assert manifest.licence == "CC-BY-SA-4.0"
    assert [(part.kind, part.source, part.licence, len(part.objects)) for part in manifest.parts] == [
        ("procedural", "stool", "CC0-1.0", 2), ("thing", "other.gltf", "CC-BY-SA-4.0", 0),
        ("thing", "stage.gltf", "CC-BY-4.0", 2)]
    assert "| stage.gltf | scene file | CC-BY-4.0 | train-scene00-" in (built / "README.md").read_text()
    based = json.loads((built / "croissant.json").read_text())["isBasedOn"]
    assert [part["name"] for part in based] == ["stool", "other.gltf", "stage.gltf"]
    assert based[2]["license"] == "https://spdx.org/licenses/CC-BY-4.0.html"
    assert based[1]["description"] == "thing"


def test_the_dataset_verifies(built: Path) -> None:
    assert verify(built) == []


def test_a_scene_of_nothing_but_its_target_is_rendered(tmp_path: Path) -> None:
    """What is about the target is probed for light, too, and there nothing is."""
    one = DATASET.replace('{things: {name: "*"}, count: 2}', "{things: {}, count: 1}")
    spec = write_dataset(tmp_path, [CHAIR], one)
    run_build(spec, tmp_path / "out")
    assert load_manifest(tmp_path / "out").splits[0].examples == 1 and verify(tmp_path / "out") == []
