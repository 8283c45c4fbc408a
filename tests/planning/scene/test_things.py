"""Which things of a scene file are meant, and how they become targets."""

from pathlib import Path

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import read_meshes
from dataset_builder.planning.scene.arrangement import geometry_of
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.scene_models import scene_model
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import (
    CHAIR,
    DATASET,
    ROOM,
    SCENE,
    SPEC,
    TABLE,
    WEDGE,
    WEDGE_FACES,
    at,
    thing,
    write_dataset,
    write_gltf,
)

MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])
SHEAR = np.array([[1.0, 0.3, 0.2, 0], [0, 1, 0, 0], [0, 0.1, 1, 0], [0, 0, 0, 1]])


def plans(path: Path) -> list[ExamplePlan]:
    planner = Planner(load_dataset(path))
    return [planner.example(ref) for ref in planner.examples]


def refused(path: Path) -> str:
    with pytest.raises(PlanError) as caught:
        read_meshes(Planner(load_dataset(path)))
    return str(caught.value).replace(f"{path.parent}/", "")


def things(query: str, count: int = 1) -> str:
    return DATASET.replace('things: {name: "*"}, count: 2', f"things: {query}, count: {count}")


def test_every_object_of_a_scene_is_a_target_once_and_the_others_are_around(tmp_path: Path) -> None:
    made = plans(write_dataset(tmp_path))
    assert {plan.target.object.thing for plan in made} == {"Chair_01", "Table"}
    for plan in made:
        other = {"Chair_01": "Table", "Table": "Chair_01"}[plan.target.object.thing]
        assert plan.room.scene.hidden == (plan.target.object.thing,)
        there = [(each.name, each.instance, each.licence) for each in plan.room.scene.things]
        assert there == [(other, 3, "CC-BY-4.0")]
        assert plan.target.instance == 1 and plan.target.object.licence == "CC-BY-4.0"
    assert {plan.target.object.name.rstrip("01") for plan in made} == {"train-scene00-chair-", "train-scene00-table-"}
    assert (made[0].room.width, made[0].room.depth, made[0].room.ceiling) == (pytest.approx(4.1), pytest.approx(4.1),
                                                                             False)


@pytest.mark.parametrize("world", [
    at(1, 0.5, 0.2, (0.5, 0.7, 0.9), 40), at(0.3, -0.2, 0, (0.5,) * 3) @ MIRROR, at(0, 0, 0, (0.6,) * 3, -100) @ SHEAR,
    at(0, 0, 1, (0.6, 0.4, -0.5), 170) @ SHEAR @ MIRROR], ids=["turned", "mirrored", "sheared", "all"])
def test_a_target_lies_where_its_scene_has_it(tmp_path: Path, world: np.ndarray) -> None:
    """Corner by corner, and with an outside that is outside."""
    path = write_dataset(tmp_path, [*ROOM, thing("Chair", world, positions=WEDGE, faces=WEDGE_FACES)],
                         things("{name: Chair}"))
    target = plans(path)[0].target
    positions, faces, instance = geometry_of(target, tmp_path)
    expected = WEDGE @ world[:3, :3].T + world[:3, 3]
    assert instance == 1
    assert sorted(map(tuple, positions.round(5) + 0.0)) == sorted(map(tuple, expected.round(5) + 0.0))
    assert np.linalg.det(positions[faces] - positions.mean(axis=0)).sum() / 6 == pytest.approx(
        abs(np.linalg.det(world[:3, :3])) / 6, rel=1e-5)
    own = asset_of(target.object, tmp_path).mesh
    assert own.bounds.mean(axis=0)[:2] == pytest.approx([0, 0], abs=1e-9)
    assert 0 <= own.bounds[0, 2] <= 1.1e-4


def test_queries_go_by_name_category_and_size(tmp_path: Path) -> None:
    for query, name in (("{name: 'Ch*'}", "Chair_01"), ("{category: table}", "Table"),
                        ("{size: [0.95, 1.2]}", "Table"), ("{size: [0.1, 0.92]}", "Chair_01")):
        assert plans(write_dataset(tmp_path, dataset=things(query)))[0].target.object.thing == name


