"""A folder of 3D-FRONT scenes becomes an index, a report and specs that load, or nothing that is half done."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from dataset_builder.cli import import_front3d
from dataset_builder.cli.main import main, parser
from dataset_builder.importing import front3d_import
from dataset_builder.spec.load import load_dataset
from tests.front3d_files import House, house, jid_of

LICENCE = ("--licence", "LicenseRef-3D-FRONT")
Run = Callable[..., int]


def write(root: Path, houses: int = 7, change: Callable[[int, House], None] = lambda number, made: None) -> None:
    """Houses in `scenes`, each with its uid, and their models and textures."""
    (root / "scenes").mkdir()
    house().write(root)
    (root / "house.json").unlink()
    for number in range(houses):
        made = house()
        made.document["uid"] = f"house-{number}"
        change(number, made)
        (root / "scenes" / f"house {number}.json").write_text(json.dumps(made.document))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the verb on `scenes` in `tmp_path`, without plans unless they are asked for."""
    monkeypatch.chdir(tmp_path)

    def go(*arguments: object, sheet: bool = False, folder: str = "scenes") -> int:
        return main(["import", "front3d", folder, "--workers", "1", *map(str, arguments),
                     *([] if sheet else ["--no-sheet"])])

    return go


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_folder_becomes_the_papers_split(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    assert run("--models", "models", "--textures", "textures", "--out", "deep/My Split", *LICENCE, "--seed", 5,
               "--share", 0.1) == 0
    said = capsys.readouterr().out
    assert "train: 5 of 50 scenes, 9 of 30 targets" in said and "evaluation: 2 of 20 scenes, 3 of 10 targets" in said
    assert "splits share no scene and no target; of the 12 models that stand in their scenes, 12 stand in both" in said
    loaded = load_dataset(tmp_path / "deep" / "My Split" / "my-split.yaml")
    train, evaluation = loaded.dataset.splits
    assert (loaded.dataset.name, loaded.dataset.seed, loaded.dataset.licence) == ("my-split", 5, "LicenseRef-3D-FRONT")
    assert [(split.name, split.views, split.pairs) for split in (train, evaluation)] == [("train", 1, "all"),
                                                                                         ("evaluation", 3, "all")]
    assert (len(train.scenes.source), len(evaluation.scenes.source)) == (5, 2)
    assert not set(train.objects.source) & set(evaluation.objects.source)
    assert not set(train.scenes.source) & set(evaluation.scenes.source)
    specs = tmp_path / "deep" / "My Split"
    for scene in loaded.scenes.values():
        assert scene.file is not None and scene.file.licence == "LicenseRef-3D-FRONT"
        assert (specs / scene.file.path).is_file()
        assert (specs / scene.file.models / "model_info.json").is_file()
        assert (specs / scene.file.textures / "bbbb-wood").is_dir()
    assert {spec.category for spec in loaded.objects.values()} >= {"bed", "chair", "sofa", "table"}
    assert {mesh.path.name for mesh in loaded.meshes.values()} == {"raw_model.obj"}
    assert loaded.objects[f"objects/{jid_of('bed')}.yaml"].scale == 1


def test_the_report_counts_what_is_there(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def change(number: int, made: House) -> None:
        if number == 1:
            made.entry("chair")["jid"] = "not-there"
        if number == 2:
            del made.mesh("Floor")["xyz"]
        if number == 3:
            made.document["scene"]["room"] = []
        if number == 4:
            for entry in made.document["furniture"]:
                entry["valid"] = False

    write(tmp_path, 6, change)
    (tmp_path / "scenes" / "cut.json").write_text('{"uid": "x", "scene": {')
    assert run("--models", "models", "--out", "out", *LICENCE) == 1
    said = capsys.readouterr().out
    assert "cannot be read: cut.json: expected a readable scene of 3D-FRONT" in said
    table = {row["file"]: row for row in rows(tmp_path / "out" / "scenes.csv")}
    assert {name: (row["usable"], row["why_not"].partition(":")[0]) for name, row in table.items()} == {
        "cut.json": ("no", "cannot be read"), "house 0.json": ("yes", ""), "house 1.json": ("yes", ""),
        "house 2.json": ("yes", ""), "house 3.json": ("no", "no floor"),
        "house 4.json": ("no", "no furniture with a model"), "house 5.json": ("yes", "")}
    assert (table["house 0.json"]["rooms"], table["house 0.json"]["furniture_with_model"]) == ("3", "13")
    assert (table["house 1.json"]["furniture"], table["house 1.json"]["furniture_with_model"]) == ("13", "11")
    kinds = {row["kind"]: (int(row["scenes"]), int(row["times"])) for row in rows(tmp_path / "out" / "faults.csv")}
    assert kinds == {
        "pieces of furniture that were not published, left out": (1, 13), "models that are not there, left out": (1, 1),
        "faces with corners that are not there, left out": (1, 1), "meshes without faces, left out": (1, 1),
        "scenes without rooms": (1, 1)}
    faults = {path.name: rows(path) for path in (tmp_path / "out" / "faults").iterdir()}
    assert {name: len(found) for name, found in faults.items()} == {
        "house_1.csv": 1, "house_2.csv": 2, "house_3.csv": 1, "house_4.csv": 13}
    assert faults["house_1.csv"] == [{"kind": "models that are not there, left out", "where": "not-there", "said": ""}]


def test_without_models_all_is_unpublished(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 2)
    assert run("--out", "out", *LICENCE) == 1
    said = capsys.readouterr().out
    assert "no folder of models was named, so that all furniture counts as unpublished: give --models" in said
    assert "no dataset is proposed: there is no scene that can be used" in said
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"index.jsonl", "scenes.csv", "faults.csv", "faults"}
    assert run("--models", "models", "--index", "out/index.jsonl", "--out", "two", *LICENCE) == 0
    assert "0 scenes read" in (said := capsys.readouterr().out) and "2 taken from the index" in said
    assert not (tmp_path / "two" / "index.jsonl").exists() and (tmp_path / "two" / "two.yaml").is_file()


def test_models_in_centimetres_get_their_scale(run: Run, tmp_path: Path) -> None:
    write(tmp_path, 2)
    file = tmp_path / "models" / jid_of("bed") / "raw_model.obj"
    lines = [line.split() for line in file.read_text().splitlines()]
    file.write_text("\n".join(" ".join([each[0], *(f"{100 * float(x):.4f}" for x in each[1:])])
                              if each[:1] == ["v"] else " ".join(each) for each in lines))
    (tmp_path / "models" / jid_of("sofa") / "raw_model.obj").write_text("v 0 0 zero\n")
    assert run("--models", "models", "--out", "out", *LICENCE) == 0
    loaded = load_dataset(tmp_path / "out" / "out.yaml")
    assert loaded.objects[f"objects/{jid_of('bed')}.yaml"].scale == 0.01
    assert f"objects/{jid_of('sofa')}.yaml" not in loaded.objects


@pytest.mark.parametrize(("arguments", "rule"), [
    ((), "--licence: expected the licence of the scenes and models, got none"),
    (("--licence", "my terms"), "--licence: expected an SPDX identifier of letters, digits, . + and -, got my terms"),
    (("--licence", "LicenseRef-"), "--licence: expected an SPDX identifier"),
    ((*LICENCE, "--models", "nowhere"), "nowhere: --models: expected the folder of the models, got: No such file"),
    ((*LICENCE, "--models", "."), ".: --models: expected folders that hold a raw_model.obj, found none"),
    ((*LICENCE, "--textures", "nowhere"), "nowhere: --textures: expected a folder, found none"),
    ((*LICENCE, "--models", "models", "--model-info", "no.json"), "no.json: --model-info: expected a file, found none"),
    ((*LICENCE, "--models", "models", "--model-info", "scenes/house 0.json"), "expected a list of models, got a dict"),
    ((*LICENCE, "--out", "taken"), "taken/objects: expected no such file yet, got one; nothing is overwritten"),
    ((*LICENCE, "--out", "other"), "other/index.jsonl: expected an index of 3D-FRONT scenes, got another file"),
])
def test_bad_input_is_told_before_anything_is_read(run: Run, tmp_path: Path, arguments: tuple[str, ...], rule: str,
                                                   capsys: pytest.CaptureFixture[str],
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, 1)
    (tmp_path / "taken" / "objects").mkdir(parents=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.jsonl").write_text("mine\n")
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(front3d_import, "index_folder", lambda *_, **__: pytest.fail("read"))
    assert run(*arguments) == 2
    said = capsys.readouterr().err
    assert rule in said and len(said.splitlines()) == 1
    assert sorted(tmp_path.rglob("*")) == before


def test_why_a_licence_is_asked_for(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, 1)
    assert run() == 2
    assert "signed by mail and allow no passing on" in (said := capsys.readouterr().err) and "LicenseRef-" in said


def test_plans_are_drawn(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As large as its rows; walls, floors and every colour of what stands in the house are seen."""
    from dataset_builder.report.front3d_sheet import COLOURS, FLOOR, WALL

    write(tmp_path, 3)
    assert run("--models", "models", "--out", "out", *LICENCE, sheet=True) == 0
    assert "plans of the scenes: out/scenes.png" in capsys.readouterr().out
    picture = Image.open(tmp_path / "out" / "scenes.png").convert("RGB")
    plan = picture.crop((12, 100, 312, 400))
    counts = {colour: count for count, colour in plan.getcolors(1 << 20) or []}
    assert counts[FLOOR] > 10_000 and counts[WALL] > 300
    assert all(counts.get(COLOURS[group], 0) > 20 for group in ("chair", "sofa", "table", "cabinet", "bed", "lamp"))


def test_a_plan_that_fails_costs_no_specs(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise MemoryError("too large")

    write(tmp_path, 2)
    monkeypatch.setattr("dataset_builder.report.front3d_sheet.write_front3d_sheet", fail)
    assert run("--models", "models", "--out", "out", *LICENCE, sheet=True) == 0
    assert "warning: no plans of the scenes (too large)" in capsys.readouterr().err
    assert (tmp_path / "out" / "out.yaml").is_file() and not (tmp_path / "out" / "scenes.png").exists()


def test_a_folder_of_models_may_be_called_front3d(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The word means scenes unless something of that name lies here and no folder of scenes follows."""
    monkeypatch.chdir(tmp_path)
    write(tmp_path, 1)
    (tmp_path / "chairs").mkdir()
    (tmp_path / "chairs" / "model_info.json").write_text("[]")
    whole = ["import front3d", "scenes", "--seed", "1"]
    assert import_front3d.one_verb(["import", "front3d", "scenes", "--seed", "1"]) == whole
    assert import_front3d.one_verb(["import", "front3d", "--help"]) == ["import front3d", "--help"]
    (tmp_path / "front3d").mkdir()
    assert import_front3d.one_verb(["import", "front3d", "scenes", "--seed", "1"]) == whole
    for others in (["import", "front3d"], ["import", "front3d", "chairs"], ["import", "./front3d", "scenes"],
                   ["import", "chairs", "front3d"], ["plan", "front3d"], []):
        assert import_front3d.one_verb(others) == others
    options = parser().parse_args(import_front3d.one_verb(["import", "front3d", "chairs"]))
    assert options.paths == [Path("front3d"), Path("chairs")]
