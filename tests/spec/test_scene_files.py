"""Scene files in specs: what they need, what is refused, and what changes a digest."""

import os
from pathlib import Path

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.scene_files import SceneFolders, scene_files
from tests.gltf_scenes import DATASET, SPEC, write_dataset

GLTF = '{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": "../shared/a.bin"}]}'


def refused(path: Path) -> list[str]:
    with pytest.raises(SpecError) as caught:
        load_dataset(path)
    return str(caught.value).replace(f"{path.parent}/", "").split("\n")


def test_the_files_of_a_scene_are_found_and_named_by_their_keys(tmp_path: Path) -> None:
    path = write_dataset(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "dataset.yaml").write_text(DATASET.replace("scene.yaml", "scenes/den.yaml"))
    scene = "file:\n  path: ../stage.gltf\n  licence: CC0-1.0\n  roots: [../scenes]\n"
    (tmp_path / "scenes/den.yaml").write_text(scene)
    loaded = load_dataset(path)
    file = loaded.scenes["scenes/den.yaml"].file
    assert file is not None and (file.path, file.roots) == ("stage.gltf", ("scenes",))
    assert loaded.content()["scene_files"] == {"scenes/den.yaml": loaded.scene_files["scenes/den.yaml"].content()}
    assert loaded.dataset.licence == "CC0-1.0"


def test_a_byte_of_a_scene_changes_the_digest_of_the_splits_that_have_it(tmp_path: Path) -> None:
    second = ("  - name: test\n    objects: {from: [stool.yaml], count: 1}\n"
              "    scenes: {count: 1, from: [other.yaml]}\n")
    path = write_dataset(tmp_path, dataset=DATASET + second, stool="family: stool\n", other="room: room.yaml\n",
                         room="width: 4\n")
    before = load_dataset(path)
    with (tmp_path / "stage.gltf").open("a") as file:
        file.write("\n")
    after = load_dataset(path)
    train, test = before.dataset.splits
    assert before.spec_digest != after.spec_digest
    assert before.split_digest(train, 0) != after.split_digest(train, 0)
    assert before.split_digest(test, 0) == after.split_digest(test, 0)


def test_a_dataset_has_to_keep_what_its_scenes_ask(tmp_path: Path) -> None:
    assert load_dataset(write_dataset(tmp_path)).dataset.licence == "CC-BY-4.0"
    assert refused(write_dataset(tmp_path, dataset=DATASET + "licence: CC0-1.0\n")) == [
        "dataset.yaml:12: licence: expected one that its objects allow, got CC0-1.0: CC-BY-4.0 (scene.yaml) asks for "
        "attribution (leave the key out, and it follows from the objects)"]


@pytest.mark.parametrize(("spec", "problem"), [
    ("path: stge.gltf", "scene.yaml:2: file.path: expected a scene file, found none at 'stge.gltf' (nearest known "
                        "file: stage.gltf)"),
    ("path: stage.fbx", "scene.yaml:2: file.path: expected a scene file that ends in one of .glb .gltf"),
    ("path: stage.gltf\n  roots: [assets, asets]", "scene.yaml:4: file.roots[1]: expected a folder, found none at "
                                                    "'asets' (nearest known folder: assets)"),
    ("path: stage.gltf\n  models: assets", "scene.yaml:4: file.models: expected no `models` for a .gltf file, got "
                                           "'assets' (it is for .json)"),
    ("path: stage.gltf\n  variants: {/World: {look: red}}", "scene.yaml:4: file.variants: expected no `variants` for a "
                                                            ".gltf file"),
    ("path: empty.usda\n  up: z", "scene.yaml:4: file.up: expected no `up` for a .usda file, got 'z'"),
])
def test_what_cannot_be_meant_is_refused_with_its_line(tmp_path: Path, spec: str, problem: str) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "empty.usda").write_text("#usda 1.0\n")
    # The licence is written between
    first, _, rest = spec.partition("\n")
    found = refused(write_dataset(tmp_path, scene=f"file:\n  {first}\n  licence: CC-BY-4.0\n{rest}\n"))
    assert len(found) == 1 and found[0].startswith(problem)


