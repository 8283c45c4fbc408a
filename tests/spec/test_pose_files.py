"""Files with poses are found, counted in digests, taken along, and missed with their line."""

import json
from pathlib import Path

import pytest

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import SpecError
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.spec_files import SpecFiles

POSES = json.dumps({"frames": []})
MODEL = {"film/sparse/0/cameras.txt": "# none\n", "film/sparse/0/images.txt": "# none\n"}


def filmed(tiny, camera: str, **files: str) -> Path:
    return tiny(**{"tiny.yaml": tiny().read_text() + f"camera: {{path: {camera}}}\n", **files})


def test_files_are_found_and_change_the_digest(tiny) -> None:
    path = filmed(tiny, "{kind: poses, file: film/a.json}", **{"film/a.json": POSES})
    loaded = load_dataset(path)
    assert loaded.pose_files == {"film/a.json": sha256_bytes(POSES.encode())}
    assert "film/a.json" in SpecFiles.of(loaded).files
    (path.parent / "film/a.json").write_text(POSES + "\n")
    again = load_dataset(path)
    assert again.spec_digest != loaded.spec_digest
    split = loaded.dataset.splits[0]
    assert again.split_digest(split, 0) != loaded.split_digest(split, 0)


def test_both_files_of_a_model_count(tiny) -> None:
    path = filmed(tiny, "{kind: poses, file: film}", **MODEL)
    assert [*load_dataset(path).pose_files] == ["film/sparse/0/cameras.txt", "film/sparse/0/images.txt"]
    (path.parent / "film/sparse/0/images.txt").unlink()
    with pytest.raises(SpecError, match=r"expected a readable images\.txt, got: No such file"):
        load_dataset(path)
    (path.parent / "film/transforms.json").write_text(POSES)
    assert [*load_dataset(path).pose_files] == ["film/transforms.json"]


def test_a_missing_file_is_told_with_its_line(in_folder) -> None:
    text = in_folder().read_text().replace("  - name: test\n", "  - name: test\n    camera:\n      path:\n"
                                           "        kind: poses\n        file: film/b.json\n")
    with pytest.raises(SpecError) as caught:
        load_dataset(in_folder(**{"tiny.yaml": text, "film/a.json": POSES}))
    assert [str(problem) for problem in caught.value.problems] == [
        "tiny.yaml:12: splits[1].camera.path.file: expected a .json file, or a folder with transforms.json or COLMAP's "
        "cameras and images, found none at 'film/b.json' (nearest known file: a.json)"]


@pytest.mark.parametrize(("camera", "message"), [
    ("{kind: orbit, elevatoin: [0, 9]}",
     "camera.path.elevatoin: expected no such key, got [0, 9] (nearest known key: elevation)"),
    ("{kind: turntabel}",
     "one of orbit, turntable, spline, poses, got {kind: 'turntabel'} (nearest known kind: turntable)"),
    ("{kind: poses, file: film, up: [0, 0, 0]}", "camera.path.up: expected a direction, got [0, 0, 0]"),
    ("{kind: poses, file: film, up: [0, 0]}", "camera.path.up[2]: expected a value, the key is missing"),
    ("{kind: turntable, turns: 0}", "camera.path.turns: expected in [0.01, 100], got 0"),
    ("{kind: spline, keys: [{azimuth: 0}, {azimuth: 9, elevation: 89}]}",
     "camera.path.keys[1].elevation: expected <= 85, got 89"),
    ("{kind: poses, file: film}, fov: 40", "camera.fov: expected no `fov` beside poses, whose file has it"),
])
def test_broken_rules(in_folder, camera: str, message: str) -> None:
    text = in_folder().read_text() + f"camera: {{path: {camera}}}\n"
    with pytest.raises(SpecError) as caught:
        load_dataset(in_folder(**{"tiny.yaml": text, **MODEL}))
    assert any(message in str(problem) for problem in caught.value.problems), caught.value.problems


def test_an_orbit_of_old_is_told_what_to_write(in_folder) -> None:
    text = in_folder().read_text() + "camera:\n  fov: 40\n  orbit: {elevation: [0, 90]}\n"
    with pytest.raises(SpecError) as caught:
        load_dataset(in_folder(**{"tiny.yaml": text}))
    assert [str(problem) for problem in caught.value.problems] == [
        "tiny.yaml:13: camera.orbit: expected no `orbit`, which is a kind of `path` now: write `path: {kind: orbit, "
        "elevation: [0, 90]}`"]
