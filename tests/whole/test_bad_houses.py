"""Scenes of 3D-FRONT, packages, textures and names that will not do, on the command line."""

import csv
import io
import json
import shutil
import zipfile
from pathlib import Path

import pytest

from dataset_builder.cli.main import main
from tests.front3d_files import House, house
from tests.gltf_scenes import CHAIR, DATASET, SCENE, write_dataset
from tests.whole.test_bad_scenes import METRES, Run, box, named, prim, refused, stage, write

FRONT = "  models: models\n  textures: textures\n"
EVIL = "[red]=1+1|`<b>\x1b[31m\n"
__all__ = ["refused"]
MATERIAL = """\
def Material "M" {
    token outputs:surface.connect = </World/M/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </World/M/T.outputs:rgb>
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @t.bmp@
        float3 outputs:rgb
    }
}
"""


def small() -> House:
    return house(rooms=("Bedroom-31",), models=("bed", "nightstand"))


def package(*names: str, how: int = zipfile.ZIP_STORED, text: str = "") -> bytes:
    """A USDZ package of files that all hold the text, or the sound stage."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", how) as made:
        for name in names:
            made.writestr(name, text or stage())
    return stream.getvalue()


@pytest.mark.parametrize(("content", "said"), [
    (package("a.usda", how=zipfile.ZIP_DEFLATED, text=METRES + "#" * 10**7), "without compression or encryption, got"),
    (package("../a.usda"), "expected files within a.usdz, got one called '../a.usda'"),
    (package("/a.usda"), "expected files within a.usdz, got one called '/a.usda'"),
    (package("..\\a.usda"), "expected files within a.usdz, got one called '..\\\\a.usda'"),
    (package("a.txt"), "expected a USD layer, got a.usdz, which is damaged"),
    (package("a.usda", text=named("../b.usda")), "expected a USD layer, got ../b.usda, which is damaged or not there"),
    *((package("a.usda")[:length], said) for length, said in ((0, "expected it to start with PK"),
                                                             (500, "got a.usdz, which is damaged"),
                                                             (-1, "got a.usdz, which is damaged"))),
], ids=range(9))
def test_a_package_that_will_not_do(refused: Run, content: bytes, said: str) -> None:
    assert said in refused({"a.usdz": content}, path="a.usdz")


@pytest.mark.parametrize(("size", "said"), [
    ((100_000, 100_000), "inputs:file: t.bmp: expected an image of at most 16384 pixels a side, got one of 100000 x"),
    ((16_000, 16_000), "inputs:file: t.bmp: expected the pixels of an image of 16000 x 16000, got"),
    ((0, 0), "inputs:file: t.bmp: expected a readable image"),
])
def test_a_texture_that_claims_more_than_it_has(refused: Run, size: tuple[int, int], said: str) -> None:
    width, height = (side.to_bytes(4, "little") for side in size)
    content = (b"BM" + (54).to_bytes(4, "little") + bytes(4) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little")
               + width + height + b"\x01\x00\x18\x00" + bytes(24))
    chair = prim("Mesh", "Chair_01", 'rel material:binding = </World/M>', box("a", (0, 0, 0), (1, 1, 1)).split("{", 1)[
        1].rpartition("}")[0], metadata='prepend apiSchemas = ["MaterialBindingAPI"]')
    assert said in refused({"stage.usda": stage(MATERIAL, chair=chair), "t.bmp": content})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where `refused` runs, with a house that is sound."""
    (tmp_path / "in").mkdir()
    small().write(tmp_path / "in")
    assert main(["plan", str(write(tmp_path / "in", {}, FRONT, DATASET, "house.json"))]) == 0
    return tmp_path / "in"


def test_a_house_cut_at_every_kilobyte(refused: Run, folder: Path) -> None:
    whole = (folder / "house.json").read_bytes().rstrip()
    assert len(whole) > 10_000
    for length in range(0, len(whole), 1000):
        said = refused({"house.json": whole[:length]}, FRONT, path="house.json")
        assert "the file ends early: copy it again" in said and ": expected JSON, got: " in said


@pytest.mark.parametrize(("content", "said"), [
    (b"[]", "scene"), (b"null", "scene"), (b'{"scene": 7}', "scene"),
    ('{"scene": {}}'.encode("utf-16"), "expected text in UTF-8, got UTF-16: save it as UTF-8"),
    (b'{"uid": ' + b"9" * 10_000 + b"}", "expected numbers of at most 4,300 digits, got more"),
    (b"[" * 100_000, "expected JSON that is not nested without end"),
    (b"{" * 2**21, "expected at most 1,048,576 objects and lists, got 2,097,152"),
], ids=range(7))
def test_what_is_no_house(refused: Run, folder: Path, content: bytes, said: str) -> None:
    assert said in refused({"house.json": content}, FRONT, path="house.json")


def test_folders_of_a_house_that_are_not_there(refused: Run, folder: Path) -> None:
    said = refused({}, "  models: modls\n  textures: txtures\n", path="house.json")
    assert "file.models: expected a folder, found none at 'modls' (nearest known folder: models)" in said
    assert "file.textures: expected a folder, found none at 'txtures' (nearest known folder: textures)" in said


def test_line_ends_and_a_mark_before_the_text_change_nothing(folder: Path) -> None:
    text = json.dumps(small().document, indent=1).replace("\n", "\r\n")
    (folder / "house.json").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert main(["plan", str(folder / "dataset.yaml")]) == 0


def test_names_are_not_interpreted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = write_dataset(tmp_path, [*SCENE[:3], CHAIR | {"name": EVIL}, SCENE[4]])
    text = json.loads((tmp_path / "stage.gltf").read_text())
    for material in text["materials"]:
        material["name"] = EVIL + material["name"]
    (tmp_path / "stage.gltf").write_text(json.dumps(text))
    assert main(["plan", str(spec)]) == 0
    said = capsys.readouterr()
    assert all(line.isprintable() for line in (said.out + said.err).split("\n"))
    assert "[red]=1+1|`<b>\\x1b[31m\\n" in said.out


def test_tables_of_scenes_compute_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    small().write(tmp_path)
    made = small()
    made.document["uid"] = "=cmd|'/c calc'!A1\x07"
    made.document["scene"]["room"][0]["instanceid"] = EVIL
    made.entry("bed")["jid"] = "-1+1"
    (tmp_path / "scenes").mkdir()
    for name in ("=a.json", "b\x1b[2J.json"):
        (tmp_path / "scenes" / name).write_text(json.dumps(made.document))
    command = ["import", "front3d", "scenes", "--workers", "1", "--no-sheet", "--licence", "LicenseRef-A"]
    assert main([*command, "--models", "models"]) == 1  # One of them cannot be named
    said = capsys.readouterr()
    assert all(line.isprintable() for line in (said.out + said.err).split("\n"))
    tables = [tmp_path / "front3d-specs/scenes.csv", *(tmp_path / "front3d-specs").rglob("faults*/*.csv")]
    for table in tables:
        with table.open(newline="") as stream:
            cells = [cell for row in csv.reader(stream) for cell in row]
        assert all(cell.isprintable() and not cell.startswith(("=", "+", "-", "@")) for cell in cells)
    assert "'=cmd|'/c calc'!A1\\x07" in tables[0].read_text()
    shutil.rmtree(tmp_path / "front3d-specs")
    assert main([*command, "--model-info", "none.json"]) == 2
    assert "none.json: --model-info: expected --models beside it, got none" in capsys.readouterr().err
    assert not (tmp_path / "front3d-specs").exists()
