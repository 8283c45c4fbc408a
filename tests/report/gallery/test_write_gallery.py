"""The gallery of a dataset: both forms have the same contents, equal bytes, and leave what is not theirs alone."""

import json
import re
import shutil
import zlib
from base64 import b64decode
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.errors import OutputError, ShardError, UserError
from dataset_builder.report.gallery import write_gallery as written
from dataset_builder.report.gallery.write_gallery import GalleryDone, GalleryJob, write_gallery
from dataset_builder.shards.reader import open_dataset
from tests.file_servers import range_server
from tests.report.gallery.shown_dataset import KEYS, LOST, build_shown
from tests.shards.tiny_dataset import WIDTH


@pytest.fixture(scope="module")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The dataset; not to be changed."""
    return build_shown(tmp_path_factory.mktemp("tiny") / "tiny")


def made(tiny: Path | str, out: Path, **chosen: Any) -> GalleryDone:
    """The gallery, written."""
    return write_gallery(GalleryJob(dataset=tiny, out=out, **chosen))


def gallery_of(page: Path) -> dict[str, Any]:
    """What a page says of the dataset."""
    found = re.search(r'<script type="application/json" id="gallery">(.*?)</script>', page.read_text(), re.DOTALL)
    assert found
    return dict(json.loads(found[1]))


def payloads_of(page: Path) -> dict[str, Any]:
    """Payloads by key: those inside a page, or those in the folder beside it."""
    scripts = {path.stem: path.read_text() for path in (page.parent / "examples").glob("*.js")}
    if scripts:
        return {key: json.loads(text.removeprefix("galleryExample(").removesuffix(");\n"))
                for key, text in scripts.items()}
    inside = re.findall(r'<script type="application/json" data-key="(\d+)">(.*?)</script>', page.read_text())
    return {key: json.loads(text) for key, text in inside}


def files_of(folder: Path) -> dict[str, bytes]:
    """Every file by relative name."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_has_all_examples(tiny: Path, tmp_path: Path) -> None:
    done = made(tiny, tmp_path / "out")
    assert (done.page, done.examples) == (tmp_path / "out" / "index.html", 4)
    gallery, payloads = gallery_of(done.page), payloads_of(done.page)
    assert (gallery["title"], gallery["base"]) == ("Tiny 1.0.0", "examples/")
    assert gallery["layers"] == ["i_s", "d", "r", "i_t", "s_prime", "mask"]
    assert [example["key"] for example in gallery["examples"]] == KEYS
    assert [example["split"] for example in gallery["examples"]] == ["train"] * 3 + ["test"]
    assert [example["seconds"] for example in gallery["examples"]] == [1.75, None, None, 2.0]
    dataset = open_dataset(tiny)
    for example in gallery["examples"]:
        label = dataset.label(example["key"])
        assert (example["light"], example["level"]) == (label.plan.light, label.plan.rough.level)
        assert (example["object"], example["scene"]) == (label.plan.target.object.name, label.plan.room.name)
        assert (example["noise"], example["sigma"]) == (1e-05, label.plan.rough.sigma)
        assert example["errors"] == {found.name: found.relative_error for found in label.record.layers}
        with Image.open(done.page.parent / example["thumb"]) as thumb:
            assert thumb.size[0] == WIDTH
        payload = payloads[example["key"]]
        assert payload["label"] == dataset[example["key"]]["meta"]
        layer = next(layer for layer in payload["layers"] if layer["name"] == "i_t")
        pixels = np.frombuffer(zlib.decompress(b64decode(layer["data"])), "<f2").reshape(3, 6, 8)
        expected = dataset[example["key"]]["i_t"].astype(np.float16)
        assert np.array_equal(np.moveaxis(pixels, 0, 2), expected)
    assert done.bytes == sum(map(len, files_of(done.page.parent).values())) - len('{"format":"3df-lighting-gallery"}')


def test_one_file_says_the_same(tiny: Path, tmp_path: Path) -> None:
    folder, file = made(tiny, tmp_path / "out"), made(tiny, tmp_path / "new" / "out.html")
    assert file.bytes == file.page.stat().st_size
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["out.html"]
    one, other = gallery_of(folder.page), gallery_of(file.page)
    assert payloads_of(file.page) == payloads_of(folder.page)
    for example, same in zip(other.pop("examples"), one.pop("examples"), strict=True):
        data = b64decode(example.pop("thumb").removeprefix("data:image/jpeg;base64,"))
        assert data == (folder.page.parent / same.pop("thumb")).read_bytes()
        assert Image.open(BytesIO(data)).format == "JPEG" and example == same
    assert other.pop("base") == "" and one.pop("base") == "examples/" and one == other


def test_rejected_examples_can_be_opened(tiny: Path, tmp_path: Path) -> None:
    page = made(tiny, tmp_path / "out.html").page
    far, lost = gallery_of(page)["rejected"]
    assert (far["key"], far["open"]) == ("../../x", False)
    assert (lost["gate"], lost["reason"], lost["open"]) == ("finite", "3 <b>NaN</b> in i_t", True)
    payload = payloads_of(page)[LOST]
    assert (payload["note"], payload["label"]) == ("finite: 3 <b>NaN</b> in i_t", {})
    layer = next(layer for layer in payload["layers"] if layer["name"] == "i_t")
    assert np.isnan(np.frombuffer(zlib.decompress(b64decode(layer["data"])), "<f2")).all()
    test = gallery_of(made(tiny, tmp_path / "few.html", splits=["test"]).page)
    assert [item["key"] for item in test["rejected"]] == ["../../x"]


