"""Scenes from files that will not do are told on the command line: exit code 2, one line, nothing half written."""

import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.cli.main import main
from tests.assets.scene_readers.usd_stages import METRES, at, moved, prim
from tests.gltf_scenes import BOX, DATASET, FACES

Run = Callable[..., str]
CUBE = (f"point3f[] points = {[tuple(point) for point in BOX.tolist()]}\nint[] faceVertexCounts = {[3] * len(FACES)}\n"
        f'int[] faceVertexIndices = {FACES.ravel().tolist()}\nuniform token subdivisionScheme = "none"')
FLOOR_ONLY = DATASET.replace('{things: {name: "*"}, count: 2}', "{from: [stool.yaml], count: 1}")
KEPT = "  lights: {use: kept}\n"
NAMES = ("references", "payload")


def box(name: str, place: tuple[Any, ...], size: tuple[Any, ...]) -> str:
    """A box that stands on its place."""
    return prim("Mesh", name, CUBE, moved([("double3", "translate", place), ("double3", "scale", size)]))


def stage(*more: str, header: str = METRES, chair: str = box("Chair_01", (-0.7, 0.2, 0), (0.5, 0.5, 0.9)),
          where: str = "") -> str:
    """Floor, two walls, a chair and a table, and what else is given."""
    return header + prim("Xform", "World", where, box("Floor", (0, 0, -0.1), (4, 4, 0.1)),
                         box("Wall_back", (0, 2.05, 0), (4, 0.1, 2.5)), box("Wall_left", (-2.05, 0, 0), (0.1, 4, 2.5)),
                         chair, box("Table", (0.7, 0, 0), (0.9, 0.6, 0.7)), *more)


def said_by(header: str) -> str:
    return stage(header=f"#usda 1.0\n(\n    {header}\n)\n")


def named(file: str, how: str = "references") -> str:
    return stage(prim("Xform", "R", metadata=f"prepend {how} = @{file}@"))


def lamp(intensity: str) -> str:
    return stage(prim("RectLight", "Lamp", at(0, 0, 2.4), f"float inputs:intensity = {intensity}"))


def instances(levels: int) -> str:
    """10^levels boxes, by a few lines that instance each other."""
    classes = [f'class Xform "P{level}" {{\n' + "".join(
        prim("Xform", f"k{each}", metadata=f"instanceable = true; references = </P{level + 1}>")
        for each in range(10)) + "}\n" for level in range(levels)]
    return stage(prim("Xform", "I", metadata="instanceable = true; references = </P0>")) + "".join(classes) + (
        f'class Xform "P{levels}" {{\n{box("b", (0, 0, 0), (1, 1, 1))}}}\n')


