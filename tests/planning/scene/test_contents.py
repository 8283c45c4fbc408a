from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.shared_content import SharedContent
from dataset_builder.planning.scene.contents import contents
from dataset_builder.planning.scene.sources import shared_contents
from dataset_builder.spec.families import FAMILIES
from dataset_builder.spec.mesh_source import MeshSource
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.scene import ObjectSpec

Load = Callable[..., LoadedSpec]


def test_parameters_are_within_the_limits_of_their_family(load: Load) -> None:
    for split in contents(load()).values():
        for plan in (*split.objects, *(piece.object for scene in split.scenes for piece in scene.furniture)):
            family = FAMILIES[plan.source]
            assert [param.name for param in plan.params] == [param.name for param in family.params]
            for param, rule in zip(plan.params, family.params, strict=True):
                assert rule.low <= param.value <= rule.high
                assert not rule.integer or param.value == round(param.value)


def test_given_parameters_are_taken_and_cut_to_the_limits(load: Load) -> None:
    limit = FAMILIES["chair"].param("width").high
    spec = ObjectSpec(family="chair", params={"width": limit + 1, "depth": 0.45})
    plan = contents(load(objects={"chair.yaml": spec}))["train"].objects[0]
    drawn = {param.name: param.value for param in plan.params}
    assert drawn["width"] == limit and drawn["depth"] == 0.45


def test_a_parameter_that_is_given_moves_no_other(load: Load) -> None:
    before = contents(load())["train"].objects[0]
    spec = ObjectSpec(family="chair", params={"width": 0.45})
    after = contents(load(objects={"chair.yaml": spec}))["train"].objects[0]
    assert {p.name for p, q in zip(before.params, after.params, strict=True) if p != q} == {"width"}
    assert before.seed == after.seed


def test_more_objects_scenes_and_furniture_move_nothing(load: Load, dataset_data: dict[str, Any],
                                                        scene_data: dict[str, Any]) -> None:
    before = contents(load())
    dataset_data["splits"][0]["objects"]["count"] = 5
    dataset_data["splits"][0]["scenes"]["count"] = 4
    scene_data["furniture"].append({"object": "stool.yaml", "place": "floor", "count": 2})
    after = contents(load(dataset_data, scene_data))
    assert after["train"].objects[:3] == before["train"].objects
    assert after["eval"].objects == before["eval"].objects
    for old, new in zip(before["train"].scenes, after["train"].scenes, strict=False):
        assert new.room == old.room and new.furniture[:len(old.furniture)] == old.furniture
        assert len(new.furniture) == len(old.furniture) + 2


def test_names_are_unique(load: Load) -> None:
    names = [plan.name for split in contents(load()).values()
             for plan in (*split.objects, *(piece.object for scene in split.scenes for piece in scene.furniture))]
    assert len(set(names)) == len(names)
    assert "train-chair-00" in names


def _with_file(load: Load, dataset: dict[str, Any], keys: tuple[str, ...], sha: str = "ab" * 32) -> LoadedSpec:
    objects = {key: ObjectSpec(file="meshes/a.glb", category="lamp") for key in keys}
    meshes = {key: MeshSource(path=Path("a.glb"), sha256=sha, companions={}) for key in keys}
    return load(dataset, objects=objects, meshes=meshes)


def test_a_mesh_file_is_named_from_the_folder_of_the_dataset(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0]["objects"] = {"from": ["things/lamp.yaml"], "count": 1}
    plan = contents(_with_file(load, dataset_data, ("things/lamp.yaml",)))["train"].objects[0]
    assert (plan.kind, plan.source) == ("file", "things/meshes/a.glb")
    assert plan.name == "train-lamp-00" and plan.up == "y"


def test_a_mesh_file_is_known_by_all_that_belongs_to_it() -> None:
    digests = {MeshSource(path=Path(folder), sha256="ab" * 32, companions=companions).digest
               for folder in ("here", "there") for companions in ({}, {"a.png": "cd" * 32}, {"a.png": "ef" * 32})}
    assert len(digests) == 3


def test_the_plan_of_a_mesh_file_follows_its_textures(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0]["objects"] = {"from": ["lamp.yaml"], "count": 1}
    loaded = _with_file(load, dataset_data, ("lamp.yaml",))
    before = contents(loaded)["train"].objects[0]
    mesh = MeshSource(path=Path("a.glb"), sha256="ab" * 32, companions={"a.png": "cd" * 32})
    after = contents(replace(loaded, meshes={"lamp.yaml": mesh}))["train"].objects[0]
    assert before.source_sha256 != after.source_sha256 == mesh.digest


def test_one_mesh_file_in_two_splits_is_a_clash_that_is_named(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0]["objects"] = {"from": ["chair.yaml", "lamp.yaml"], "count": 2}
    dataset_data["splits"][1]["objects"] = {"from": ["copy.yaml"], "count": 1}
    with pytest.raises(PlanError, match="eval-lamp-00 to differ from train-lamp-01"):
        contents(_with_file(load, dataset_data, ("lamp.yaml", "copy.yaml")))


def test_a_mesh_file_in_two_splits_on_purpose_is_counted(load: Load, dataset_data: dict[str, Any]) -> None:
    """As one shape, though its two names and materials differ; nothing is said where nothing is allowed."""
    dataset_data["splits"][0]["objects"] = {"from": ["chair.yaml", "lamp.yaml"], "count": 2}
    dataset_data["splits"][1] |= {"objects": {"from": ["copy.yaml"], "count": 1}, "allow_shared": ["objects", "scenes"]}
    loaded = _with_file(load, dataset_data, ("lamp.yaml", "copy.yaml"))
    shared, = shared_contents(loaded, contents(loaded))
    assert shared == SharedContent(what="objects", splits=("train", "eval"), count=1, of=(2, 1))
    assert shared.sentence.startswith("splits train and eval share 1 object (train has 2, eval 1): figures on eval")
    assert shared_contents(load(), contents(load())) == ()


def test_one_mesh_file_twice_in_a_split_is_a_clash(load: Load, dataset_data: dict[str, Any]) -> None:
    dataset_data["splits"][0]["objects"] = {"from": ["lamp.yaml"], "count": 3}
    with pytest.raises(PlanError) as caught:
        contents(_with_file(load, dataset_data, ("lamp.yaml",)))
    assert len(caught.value.problems) == 2


def test_a_shape_without_freedom_cannot_be_in_two_splits(load: Load) -> None:
    fixed = {param.name: param.low for param in FAMILIES["chair"].params}
    with pytest.raises(PlanError, match="eval-chair-00 to differ from train-chair-00"):
        contents(load(objects={"chair.yaml": ObjectSpec(family="chair", params=fixed)}))


def test_room_numbers_are_drawn_apart(load: Load) -> None:
    room = {"width": {"uniform": [4, 8]}, "depth": {"uniform": [4, 8]}, "windows": {"uniform": [0.6, 2.4]}}
    first, second = (scene.room for scene in contents(load(room=room))["train"].scenes)
    assert first.width != second.width and first.width != first.depth
    assert first.windows in (1, 2) and first.height == 2.7
