"""What is wrong with scene files is told before anything is planned, with the line of the spec."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.scene_model import SceneModel, SceneThing
from dataset_builder.errors import PlanError, UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import meshes_named, probe, read_meshes
from dataset_builder.planning.scene import scene_models
from dataset_builder.planning.scene.recent import Recent, bytes_of
from dataset_builder.planning.scene.sources import object_sources
from dataset_builder.spec.load import load_dataset
from tests.gltf_scenes import DATASET, SCENE, SPEC, at, thing, write_dataset


def refused(path: Path) -> list[str]:
    with pytest.raises(PlanError) as caught:
        read_meshes(Planner(load_dataset(path)))
    return str(caught.value).replace(f"{path.parent}/", "").split("\n")


@pytest.fixture
def changed(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[SceneThing], SceneThing]], None]:
    """Has the reader give things that are changed."""
    load_scene = scene_models.load_scene

    def change(edit: Callable[[SceneThing], SceneThing]) -> None:
        def load(*args: object) -> SceneModel:
            model = load_scene(*args)  # type: ignore[arg-type]
            return replace(model, things=tuple(map(edit, model.things)))
        monkeypatch.setattr(scene_models, "load_scene", load)

    return change


def test_a_scene_that_cannot_be_read_is_told_of_with_the_line_that_names_it(tmp_path: Path) -> None:
    path = write_dataset(tmp_path)
    text = (tmp_path / "stage.gltf").read_text()
    (tmp_path / "stage.gltf").write_text(text.replace('"POSITION": 0', '"POSITION": 77'))
    said = refused(path)
    assert len(said) == 1 and said[0].startswith("scene.yaml:2: file.path: stage.gltf: ")
    planner = Planner(load_dataset(path))
    with pytest.raises(PlanError, match=r"scene\.yaml:2: file\.path"), meshes_named(planner):
        planner.example(planner.examples[0])


def test_parts_that_name_nothing_are_told_of_with_their_line(tmp_path: Path) -> None:
    assert refused(write_dataset(tmp_path, scene=SPEC + "  parts:\n    floor: [Floor, Flor]\n")) == [
        "scene.yaml:5: file.parts.floor[1]: expected the name of a thing in stage.gltf, got 'Flor' (nearest known "
        "thing: Floor)"]


def test_the_path_of_a_name_is_proposed(tmp_path: Path) -> None:
    """USD and glTF name things by their paths, people by what they are called."""
    things = [{**each, "name": f"World/Room/{each['name']}"} for each in SCENE]
    assert refused(write_dataset(tmp_path, things, scene=SPEC + "  leave_out: [Tabel]\n")) == [
        "scene.yaml:4: file.leave_out[0]: expected the name of a thing in stage.gltf, got 'Tabel' (nearest known "
        "thing: World/Room/Table)"]


def test_lights_and_cameras_that_a_scene_has_not_are_told_of_with_their_lines(tmp_path: Path) -> None:
    assert refused(write_dataset(tmp_path, scene=SPEC + "  cameras: own\n  lights: {use: kept}\n")) == [
        "scene.yaml:5: file.lights.use: expected a scene with lights, got none in stage.gltf (write `use: replaced`)",
        "scene.yaml:4: file.cameras: expected a scene with cameras, got none in stage.gltf (write `cameras: random`)"]
    read_meshes(Planner(load_dataset(write_dataset(tmp_path, scene=SPEC + "  lights: {use: added}\n"))))


def test_a_scene_in_another_unit_is_told_of_with_its_scale(tmp_path: Path) -> None:
    said = ("scene.yaml: file.scale: expected things of usual sizes, got Chair_01, of kind chair, of 90 m, and 1 of 1 "
            "others as odd (write `scale: 1`)")
    [got] = refused(write_dataset(tmp_path, scene=SPEC + "  scale: 100\n"))
    assert got == said.replace("scene.yaml:", "scene.yaml:4:", 1)
    # One thing alone may have a misleading name
    huge = thing("Sofa", at(0, -1.5, 0, (60, 0.4, 0.4)))
    (tmp_path / "one").mkdir()
    read_meshes(Planner(load_dataset(write_dataset(tmp_path / "one", [*SCENE, huge]))))


def test_centimetres_taken_as_metres_are_told_of(tmp_path: Path) -> None:
    big = [{**each, "world": np.diag([100, 100, 100, 1]) @ each["world"]} for each in SCENE]
    [got] = refused(write_dataset(tmp_path, big))
    assert got.startswith("scene.yaml:") and got.endswith("(write `scale: 0.01`; the file is probably in centimetres)")


def test_a_target_without_faces_is_refused(tmp_path: Path,
                                           changed: Callable[[Callable[[SceneThing], SceneThing]], None]) -> None:
    empty = TriangleMesh(positions=np.zeros((0, 3)), faces=np.zeros((0, 3), int), uvs=np.zeros((0, 3, 2)),
                         material=np.zeros(0, int))
    changed(lambda thing: thing if thing.name != "Table" else replace(thing, asset=replace(thing.asset, mesh=empty)))
    path = write_dataset(tmp_path, dataset=DATASET.replace('{name: "*"}, count: 2', "{name: Table}, count: 1"))
    assert refused(path) == ["dataset.yaml:10: splits[0].objects.things: expected 1 thing with name 'Table' in "
                             "stage.gltf, got 0 of 5 (Table has no faces)"]


def test_licences_of_things_count(tmp_path: Path,
                                  changed: Callable[[Callable[[SceneThing], SceneThing]], None]) -> None:
    changed(lambda thing: replace(thing, licence="CC-BY-NC-4.0") if thing.name in ("Table", "Floor") else thing)
    path = write_dataset(tmp_path)
    assert refused(path) == [
        "dataset.yaml:1: licence: expected one that the things of its scenes allow, got CC-BY-4.0: CC-BY-NC-4.0 (Floor "
        "of stage.gltf) asks for no commercial use (change it, or take the thing away with `leave_out`)"]
    (tmp_path / "dataset.yaml").write_text(DATASET + "licence: CC-BY-NC-4.0\n")
    planner = Planner(load_dataset(path))
    probe(planner)
    parts = object_sources(planner.loaded, planner.contents)
    assert [(part.source, part.licence, [name[:-3] for name in part.objects]) for part in parts] == [
        ("stage.gltf", "CC-BY-4.0", ["train-scene00-chair"]), ("stage.gltf", "CC-BY-NC-4.0", ["train-scene00-table"])]
    chair = next(plan for plan in map(planner.example, planner.examples) if plan.target.object.thing == "Chair_01")
    assert {(each.name, each.instance, each.licence) for each in chair.room.scene.things} == {
        ("Table", 3, "CC-BY-NC-4.0"), ("Floor", 2, "CC-BY-NC-4.0")}


def test_one_example_reads_its_own_scene_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    second = ("  - name: test\n    objects: {things: {}, count: 1}\n    scenes: {count: 1, from: [other.yaml]}\n")
    path = write_dataset(tmp_path, dataset=DATASET + second, other=SPEC.replace("stage.gltf", "other.glb"))
    (tmp_path / "other.glb").write_bytes((tmp_path / "stage.gltf").read_bytes())
    reads = []
    load_scene = scene_models.load_scene
    monkeypatch.setattr(scene_models, "load_scene", lambda source, *rest: reads.append(source.source)
                        or load_scene(source, *rest))
    with pytest.raises(UserError):
        load_dataset(path)  # one digest, two splits
    (tmp_path / "other.gltf").write_text((tmp_path / "stage.gltf").read_text() + "\n")
    (tmp_path / "other.yaml").write_text(SPEC.replace("stage.gltf", "other.gltf"))
    planner = Planner(load_dataset(path))
    planner.example(planner.examples[0])
    assert reads == ["stage.gltf"]
    assert any("got the same content" in line for line in refused(path))
    assert set(reads) == {"stage.gltf", "other.gltf"}


def test_what_is_kept_is_bounded_by_number_and_bytes() -> None:
    made = []
    recent = Recent[int](3, 100, lambda value: value)

    def get(value: int) -> int:
        return recent.get(value, lambda: made.append(value) or value)  # type: ignore[func-returns-value]

    assert [get(value) for value in (1, 2, 3, 1, 4, 1, 3)] == [1, 2, 3, 1, 4, 1, 3]
    assert made == [1, 2, 3, 4]
    assert [get(value) for value in (99, 1, 500, 500, 99)] == [99, 1, 500, 500, 99]
    assert made == [1, 2, 3, 4, 99, 1, 500, 99]


def test_bytes_of_shared_arrays_count_once(tmp_path: Path) -> None:
    write_dataset(tmp_path)
    planner = Planner(load_dataset(tmp_path / "dataset.yaml"))
    model = scene_models.scene_model(planner.contents["train"].scenes[0].room, tmp_path)
    asset = model.things[0].asset
    arrays = (asset.mesh.positions, asset.mesh.faces, asset.mesh.uvs, asset.mesh.material)
    assert bytes_of([asset, asset]) == sum(each.nbytes for each in arrays)