def test_a_scene_names_files_in_its_roots_only(tmp_path: Path) -> None:
    path = write_dataset(tmp_path, scene="file:\n  path: scene/a.gltf\n  licence: CC0-1.0\n")
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene/a.gltf").write_text(GLTF)
    assert "expected a file in the folder of the mesh or below it, got '../shared/a.bin'" in refused(path)[0]
    (tmp_path / "shared").mkdir()
    rooted = "file:\n  path: scene/a.gltf\n  licence: CC0-1.0\n  roots: [shared]\n"
    (tmp_path / "scene.yaml").write_text(rooted)
    assert refused(path) == ["scene.yaml:2: file.path: expected the files that a.gltf names, found no a.bin in "
                             "shared (put it there, or export the scene again with its files)"]
    (tmp_path / "shared/a.bin").write_text("abc")
    assert set(load_dataset(path).scene_files["scene.yaml"].companions) == {"roots[0]/a.bin"}
    (tmp_path / "shared/a.bin").unlink()
    os.symlink(tmp_path / "dataset.yaml", tmp_path / "shared/a.bin")
    assert "or in one of the roots" in refused(path)[0]


def test_roots_hold_where_the_spec_is_named_from_its_own_folder(tmp_path: Path,
                                                                monkeypatch: pytest.MonkeyPatch) -> None:
    write_dataset(tmp_path / "in", scene="file:\n  path: a.gltf\n  licence: CC0-1.0\n  roots: [../shared/deep]\n")
    (tmp_path / "in/a.gltf").write_text(GLTF.replace("shared", "shared/deep"))
    (tmp_path / "shared/deep").mkdir(parents=True)
    (tmp_path / "shared/deep/a.bin").write_text("abc")
    monkeypatch.chdir(tmp_path / "in")
    assert set(load_dataset(Path("dataset.yaml")).scene_files["scene.yaml"].companions) == {"roots[0]/a.bin"}


def test_the_digest_stays_where_models_move(tmp_path: Path) -> None:
    def digest(folder: Path) -> str:
        for part in ("scene", "shared"):
            (folder / part).mkdir(parents=True)
        (folder / "scene/a.gltf").write_text(GLTF)
        (folder / "shared/a.bin").write_text("abc")
        return scene_files(SceneFolders.of(folder, "scene/a.gltf", ["shared"], "", "")).digest

    assert digest(tmp_path / "here") == digest(tmp_path / "there")


def test_things_of_rooms_in_code_are_refused(tmp_path: Path) -> None:
    path = write_dataset(tmp_path, scene="room: room.yaml\n", room="width: 4\n")
    assert refused(path) == ["dataset.yaml:11: splits[0].scenes.from[0]: expected a scene from a file, since "
                             "`objects.things` takes its things, got a room: 'scene.yaml' (name objects with "
                             "`objects.from`, or give the scene a `file`)"]


def test_a_scene_gives_its_things_once_and_to_one_split(tmp_path: Path) -> None:
    twice = DATASET.replace("count: 1, from", "count: 2, from")
    second = DATASET[DATASET.index("  - name"):].replace("train", "test").replace("scene.yaml", "again.yaml")
    assert refused(write_dataset(tmp_path, dataset=twice + second, again=SPEC)) == [
        "dataset.yaml:11: splits[0].scenes.count: expected <= 1, since the things of a scene file are the same each "
        "time, got 2",
        "dataset.yaml:14: splits[1].scenes.from[0]: expected scenes that no other split has, got a scene file of split "
        "train (give it others, or write `allow_shared: [scenes]` in one of both splits)"]


def test_an_orbit_places_cameras_where_a_scene_has_none_of_its_own(tmp_path: Path) -> None:
    orbit = DATASET + "    views: 4\n    camera: {path: {kind: orbit}}\n"
    assert load_dataset(write_dataset(tmp_path, dataset=orbit)).dataset.camera_of("train").path is not None
    assert refused(write_dataset(tmp_path, dataset=orbit, scene=SPEC + "  cameras: own\n")) == [
        "dataset.yaml:11: splits[0].scenes.from[0]: expected cameras that a path places, got a scene that has its "
        "own: 'scene.yaml' (write `cameras: random` in the scene, or leave `camera.path` out)"]
