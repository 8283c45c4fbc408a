"""One example as a page and a picture: of a dataset, of what a build staged, and of what a gate refused."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.engine.rejected_pixels import keep_pixels
from dataset_builder.errors import OutputError
from dataset_builder.report.gallery.example_payload import half_floats
from dataset_builder.report.one_example import look_at_example, write_rejected
from dataset_builder.report.staged_example import staged_layers
from dataset_builder.shards.folder import Claim, require_ours
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.staging import Staging

CLAIM = Claim(name="small", version="1.0.0")
REJECTED = Rejected(key="00000001", view="train/000000", gate="mask_overlap", reason="expected <b>0.9</b>, got 0.5")


def payloads(page: Path) -> list[dict[str, Any]]:
    """What a page shows."""
    found = re.search(r'<script type="application/json" id="examples">(.*?)</script>', page.read_text(), re.DOTALL)
    assert found
    return json.loads(found[1])


def test_the_page_has_every_layer_and_the_label(small_dataset: Path, tmp_path: Path) -> None:
    found = look_at_example(small_dataset, "train:3", tmp_path)
    example = open_dataset(small_dataset)["00000003"]
    shown, = payloads(found.page)
    assert shown["key"] == "00000003" and shown["label"] == example["meta"]
    plan = example["meta"]["plan"]
    assert shown["title"] == (f"example 00000003: {plan['target']['object']['name']} in {plan['room']['name']}, train, "
                              f"{' + '.join(light['kind'] for light in plan['target_light']['lights'])}, level 1")
    assert {layer["name"]: layer["data"] for layer in shown["layers"]} == {
        name: half_floats(pixels)["data"] for name, pixels in example.items() if name != "meta"}
    assert found.picture == tmp_path / "00000003.png" and found.picture.read_bytes().startswith(b"\x89PNG")


def test_previews_do_not_disturb_the_next_build(small_dataset: Path, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    """Of examples, of meshes and of sequences; a link of that name is of others."""
    out = tmp_path / "previews"
    out.mkdir()
    for name in ("00000003.html", "00000003.png", "00000003-mesh.png", "00000003.html.partial", "turn-00-03-strip.png",
                 "turn-00-03.png", "turn-00-03-1-0.png"):
        (out / name).touch()
    (tmp_path / "dataset.json").write_bytes((small_dataset / "dataset.json").read_bytes())
    require_ours(tmp_path, CLAIM)
    for name in ("3.html", "00000003-mine.png", "turn.png"):
        (out / name).touch()
        with pytest.raises(OutputError, match=re.escape(f"got other files: previews/{name} (")):
            require_ours(tmp_path, CLAIM)
        (out / name).unlink()
    (out / "00000004.png").symlink_to(out / "00000003.png")
    with pytest.raises(OutputError, match=r"got other files: previews/00000004.png"):
        require_ours(tmp_path, CLAIM)


def test_options_without_a_use_are_refused(small_dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for options, said in ((["--out", "x"], "--out: expected --example KEY or --mesh KEY with it"),
                          (["--example", "1", "--meshes", "x"], "--meshes: expected --mesh KEY with it, got none"),
                          (["--example", "1", "--mesh", "1", "--sheet", "x"], "--example: expected no --sheet with it"),
                          (["--html", "x", "--mesh", "1"], "--html: expected no --mesh with it")):
        assert main(["inspect", str(small_dataset), *options]) == 2
        assert said in capsys.readouterr().err


def test_a_rejected_example_tells_its_gate(tmp_path: Path) -> None:
    pixels = {"i_t": np.full((4, 5, 3), 0.25, np.float32), "mask": np.ones((4, 5, 1), np.float32)}
    keep_pixels(tmp_path, REJECTED.key, pixels)
    found = write_rejected(REJECTED, tmp_path, tmp_path / "out", about="small 1.0.0")
    shown, = payloads(found.page)
    assert shown["note"] == "rejected" and [layer["name"] for layer in shown["layers"]] == ["i_t", "mask"]
    text = found.page.read_text()
    assert "Rejected by the gate mask_overlap: expected &lt;b&gt;0.9&lt;/b&gt;, got 0.5" in text
    assert found.picture and found.picture.is_file()


def test_one_without_pixels_has_a_page_and_no_older_picture(tmp_path: Path) -> None:
    old = tmp_path / "00000001.png"
    old.touch()
    found = write_rejected(REJECTED, tmp_path, tmp_path, about="small 1.0.0")
    assert payloads(found.page) == [] and found.picture is None and not old.exists()
    assert "Its pixels were not kept" in found.page.read_text()


def test_build_writes_a_page_of_what_it_stages(small_spec: Path, small_dataset: Path, tmp_path: Path,
                                               capsys: pytest.CaptureFixture[str]) -> None:
    """Examples 8 and 9 are one view: the second is too rough for the gate. The next build goes on from there."""
    out = tmp_path / "out"
    build = ["build", str(small_spec), "--out", str(out), "--workers", "1", "--backend", "llvm", "--example", "8",
             "--example", "9", "--set", "gates.mask_overlap=0.9", "--set", "rough.sigma=[0.0, 0.08]"]
    assert main(build) == 0
    folder, said = out / ".build" / "examples", capsys.readouterr().out
    for key in ("00000008", "00000009"):
        assert f"page of {key}: {folder / key}.html, picture: {folder / key}.png" in said
    staged, = payloads(folder / "00000008.html")
    published = open_dataset(small_dataset)["00000008"]
    layers = {layer["name"]: layer["data"] for layer in staged["layers"]}
    assert staged["note"] == "staged, not published" and layers["i_t"] == half_floats(published["i_t"])["data"]
    assert staged["label"]["plan"] == published["meta"]["plan"]
    refused, = payloads(folder / "00000009.html")
    assert refused["note"] == "rejected" and refused["label"]["plan"]["key"] == "00000009"
    assert "Rejected by the gate mask_overlap" in (folder / "00000009.html").read_text()
    key, = Staging(out).known()
    found = staged_layers(Staging(out).get(key, Staging(out).known()[key]).segment)
    np.testing.assert_array_equal(found["i_t"], published["i_t"])
    require_ours(out, CLAIM)