def write(folder: Path, files: dict[str, str | bytes], scene: str = "", dataset: str = DATASET,
          path: str = "stage.usda") -> Path:
    texts = {"dataset.yaml": dataset, "stool.yaml": "family: stool\n", **files,
             "scene.yaml": f"file:\n  path: {path}\n  licence: CC-BY-4.0\n{scene}"}
    for name, text in texts.items():
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder / "dataset.yaml"


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Builds a dataset that must be refused; gives what is said, in lines that each begin with `error: `."""

    def run(*arguments: Any, **more: Any) -> str:
        folder = tmp_path / "in"
        folder.mkdir(exist_ok=True)
        spec = write(folder, *arguments, **more)
        assert main(["build", str(spec), "--out", str(tmp_path / "out"), "--workers", "1"]) == 2
        said = capsys.readouterr()
        assert "Traceback" not in said.err + said.out and not (tmp_path / "out").exists()
        assert all(line.startswith("error: ") and line.isprintable() for line in said.err.splitlines())
        return said.err.replace(f"{folder}/", "")

    return run


def test_the_scene_that_is_broken_is_whole(tmp_path: Path) -> None:
    assert main(["plan", str(write(tmp_path, {"stage.usda": stage()}))]) == 0

STAGES: list[tuple[str | bytes, str]] = [
    (stage(chair=prim("Mesh", "Chair_01")), "expected 2 things in stage.usda, got 1 of 4"),
    ("#usda 1.0\n", "expected things with triangles, got none"),
    ("", "expected it to start with #usda 1., got ''"),
    (stage().encode("utf-16"), "expected it to start with #usda 1., got"),
    (b"\xef\xbb\xbf" + stage().encode(), "expected it to start with #usda 1., got"),
    (stage().encode().replace(b"Chair", b"Ch\xe4ir"), "'utf-8' codec can't decode byte 0xe4"),
    (said_by("metersPerUnit = 0"), "stage.usda: expected metersPerUnit > 0, got 0"),
    (said_by("metersPerUnit = nan"), "expected metersPerUnit > 0, got nan"),
    (said_by("metersPerUnit = 1e30"), "/World/Floor: expected things within 1,000 km of the origin, got one that "),
    (said_by('upAxis = "Q"'), "expected upAxis to be X, Y or Z, got 'Q'"),
    (said_by("upAxis = 3"), "got one that cannot be read: stage.usda:3:14: Error parsing simple value"),
    (stage().replace('"Table"', "Table"), "stage.usda:48:1: Expected } at 'def Mesh Table () {'"),
    (stage().replace("[0, 1, 3", "[0 1, 3"), "stage.usda:11:30: cannot be parsed at '"),
    (stage(where=at(1e7)), "/World/Floor: expected things within 1,000 km of the origin, got one that reaches to 1e+04 "
                           "km (correct its transform or the units of the file)"),
    (stage(where=moved([("double3", "scale", (1e4, 1e4, 1e4))])), "got 0 of 5 (each is longer than 1000 m, from 9e+03"),
    (stage(chair=box("Chair_01", (1e39, 0, 0), (1, 1, 1))), "/World/Chair_01: expected things within 1,000 km"),
    (stage(chair=box("Chair_01", ("nan", 0, 0), (1, 1, 1))), "/World/Chair_01: expected an affine transform of finite"),
    (stage(chair=box("Chair_01", (0, 0, 0), (0, 1, 1))), "expected 2 things in stage.usda, got 1 of 4"),
    (lamp("1e30"), "/World/Lamp: expected intensity in [0, 1e+12], got 1e+30 (correct it, or take the light away)"),
    (lamp("nan"), "/World/Lamp: expected intensity in [0, 1e+12], got nan"),
    (METRES + 'def Xform "a" {\n' * 600 + "}\n" * 600, "expected prims at most 500 deep, got more"),
    (METRES + "".join(f'def Xform "a{each}" {{\n' for each in range(300)), " ... "),
    (instances(9), "expected at most 200,000 prims, instances counted each, got more"),
]


@pytest.mark.parametrize(("text", "said"), STAGES, ids=[said[:50] for _, said in STAGES])
def test_a_stage_that_will_not_do(refused: Run, text: str | bytes, said: str) -> None:
    assert said in refused({"stage.usda": text})

REFERENCES: list[tuple[dict[str, str], str]] = [
    ({"stage.usda": named("gone.usda")}, "expected the files that stage.usda names, found no gone.usda in "),
    *(({"stage.usda": named(file, how)}, f"layer: expected a file in the folder of the mesh or below it, got '{file}' "
                                         "(put it there, or name its folder in `roots`)")
      for file in ("../a.usda", "/a/a.usda", "//host/share/a.usda") for how in NAMES),
    *(({"stage.usda": named(file)}, f"layer of stage.usda: expected a file, got '{file}'")
      for file in ("http://a/a.usda", "https://a/a.usda", "s3://a/a.usda", "omniverse://a/a.usda", "file:///a.usda")),
    ({"stage.usda": named("a.mdl")}, "expected layers that end in one of .usd .usda .usdc .usdz, got 'a.mdl'"),
    *(({"stage.usda": named("a.usda", how), "a.usda": '#usda 1.0\n(\n    defaultPrim = "R"\n)\n' + prim(
        "Xform", "R", prim("Xform", "K", metadata=f"prepend {how} = @a.usda@"))},
       "stage.usda: /World/R/K: expected references that come to an end, got a circle") for how in NAMES),
    ({"stage.usda": stage(prim("Xform", "I", metadata="inherits = </World>"))}, "/World/I: expected references that"),
    ({"stage.usda": stage(header=METRES.replace("(\n", "(\n    subLayers = [@stage.usda@]\n", 1))}, "got a circle"),
]


@pytest.mark.parametrize(("files", "said"), REFERENCES, ids=[said[:50] for _, said in REFERENCES])
def test_references_that_will_not_do(refused: Run, files: dict[str, str], said: str) -> None:
    assert said in refused(files)


def test_links_and_pipes_are_told_for_what_they_are(refused: Run, tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(METRES)
    (tmp_path / "in").mkdir()
    os.symlink("../a.usda", tmp_path / "in/b.usda")
    assert "got 'b.usda', a link that leads out of it (put it there, or" in refused({"stage.usda": named("b.usda")})
    os.mkfifo(tmp_path / "in/c.usda")
    assert "no plain file that can be opened: a folder, a pipe, or a link to nothing" in refused({}, path="c.usda")


@pytest.mark.parametrize(("scene", "dataset", "said"), [
    ("", DATASET.replace('"*"', "Chiar"), "expected 2 things with name 'Chiar' in stage.usda, got 0 of 5 (nearest"),
    ("", DATASET.replace('name: "*"', "category: sofa"), "(known categories: chair, table)"),
    ("", DATASET.replace("count: 2", "count: 20"), "expected 20 things in stage.usda, got 2 of 5 (lower the count"),
    ('  leave_out: ["*"]\n', DATASET, "got 0 of 5 (`leave_out` takes /World/Floor away)"),
    ('  parts: {floor: ["*"]}\n', DATASET, "got 0 of 5 (/World/Floor is part of the floor: give its whole name"),
    ('  leave_out: ["*Floor"]\n', FLOOR_ONLY, "expected free floor to place things on, got a stage without a floor"),
    ("  cameras: own\n", DATASET, "scene.yaml:4: file.cameras: expected a scene with cameras, got none in stage.usda"),
    (KEPT, DATASET, "scene.yaml:4: file.lights.use: expected a scene with lights, got none in stage.usda"),
    ("  variants: {/World/Chair_01: {look: red}}\n", DATASET, "expected a variant set, got look (there is none)"),
    ("  variants: {/Wrld/Chair_01: {look: red}}\n", DATASET, "got /Wrld/Chair_01 (nearest: /World/Chair_01"),
    ("  slot: {name: nope}\n", FLOOR_ONLY, "scene.yaml:4: file.slot: expected 1 thing with name 'nope'"),
])
def test_a_spec_that_asks_for_what_is_not_there(refused: Run, scene: str, dataset: str, said: str) -> None:
    assert said in refused({"stage.usda": stage()}, scene, dataset)


@pytest.mark.parametrize("intensity", ["0", "1"])
def test_lights_that_are_off(refused: Run, intensity: str) -> None:
    off = KEPT if intensity == "0" else '  lights: {use: kept, dim: {"*": 0}}\n'
    said = refused({"stage.usda": lamp(intensity)}, off)
    assert "lights.use: expected a scene with lights" in said and "got none" in said


@pytest.mark.parametrize("how", ["copy", "link"])
def test_two_splits_share_no_scene_by_another_name(refused: Run, tmp_path: Path, how: str) -> None:
    (tmp_path / "in").mkdir()
    other = tmp_path / "in/b.usda"
    other.write_text(stage()) if how == "copy" else other.symlink_to("stage.usda")
    second = ("  - name: test\n    objects: {things: {}, count: 1}\n    scenes: {count: 1, from: [b.yaml]}\n")
    assert "expected scenes that no other split has, got a scene file of split train" in refused(
        {"stage.usda": stage(), "b.yaml": "file: {path: b.usda, licence: CC0-1.0}\n"}, "", DATASET + second)


def test_a_name_of_a_hundred_thousand_letters_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    start = time.process_time()
    assert main(["plan", str(write(tmp_path, {"stage.usda": stage().replace("Chair_01", "C" * 100_000)}))]) == 0
    assert time.process_time() - start < 30 and "C" * 20 in capsys.readouterr().out


def test_a_scene_too_far_for_single_precision_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(write(tmp_path, {"stage.usda": stage(where=at(1e4, 1e4))}))]) == 0
    said = re.sub(r"[\s│]+", " ", capsys.readouterr().out)
    assert "/World/Chair_01 lies 10 km from the origin, where single precision tells places 1.2 mm apart" in said