def test_some_of_it(tiny: Path, tmp_path: Path) -> None:
    page = made(tiny, tmp_path / "out", count=2, layers=["mask", "d"]).page
    gallery = gallery_of(page)
    assert [example["key"] for example in gallery["examples"]] == ["00000000", "00000003"]
    assert gallery["about"]["splits"] == {"train": {"shown": 1, "examples": 3}, "test": {"shown": 1, "examples": 1}}
    assert (gallery["about"]["examples"], list(gallery["about"]["layers"])) == (4, ["d", "mask"])
    assert gallery["examples"][0]["errors"] == {}
    assert {tuple(layer["name"] for layer in payload["layers"]) for payload in payloads_of(page).values()} == {
        ("d", "mask")}
    assert len(gallery_of(made(tiny, tmp_path / "test.html", splits=["test"]).page)["examples"]) == 1
    for chosen, rule in (({"splits": ["val"]}, "expected splits among train, test, got 'val'"),
                         ({"layers": ["depth"]}, "expected layers among")):
        with pytest.raises(UserError, match=rule):
            made(tiny, tmp_path / "none.html", **chosen)
    assert not (tmp_path / "none.html").exists()


def test_equal_datasets_give_equal_bytes(tiny: Path, tmp_path: Path) -> None:
    shutil.copytree(tiny, tmp_path / "elsewhere")
    first, other = (made(folder, tmp_path / out).page.parent
                    for folder, out in ((tiny, "a"), (tmp_path / "elsewhere", "b")))
    assert files_of(first) == files_of(other)


def test_it_is_renewed_without_leftovers(tiny: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    made(tiny, tmp_path / "out")
    made(tiny, tmp_path / "out", count=2)
    assert set(files_of(tmp_path / "out")) == {
        "index.html", "gallery.json", *(f"examples/{key}.js" for key in (*KEYS[::3], LOST)),
        *(f"thumbs/{key}.jpg" for key in KEYS[::3])}
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("name", ["notes.txt", "examples/mine.js", "index.html"])
def test_files_of_others_stay(tiny: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out"
    if name != "index.html":
        made(tiny, out)
    out.mkdir(exist_ok=True)
    (out / name).write_text("mine")
    before = files_of(out)
    with pytest.raises(OutputError, match=f"got other files: {name} .*no file was changed"):
        made(tiny, out)
    assert files_of(out) == before and [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_stopped_run_leaves_the_old_one(tiny: Path, tmp_path: Path) -> None:
    def stopped(keys: Sequence[str]) -> Iterator[str]:
        yield keys[0]
        raise KeyboardInterrupt

    for out in (tmp_path / "out", tmp_path / "out.html"):
        made(tiny, out, count=2)
    before = files_of(tmp_path)
    for out in (tmp_path / "out", tmp_path / "out.html", tmp_path / "new", tmp_path / "new.html"):
        with pytest.raises(KeyboardInterrupt):
            write_gallery(GalleryJob(dataset=tiny, out=out), stopped)
    assert files_of(tmp_path) == before and sorted(path.name for path in tmp_path.iterdir()) == ["out", "out.html"]


def test_what_cannot_be_is_refused_beforehand(tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(OutputError, match="expected a place outside the dataset"):
        made(tiny, tiny / "gallery")
    monkeypatch.setattr(written, "MOST", 10_000)
    with pytest.raises(UserError, match=r"got about [\d.]+ KiB: 4 examples with 6 layers \(say --count \d, "
                                        "--layers i_s,d or --split train, or name a folder"):
        made(tiny, tmp_path / "out.html")
    made(tiny, tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_damage_is_told_and_nothing_is_left(tiny: Path, tmp_path: Path) -> None:
    shutil.copytree(tiny, tmp_path / "broken")
    kept = tmp_path / "broken" / ".build" / "rejected" / f"{LOST}.npz"
    whole, flat = kept.read_bytes(), BytesIO()
    np.savez_compressed(flat, i_t=np.zeros((4, 4), np.float32))
    cut = whole[:len(whole) // 2]
    turned = bytes(byte ^ 90 if 60 <= place < 90 else byte for place, byte in enumerate(whole))
    for data in (b"PK no more", cut, b"", turned, flat.getvalue()):
        kept.write_bytes(data)
        with pytest.raises(ShardError, match="expected layers of a rejected example"):
            made(tmp_path / "broken", tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_a_dataset_at_an_address(tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with range_server(tiny) as address:
        page = made(address, tmp_path / "out").page
    here = made(tiny, tmp_path / "here").page
    theirs, ours = files_of(page.parent), files_of(here.parent)
    # What is kept of rejected examples is no part of a dataset
    del ours[f"examples/{LOST}.js"]
    assert gallery_of(page)["examples"] == gallery_of(here)["examples"]
    assert {name: data for name, data in theirs.items() if name != "index.html"} == {
        name: data for name, data in ours.items() if name != "index.html"}



@pytest.mark.parametrize(("options", "rule"), [
    (["--count", "2"], "--count: expected --html OUT with it"), (["--split", "test"], "--split: expected --html OUT"),
    (["--html", "x.html", "--sequence", "turn"], "--html: expected no --sequence with it"),
    (["--html", "x.html", "--sheet", "y.png"], "--html: expected no --sheet with it"),
    (["--example", ""], "--example: expected a name, got an empty one"),
    (["--mesh", ""], "--mesh: expected a name, got an empty one")])
def test_options_that_would_be_passed_over(tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                           capsys: pytest.CaptureFixture[str], options: list[str], rule: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["inspect", str(tiny), *options]) == 2
    assert rule in capsys.readouterr().err and not list(tmp_path.iterdir())
