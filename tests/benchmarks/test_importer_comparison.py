"""Figures of two pictures of one model, worked out by hand; and Blender's importers on files that both sides read."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.importers.comparison import Likeness, Picture, compare, print_table, write_csv

BPY_PYTHON = os.environ.get("BPY_PYTHON", "")
"""Python of an environment with bpy, for the test that needs it."""
ROOT = Path(__file__).resolve().parents[2]


def picture(albedo, mask=((1, 1), (1, 0)), extents=(1.0, 2.0, 3.0)):
    return Picture(albedo=np.repeat(np.array(albedo, float)[..., None], 3, axis=2), mask=np.array(mask, float),
                   extents=np.array(extents))


def test_a_picture_is_like_itself():
    same = compare("a", picture([[0.1, 0.2], [0.3, 9]]), picture([[0.1, 0.2], [0.3, -7]]))
    assert (same.correlation, same.ratio, same.difference, same.overlap, same.extent) == pytest.approx((1, 1, 0, 1, 1))
    assert same.differs == ""


def test_figures_are_those_of_their_formulas():
    """Albedo 0.1, 0.2, 0.3 against 0.2, 0.2, 0.5 on three pixels: covariance 0.01, variances 0.02 / 3 and 0.02."""
    found = compare("a", picture([[0.1, 0.2], [0.3, 0]]), picture([[0.2, 0.2], [0.5, 0]]))
    assert found.ratio == pytest.approx(0.6 / 0.9)
    assert found.difference == pytest.approx(0.1)
    assert found.correlation == pytest.approx(0.01 / np.sqrt(0.02 / 3 * 0.02))
    assert found.differs == "brightness, colours, pattern"


def test_half_a_mask_and_another_unit_are_seen():
    found = compare("a", picture([[0.5, 0.5], [0.5, 0]], extents=(0.1, 0.2, 0.3)),
                    picture([[0.5, 0.5], [0.5, 0]], mask=((1, 0.5), (0, 0))))
    assert found.overlap == pytest.approx(0.5) and found.extent == pytest.approx(0.1)
    assert found.differs == "mask, size"
    flat = compare("a", picture([[0.5] * 2] * 2, extents=(1, 2, 0)), picture([[0.5] * 2] * 2, extents=(1, 2, 0)))
    assert flat.extent == 1 and flat.differs == ""
    rounded = [compare("a", *(picture([[0.5] * 2] * 2, extents=(1, 2, side)) for side in sides)).extent
               for sides in ((1e-8, 3e-8), (0, 1e-8))]
    assert rounded == [1, 1]
    thin = compare("a", picture([[0.5] * 2] * 2, mask=((0.5, 0), (0, 0))), picture([[0.5] * 2] * 2))
    assert np.isnan(thin.ratio) and thin.differs == "mask"


def test_plain_colours_have_no_pattern_to_correlate():
    found = compare("a", picture([[0.5, 0.5], [0.5, 0]]), picture([[0.51, 0.51], [0.51, 0]]))
    assert np.isnan(found.correlation) and found.ratio == pytest.approx(0.5 / 0.51) and found.differs == ""
    assert compare("a", picture([[0.5] * 2] * 2), picture([[0.6] * 2] * 2)).differs == "brightness, colours"


def test_the_table_and_the_file_have_every_model(tmp_path, capsys):
    rows = [compare("a.obj", picture([[0.5] * 2] * 2), picture([[0.5] * 2] * 2), "no material"),
            Likeness(model="b.glb", ours="expected triangles"), Likeness(model="c.ply", theirs="unknown format")]
    print_table(rows)
    said = capsys.readouterr().out.splitlines()
    assert said[1].split() == ["a.obj", "-", "1.000", "0.000", "1.000", "1.000", "no;", "theirs:", "no", "material"]
    assert said[2].endswith("no picture of ours; ours: expected triangles")
    assert said[3].endswith("no picture of theirs; theirs: unknown format")
    assert "3 models, 2 differ" in said[-1]
    write_csv(tmp_path / "a.csv", rows)
    with (tmp_path / "a.csv").open(newline="") as file:
        assert [(row["model"], row["differs"]) for row in csv.DictReader(file)] == [
            ("a.obj", ""), ("b.glb", "no picture of ours"), ("c.ply", "no picture of theirs")]


def test_it_says_what_it_needs():
    done = subprocess.run([sys.executable, "benchmarks/against_importers.py"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("not run: give a folder of models")


def write_models(folder: Path) -> None:
    """A box whose top and front are red, elsewhere textured; and one that we cannot read. Cycles interpolates encoded
    texels, so that there are many of them."""
    red_and_blue = np.zeros((256, 256, 3), np.uint8)
    red_and_blue[:, :128, 0] = red_and_blue[:, 128:, 2] = 230
    Image.fromarray(red_and_blue).save(folder / "rb.png")
    (folder / "box.mtl").write_text("newmtl red\nKd 0.8 0.1 0.1\nnewmtl picture\nKd 1 1 1\nmap_Kd rb.png\n")
    corners = "".join(f"v {x} {y} {z}\n" for z in (0, 1) for y in (0, 2) for x in (0, 1))
    uvs = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    faces = {"red": ((5, 6, 8, 7), (3, 7, 8, 4)), "picture": ((6, 2, 4, 8), (1, 5, 7, 3), (2, 1, 3, 4), (1, 2, 6, 5))}
    lines = "".join(f"usemtl {name}\n" + "".join("f " + " ".join(f"{v}/{k}" for k, v in enumerate(face, 1)) + "\n"
                                                 for face in quads) for name, quads in faces.items())
    (folder / "box.obj").write_text(f"mtllib box.mtl\n{corners}{uvs}{lines}")
    (folder / "gone.obj").write_text("mtllib gone.mtl\nv 0 0 0\n")


@pytest.mark.skipif(not BPY_PYTHON, reason="BPY_PYTHON names no environment with bpy")
def test_both_sides_show_the_same_box(tmp_path):
    write_models(tmp_path)
    done = subprocess.run([sys.executable, "benchmarks/against_importers.py", str(tmp_path), "--blender-python",
                           BPY_PYTHON, "--size", "48", "--spp", "16", "--threads", "1", "--csv",
                           str(tmp_path / "a.csv"), "--pictures", str(tmp_path / "both")],
                          cwd=ROOT, capture_output=True, text=True)
    with (tmp_path / "a.csv").open(newline="") as file:
        box, gone = csv.DictReader(file)
    assert done.returncode == 1, done.stderr
    assert (box["model"], box["differs"], gone["differs"]) == ("box.obj", "", "no picture of ours")
    assert float(box["correlation"]) > 0.99 and float(box["ratio"]) == pytest.approx(1, abs=0.01)
    with Image.open(tmp_path / "both" / "box.obj.png") as both:
        assert both.size == (96, 48)


@pytest.mark.skipif(not BPY_PYTHON, reason="BPY_PYTHON names no environment with bpy")
def test_a_file_that_blender_refuses_is_an_answer(tmp_path):
    (tmp_path / "a.glb").write_bytes(b"no model")
    order = {"path": str(tmp_path / "a.glb"), "extents": [1, 1, 1], "camera": {}, "size": 8, "spp": 1, "out": ""}
    done = subprocess.run([BPY_PYTHON, "benchmarks/importers/blender_import.py", "1"], cwd=ROOT, capture_output=True,
                          text=True, input=json.dumps(order) + "\n")
    version, answer = map(json.loads, done.stdout.splitlines())
    assert "version" in version and answer["error"]
