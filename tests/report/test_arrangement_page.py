"""The verb `view`, from a spec to its two files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from tests.small_specs import FILES, write_spec

NARROW = {"small.yaml": FILES["small.yaml"].replace("coverage: [0.1, 0.5]", "coverage: [0.985, 0.99]")}
"""No camera comes that close."""


def page_data(folder: Path) -> dict[str, object]:
    """What a page was given."""
    text = (folder / "view.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="view">(.*?)</script>', text, re.DOTALL)
    assert found is not None
    data: dict[str, object] = json.loads(found[1])
    return data


def test_a_view_has_an_arrangement_and_a_preview(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    spec = write_spec(tmp_path / "specs")
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(spec), "--example", "1", "--backend", "llvm"]) == 0
    folder = tmp_path / "views" / "small-1"
    assert sorted(path.name for path in folder.iterdir()) == ["view.html", "view.png"]
    said = capsys.readouterr().out
    assert "preview at 8 spp" in said
    data = page_data(folder)
    preview = data["preview"]
    assert isinstance(preview, dict)
    assert [layer["name"] for layer in preview["layers"]] == ["i_s", "i_t", "s_prime"]
    assert preview["note"].startswith("preview at 8 spp")
    assert preview["label"]["plan"]["render"]["spp_target"] == 16, "the plan is the dataset's, not the preview's"
    assert data["decisions"]
    with Image.open(folder / "view.png") as picture:
        below = np.asarray(picture)[-200:]
    assert below.std() > 5


def test_what_cannot_be_planned_is_shown_without_a_camera(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = write_spec(tmp_path / "specs", NARROW)
    assert main(["view", str(spec), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "error: " in said
    assert "coverage" in said
    data = page_data(tmp_path / "out")
    assert isinstance(data["arrangement"], dict)
    assert data["arrangement"]["camera"] is None
    assert data["preview"] is None
    problems = data["problems"]
    assert isinstance(problems, list)
    assert "coverage" in problems[0]
    assert (tmp_path / "out" / "view.png").is_file()


@pytest.mark.parametrize(("arguments", "rule"), [
    (["--example", "10"], "expected an example in [0, 10), got 10"), (["--set", "image.width=0"], "image.width")])
def test_a_mistake_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str],
                                  rule: str) -> None:
    spec = write_spec(tmp_path / "specs")
    assert main(["view", str(spec), "--out", str(tmp_path / "out"), *arguments]) == 2
    assert rule in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