def test_a_part_of_the_building_is_a_target_only_by_its_whole_name(tmp_path: Path) -> None:
    planner = Planner(load_dataset(write_dataset(tmp_path, dataset=things("{name: Wall_left}"))))
    arrangement = planner.arrangement(planner.examples[0].view.pair)
    assert arrangement.target.object.thing == "Wall_left" and arrangement.room.scene.hidden == ("Wall_left",)
    assert refused(write_dataset(tmp_path, dataset=things("{name: 'Wall_l*'}"))) == (
        "dataset.yaml:10: splits[0].objects.things: expected 1 thing with name 'Wall_l*' in stage.gltf, got 0 of 5 "
        "(Wall_left is part of the walls: give its whole name if it is meant, or say under `parts` that it is an "
        "object)")


@pytest.mark.parametrize(("query", "count", "rule"), [
    ("{name: Chiar_01}", 1, "expected 1 thing with name 'Chiar_01' in stage.gltf, got 0 of 5 (nearest known name: "
                            "Chair_01)"),
    ("{name: '*'}", 3, "expected 3 things in stage.gltf, got 2 of 5 (lower the count, or ask for more with *)"),
    ("{category: tabel}", 1, "expected 1 thing with category 'tabel' in stage.gltf, got 0 of 5 (nearest known "
                             "category: table)"),
    ("{name: Table, size: [1.1, 2]}", 1, "expected 1 thing with name 'Table', size [1.1, 2.0] in stage.gltf, got 0 of "
                                         "5 (the longest sides of those with that name are 1.02 to 1.02 m)"),
])
def test_too_few_things_are_refused_with_what_there_is(tmp_path: Path, query: str, count: int, rule: str) -> None:
    said = refused(write_dataset(tmp_path, dataset=things(query, count)))
    assert said == "dataset.yaml:10: splits[0].objects.things: " + rule


def test_names_that_fit_nothing_are_refused_together_with_their_lines(tmp_path: Path) -> None:
    scene = SPEC + ("  leave_out: [Table, Chiar_01]\n  slot: {name: Stool}\n"
                    "  lights:\n    use: kept\n    dim: {Lamp: 0.5}\n")
    said = refused(write_dataset(tmp_path, scene=scene, dataset=DATASET.replace(
        'things: {name: "*"}, count: 2', "from: [stool.yaml], count: 1"), stool="family: stool\n"))
    assert said.split("\n") == [
        "scene.yaml:4: file.leave_out[1]: expected the name of a thing in stage.gltf, got 'Chiar_01' (nearest known "
        "thing: Chair_01)",
        "scene.yaml:8: file.lights.dim.Lamp: expected the name of a light in stage.gltf, got 'Lamp' (it has no lights)",
        "scene.yaml:7: file.lights.use: expected a scene with lights, got none in stage.gltf (write `use: replaced`)",
        "scene.yaml:5: file.slot: expected 1 thing with name 'Stool' in stage.gltf, got 0 of 5 (known names: Floor, "
        "Wall_back, Wall_left, Chair_01, Table)"]


def test_what_is_left_out_is_no_target_and_not_there(tmp_path: Path) -> None:
    path = write_dataset(tmp_path, dataset=things("{}"), scene=SPEC + "  leave_out: ['Ta*', Wall_left]\n")
    plan = plans(path)[0]
    assert plan.room.scene.hidden == ("Wall_left", "Chair_01", "Table") and plan.room.scene.things == ()
    assert "`leave_out` takes Table away" in refused(write_dataset(
        tmp_path, dataset=things("{name: Table}"), scene=SPEC + "  leave_out: ['Ta*']\n"))


