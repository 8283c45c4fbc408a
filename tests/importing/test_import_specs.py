"""A folder that nobody prepared becomes a dataset that plans, or nothing at all."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from dataset_builder.cli import import_models as verb
from dataset_builder.cli.main import main
from dataset_builder.errors import Problem, UserError
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.plan import Planner
from dataset_builder.spec.load import load_dataset

ASSETS = Path(os.environ.get("THREEDF_ASSETS") or Path(__file__).parents[3] / "shared" / "assets")
Import = Callable[..., int]


def box(path: Path, *extents: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh = trimesh.creation.box(extents=extents)
    if path.suffix == ".gltf":
        for name, content in mesh.export(file_type="gltf").items():
            (path if name.endswith(".gltf") else path.with_name(name)).write_bytes(content)
    else:
        mesh.export(path)


@pytest.fixture
def models(tmp_path: Path) -> Path:
    """Five models of four formats in nested folders, two that cannot be read, one copy, and textures."""
    root = tmp_path / "my models"
    box(root / "chair one.glb", 0.5, 0.9, 0.5)
    box(root / "chairs" / "chair one.glb", 0.6, 1.0, 0.6)
    box(root / "7f3a" / "raw_model.obj", 90, 75, 160)
    box(root / "b\u00e9d" / "bed.ply", 1.6, 2.0, 0.9)
    (root / "b\u00e9d" / "textures").mkdir()
    Image.new("RGB", (4, 4)).save(root / "b\u00e9d" / "textures" / "wood.png")
    box(root / "\u82b1\u74f6 vase.gltf", 0.2, 0.5, 0.2)
    box(root / "copy.glb", 0.5, 0.9, 0.5)
    (root / "copy.glb").write_bytes((root / "chair one.glb").read_bytes())
    (root / "broken.ply").write_bytes(b"ply\nformat ascii 1.0\n")
    (root / "lost.obj").write_text("mtllib gone.mtl\nv 0 0 0\n")
    (root / "model_info.json").write_text(json.dumps([{"model_id": "7f3a", "category": "Dining Table"}]))
    return root


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Import:
    """Runs the verb in `tmp_path`, without a picture unless one is asked for."""
    monkeypatch.chdir(tmp_path)

    def go(*arguments: object, sheet: bool = False) -> int:
        return main(["import", *map(str, arguments), *([] if sheet else ["--no-sheet"])])

    return go


def test_a_folder_becomes_a_dataset_that_plans(models: Path, run: Import, tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    assert run(models, "--out", "out", "--licence", "CC-BY-4.0") == 1
    said = capsys.readouterr().out
    for name, reason in (("broken.ply", ""), ("lost.obj", "line 1: mtllib: expected an existing file, got gone.mtl"),
                         ("copy.glb", f"the same as {models}/chair one.glb")):
        assert f"left out {models / name}: {reason}" in said
    assert "look at 7f3a: expected a table of 0.25 m to 5 m" in said
    assert "look at bed: expected a bed to be lower than deep" in said
    assert "5 models written, 3 files left out, 2 to look at" in said
    loaded = load_dataset(tmp_path / "out" / "out.yaml")
    objects = {Path(key).stem: spec for key, spec in loaded.objects.items() if spec.file}
    assert {name: (spec.category, spec.scale, spec.up) for name, spec in objects.items()} == {
        "7f3a": ("table", 0.01, "y"), "bed": ("bed", 1.0, "z"), "chair_one": ("chair", 1.0, "y"),
        "chair_one_2": ("chair", 1.0, "y"), "\u82b1\u74f6_vase": ("vase", 1.0, "y")}
    assert {spec.licence for spec in objects.values()} == {"CC-BY-4.0"} and loaded.dataset.licence == "CC-BY-4.0"
    train, evaluation = (set(split.objects.source) for split in loaded.dataset.splits)
    assert len(train) == 4 and len(evaluation) == 1 and not train & evaluation
    planned = estimate(Planner(loaded))
    assert planned.planned == planned.tried == planned.views and not [one for one in planned.warnings if "scale" in one]


def test_nothing_is_written_without_a_licence(models: Path, run: Import, tmp_path: Path,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(tmp_path.rglob("*"))
    (models / "chairs" / "LICENSE").write_text("CC0-1.0")
    assert run(models, "--out", "new/out") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4 and all("licence: expected a licence, found none" in line for line in lines)
    assert sorted(path for path in tmp_path.rglob("*") if path.name != "LICENSE") == before
    assert run(models, "--out", "out", "--licence", "CC BY") == 2
    assert "expected an SPDX identifier, such as CC-BY-4.0, got CC BY" in capsys.readouterr().err


def test_the_licence_is_asked_for_on_a_terminal(models: Path, run: Import, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[str]()
    monkeypatch.setattr(verb.sys.stdin, "isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda text: asked.append(text) or "CC0-1.0")
    (models / "chairs" / "LICENSE").write_text("MIT")
    assert run(models, "--out", "out") == 1
    assert len(asked) == 1 and asked[0].startswith("licence of 4 models that name none (")
    loaded = load_dataset(tmp_path / "out" / "out.yaml")
    assert loaded.dataset.licence == "MIT" and loaded.objects["objects/chair_one_2.yaml"].licence == "MIT"


def test_the_licence_of_the_dataset_is_asked_for_where_none_follows(models: Path, run: Import, tmp_path: Path,
                                                                    capsys: pytest.CaptureFixture[str]) -> None:
    (models / "chairs" / "LICENSE").write_text("MIT")
    assert run(models, "--out", "out", "--licence", "Apache-2.0") == 2
    assert "--dataset-licence: expected a licence of the dataset, since none follows" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert run(models, "--out", "out", "--licence", "Apache-2.0", "--dataset-licence", "Apache-2.0") == 1
    assert load_dataset(tmp_path / "out" / "out.yaml").dataset.licence == "Apache-2.0"
    (models / "chairs" / "LICENSE").write_text("CC-BY-NC-4.0")
    assert run(models, "--out", "two", "--licence", "CC0-1.0", "--dataset-licence", "CC0-1.0") == 2
    assert "two/two.yaml:3: licence: expected one that its objects allow, got CC0-1.0" in capsys.readouterr().err


def test_nothing_is_overwritten(models: Path, run: Import, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = tmp_path / "out" / "rooms" / "room.yaml"
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    assert run(models, "--out", "out", "--licence", "CC0-1.0") == 2
    assert "out/rooms/room.yaml: expected no such file yet, got one" in capsys.readouterr().err
    assert mine.read_text() == "mine" and [*(tmp_path / "out").rglob("*")] == [mine.parent, mine]
    assert {path.name for path in tmp_path.iterdir()} == {"out", "my models"}


def test_a_file_in_the_way_of_a_folder_leaves_nothing(models: Path, run: Import, tmp_path: Path,
                                                      capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "scenes").write_text("in the way")
    assert run(models, "--out", "out", "--licence", "CC0-1.0") == 2
    assert "out: cannot be written" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").rglob("*") if path.is_file()] == ["scenes"]


def test_one_model_and_the_default_folder(run: Import, tmp_path: Path) -> None:
    box(tmp_path / "Lamp 3.stl.obj", 0.3, 0.5, 0.3)
    assert run("Lamp 3.stl.obj", "--licence", "CC0-1.0", "--category", "desk lamp") == 0
    dataset, = (tmp_path / "Lamp 3.stl-specs").glob("*.yaml")
    loaded = load_dataset(dataset)
    assert loaded.dataset.name == "lamp-3-stl-specs" and [split.name for split in loaded.dataset.splits] == ["train"]
    assert [spec.category for spec in loaded.objects.values() if spec.file] == ["desk lamp"]


def test_what_is_commented_may_be_written(run: Import, tmp_path: Path) -> None:
    """A wall, a turntable, a lamp and a second split of the one model, by taking a `#` away from each;
    lamps take the place of kinds."""
    box(tmp_path / "chair.glb", 0.5, 0.9, 0.5)
    assert run("chair.glb", "--out", "mine", "--licence", "CC0-1.0") == 0
    for file in (tmp_path / "mine" / "mine.yaml", tmp_path / "mine" / "rooms" / "room.yaml"):
        text = file.read_text().replace("  kinds: [area, sphere, spot, point]\n", "")
        file.write_text(re.sub(r"(?m)^( *)#(?! )", r"\1", text))
    planner = Planner(load_dataset(tmp_path / "mine" / "mine.yaml"))
    first, second = (planner.example(planner.examples[index]) for index in (0, 1))
    assert first.camera == second.camera and abs(second.target.yaw - first.target.yaw) == pytest.approx(180)
    assert first.target_light.lights[-1] == second.target_light.lights[-1]
    assert planner.loaded.dataset.splits[1].allow_shared == ("objects",)
    assert planner.loaded.rooms["rooms/room.yaml"].materials.keys() == {"wall", "floor"}


def test_specs_may_lie_beside_the_models(models: Path, run: Import) -> None:
    assert run(models, "--out", models, "--licence", "CC0-1.0") == 1
    assert load_dataset(models / "my-models.yaml").meshes


def test_a_model_that_no_view_shows_is_left_out(run: Import, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    """A needle 150 times as long as thick never covers as much of a frame as is asked for."""
    box(tmp_path / "m" / "table.obj", 1.2, 0.8, 0.8)
    box(tmp_path / "m" / "needle.obj", 1.5, 0.002, 0.002)
    assert run("m", "--out", "out", "--licence", "CC0-1.0") == 1
    said = capsys.readouterr().out
    assert "left out " in said and "needle.obj: cannot be planned: expected a camera" in said
    assert "1 model written, 1 file left out" in said
    assert [path.stem for path in (tmp_path / "out" / "objects").iterdir()] == ["table"]


def test_where_nothing_is_left_nothing_is_written(run: Import, tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "bad.obj").write_text("f 1 2 3\n")
    assert run("m", "--out", "out", "--licence", "CC0-1.0") == 2
    assert "bad.obj: left out: " in capsys.readouterr().err and [path.name for path in tmp_path.iterdir()] == ["m"]


def test_models_of_one_mesh_stay_in_one_split(run: Import, tmp_path: Path) -> None:
    """A dataset may not have the same mesh file in two splits, whatever its textures are."""
    for k, colour in enumerate(("red", "blue", "green")):
        folder = tmp_path / "m" / f"chair_{colour}"
        folder.mkdir(parents=True)
        Image.new("RGB", (2, 2), colour).save(folder / "t.png")
        (folder / "c.mtl").write_text("newmtl a\nmap_Kd t.png\n")
        faces = "f 1/1 2/1 3/1\nf 1/1 2/1 4/1\nf 1/1 3/1 4/1\nf 2/1 3/1 4/1\n"
        corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\n"
        (folder / "chair.obj").write_text("mtllib c.mtl\nusemtl a\n" + corners + faces)
        box(tmp_path / "m" / f"table_{k}.obj", 1 + 0.1 * k, 0.8, 0.8)
    assert run("m", "--out", "out", "--licence", "CC0-1.0") == 0
    splits = [{Path(key).stem for key in split.objects.source}
              for split in load_dataset(tmp_path / "out" / "out.yaml").dataset.splits]
    chairs = {"chair", "chair_2", "chair_3"}
    assert sorted(map(len, splits)) == [1, 5] and any(chairs <= split for split in splits)


@pytest.mark.skipif(not ASSETS.is_dir(), reason=f"no models at {ASSETS}")
def test_models_that_nobody_prepared(run: Import, tmp_path: Path) -> None:
    names = ("aws_ChairA_01", "polyhaven_painted_wooden_stool", "polyhaven_wooden_table_02")
    assert run(*(ASSETS / name for name in names), "--out", "out", "--licence", "MIT-0") == 0
    loaded = load_dataset(tmp_path / "out" / "out.yaml")
    assert sorted(spec.category for spec in loaded.objects.values() if spec.file) == ["chair", "stool", "table"]


def test_the_contact_sheet_shows_every_model(run: Import, tmp_path: Path) -> None:
    for name in ("table", "stool"):
        box(tmp_path / "m" / f"{name}.ply", 0.6, 0.7, 0.6 if name == "table" else 0.5)
    assert run("m", "--out", "out", "--licence", "CC0-1.0", "--backend", "llvm", sheet=True) == 0
    picture = Image.open(tmp_path / "out" / "models.png").convert("RGB")
    panels = [np.asarray(picture.crop((left, top, left + 160, top + 160))) for top in (36, 200) for left in (212, 376)]
    assert all(len(np.unique(panel.reshape(-1, 3), axis=0)) > 1000 for panel in panels)


def test_a_sheet_that_cannot_be_drawn_is_a_warning(run: Import, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                   capsys: pytest.CaptureFixture[str]) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("no renderer")

    monkeypatch.setattr("dataset_builder.report.model_sheet.write_model_sheet", fail)
    box(tmp_path / "m" / "table.ply", 0.6, 0.7, 0.6)
    assert run("m", "--out", "out", "--licence", "CC0-1.0", sheet=True) == 0
    assert "warning: no contact sheet (no renderer)" in capsys.readouterr().err
    assert (tmp_path / "out" / "out.yaml").exists() and not (tmp_path / "out" / "models.png").exists()


def test_what_a_person_has_to_know_is_told_once(run: Import, tmp_path: Path,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    """Two models with the same fault, a list that names several licences, and a download that was not unpacked."""
    for name in ("oak chair", "elm chair"):
        box(tmp_path / "models" / f"{name}.stl", 0.5, 0.5, 0.9 + 0.01 * name.startswith("elm"))
        (tmp_path / "models" / f"{name}.obj").write_bytes(b"")
    (tmp_path / "models" / "LICENSE").write_text("MIT or Apache-2.0")
    (tmp_path / "models" / "sofa.glb").write_bytes(b"PK\x03\x04" + bytes(40))
    assert run("models", "--out", "out", "--licence", "MIT") == 1
    said = capsys.readouterr().out
    assert said.count("a format without units") == 1 and "not honoured of elm_chair_2, oak_chair_2: a format" in said
    assert "look at elm_chair_2, oak_chair_2: LICENSE names several: MIT, Apache-2.0; taken as MIT, as asked" in said
    assert "elm chair.obj, " in said and "oak chair.obj: expected triangles" in said
    assert "sofa.glb: expected a readable .glb file" in said and "zip archive: unpack it" in said


def test_a_model_that_cannot_be_rendered_costs_no_other_its_picture(models: Path, run: Import, tmp_path: Path,
                                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    from dataset_builder.report import model_sheet

    def fails(_: object, plan: ExamplePlan, **__: object) -> dict[str, np.ndarray]:
        if plan.target.object.category == "bed":
            raise UserError([Problem(where="", path="", rule="not finite")])
        return {"i_s": np.full((160, 160, 3), 0.5, np.float32)}

    monkeypatch.setattr(model_sheet, "render_example", fails)
    assert run(models, "--out", "out", "--licence", "CC-BY-4.0", sheet=True) == 1
    assert (tmp_path / "out" / "models.png").exists()