def test_splits_may_share_no_thing_and_no_scene(tmp_path: Path) -> None:
    second = ("  - name: test\n    objects: {things: {name: Chair_01}, count: 1}\n"
              "    scenes: {count: 1, from: [other.yaml]}\n")
    path = write_dataset(tmp_path, dataset=things("{name: Chair_01}") + second,
                         other=SPEC.replace("stage.gltf", "other.gltf"))
    write_gltf(tmp_path / "other.gltf", [*ROOM, CHAIR])
    assert "expected test-scene00-chair-00 to differ from train-scene00-chair-00, got the same content" in refused(path)
    write_gltf(tmp_path / "other.gltf", [*ROOM, {**CHAIR, "color": (0.1, 0.9, 0.1)}])
    read_meshes(Planner(load_dataset(path)))


def test_a_target_in_a_slot_stands_where_the_thing_stood(tmp_path: Path) -> None:
    objects = DATASET.replace('things: {name: "*"}, count: 2', "from: [stool.yaml], count: 1")
    path = write_dataset(tmp_path, dataset=objects, scene=SPEC + "  slot: {category: chair}\n", stool="family: stool\n")
    plan = plans(path)[0]
    assert plan.room.scene.hidden == ("Chair_01",) and [each.name for each in plan.room.scene.things] == ["Table"]
    assert plan.target.object.kind == "procedural" and plan.target.yaw == pytest.approx(30)
    low, high = asset_of(plan.target.object, tmp_path).mesh.bounds
    assert low + high == pytest.approx([0, 0, high[2]], abs=1e-6)
    assert plan.target.position == pytest.approx((-0.7, 0.2, 0))
    assert "the target takes the place of Chair_01" in plan.notes


def test_a_target_that_its_slot_is_too_small_for_is_told_of(tmp_path: Path) -> None:
    objects = DATASET.replace('things: {name: "*"}, count: 2', "from: [sofa.yaml], count: 1")
    path = write_dataset(tmp_path, dataset=objects, scene=SPEC + "  slot: {category: chair}\n", sofa="family: sofa\n")
    assert ("the target takes the place of Chair_01, but does not fit the free space there: its box meets "
            "Table") in plans(path)[0].notes


def test_a_target_that_runs_into_a_wall_in_its_slot_is_told_of(tmp_path: Path) -> None:
    objects = DATASET.replace('things: {name: "*"}, count: 2', "from: [sofa.yaml], count: 1")
    chair = {**CHAIR, "world": at(-1.7, -1.0, 0, (0.5, 0.5, 0.9))}
    path = write_dataset(tmp_path, [*ROOM, chair], objects, scene=SPEC + "  slot: {name: Chair_01}\n",
                         sofa="family: sofa\nparams: {width: 2.0}\n")
    planner = Planner(load_dataset(path))
    assert ("the target takes the place of Chair_01, but does not fit the free space there: its box meets the "
            "building") in planner.arrangement(planner.examples[0].view.pair).notes


def test_the_scene_is_read_once_however_many_views_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataset_builder.planning.scene import scene_models

    reads = []
    load_scene = scene_models.load_scene
    monkeypatch.setattr(scene_models, "load_scene", lambda *args: reads.append(args) or load_scene(*args))
    path = write_dataset(tmp_path, dataset=DATASET + "    views: 3\n    lights: 2\n")
    assert len(plans(path)) == 12
    assert len(reads) == 1


def test_a_scene_that_changed_after_loading_is_refused(tmp_path: Path) -> None:
    path = write_dataset(tmp_path)
    planner = Planner(load_dataset(path))
    write_dataset(tmp_path, [*SCENE, thing("Stool", at(0, 0))])
    with pytest.raises(PlanError, match="or a file that it names, changed after planning; plan again"):
        planner.example(planner.examples[0])


def test_equal_things_share_a_mesh(tmp_path: Path) -> None:
    path = write_dataset(tmp_path, [*ROOM, TABLE, {**TABLE, "name": "Table_2", "world": at(-0.7, 0.2, 0, (0.5,) * 3)}])
    room = plans(path)[0].room
    one, other = scene_model(room, tmp_path).things[-2:]
    assert one.asset is other.asset and one.content == other.content
