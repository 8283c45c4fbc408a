"""Which noise a reconstructed mesh is like: interpolation by hand, the best training, and both kinds in one figure."""

import csv
from pathlib import Path

import pytest

from dataset_builder.lightnet.measures.metrics import Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.report.noise_figures import changes_figure, quality_figure
from dataset_builder.report.noise_page import sentences
from dataset_builder.studies.noise.axes import axis_of
from dataset_builder.studies.noise.level_trainings import MIXED
from dataset_builder.studies.noise.levels import OWN, TRIVIAL, Level, write_table
from dataset_builder.studies.noise.likeness import COST, EVERYTHING, like_sigma, likenesses, write_likeness
from dataset_builder.studies.noise.study_levels import parse_levels

OBJECTS = ("chair", "sofa", "sofa")
ASKED = parse_levels("0,0.004,0.008,density,sdf:views=20")
NORMALS = ((0, 0, 0), (10, 14, 14), (20, 22, 22), (15, 14, 14), (30, 21, 21))
"""Degrees of the examples by level."""
PSNR = {TRIVIAL: (30, 28, 24, 26, 31), MIXED: (25, 25, 24, 23, 24), "level 0": (26, 23, 20, 21, 25),
        "level 1": (24, 26, 23, 24, 25.5), "level 2": (23, 24, 25, 23.5, 23), "level 3": (24, 24, 24, 26, 24),
        "copy_i_s": (11, 11, 11, 11, 11)}
"""By method and level; the chair is 1 dB better everywhere."""


def rows(method: str, number: int) -> tuple[ScoreRow, ...]:
    return tuple(ScoreRow(method=method, key=str(place), view=str(place), object=name, room="r", level=number, sigma=0,
                          seconds=1, metrics=Metrics(l1=0.1, psnr=PSNR[method][number] + (name == "chair"), ssim=0.5,
                                                     lab=0.1)) for place, name in enumerate(OBJECTS))


@pytest.fixture
def levels() -> list[Level]:
    """Three levels of noise, and two of fields, of which only the first has a training of its own."""
    return [Level(number=number, asked=asked, measured=sum(NORMALS[number]) / 3,
                  figures={"normal_median": NORMALS[number]},
                  scores={method: rows(method, number) for method in PSNR})
            for number, asked in enumerate(ASKED)]


def test_a_figure_is_found_on_the_curve_of_noise() -> None:
    sigmas, rising = (0.0, 0.004, 0.008), (1.0, 3.0, 5.0)
    assert [(like_sigma(sigmas, rising, figure).sigma, like_sigma(sigmas, rising, figure).beyond)
            for figure in (1.0, 2.0, 4.5, 5.0, 5.1, 0.9)] == [
        (0, 0), (0.002, 0), (0.007, 0), (0.008, 0), (0.008, 1), (0, -1)]
    assert like_sigma(sigmas, (30.0, 29.0, 25.0), 27.0).sigma == pytest.approx(0.006), "falling with noise"
    assert like_sigma(sigmas, (1.0, 4.0, 3.0), 3.5).sigma == pytest.approx(0.004 * 5 / 6), "at the smallest sigma"
    assert str(like_sigma(sigmas, rising, 9.0)) == "> 0.008"


def test_reconstructed_levels_are_compared_with_noise(levels: list[Level]) -> None:
    density, sdf = likenesses(levels)
    # Means of normals: noise 0, 38 / 3, 64 / 3; density 43 / 3
    normals = density.like["normal_median"]
    assert normals[EVERYTHING].sigma == pytest.approx(0.004 + 0.004 * 5 / 26)
    assert normals["chair"].sigma == pytest.approx(0.006) and normals["sofa"].sigma == pytest.approx(0.004)
    assert density.like[COST][EVERYTHING].sigma == pytest.approx(0.006)
    assert sdf.like["normal_median"][EVERYTHING].beyond == 1 and sdf.like["normal_median"]["sofa"].beyond == 0
    assert sdf.like[COST][EVERYTHING].beyond == -1
    assert set(density.like) == {"normal_median", COST}, "labels have no other figure here"
    # A training on the level itself is no answer to which noise to train with
    assert density.best.number == sdf.best.number == 1
    assert density.score.mean == pytest.approx(24 + 1 / 3) and density.score.error > 0
    assert density.ahead.mean == pytest.approx(0.5) and density.over_mixed.mean == pytest.approx(1.0)
    assert sdf.ahead.mean == pytest.approx(0.5) and sdf.over_mixed.mean == pytest.approx(1.5)


def test_words_and_tables_say_it(levels: list[Level], tmp_path: Path) -> None:
    found = likenesses(levels)
    text = sentences(levels, found)
    assert "from sigma 0 to sigma 0.008 PSNR of (D + R) S' with true D and R changes by -6.00" in text[0]
    assert text[3].startswith("density: like sigma 0.0048 (objects: 0.004 to 0.006) by deviation of normals, median")
    assert "that on sigma 0.004 is best on it: 24.33" in text[3] and "+0.50 ± 0.00 dB against the next" in text[3]
    assert text[4].startswith("sdf, views 20: like sigma > 0.008 (objects: 0.0075 to > 0.008)")
    assert "< 0 (objects: < 0 to < 0) by PSNR of (D + R) S'" in text[4]
    write_likeness(found, tmp_path / "likeness.csv")
    with (tmp_path / "likeness.csv").open(newline="") as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == 2 * 2 * 3 and {line["object"] for line in lines} == {"all", "chair", "sofa"}
    assert [line["beyond"] for line in lines if line["by"] == COST] == ["0"] * 3 + ["-1"] * 3
    write_table(levels, tmp_path / "levels.csv", axis_of("normal_median"))
    with (tmp_path / "levels.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert {(line["rough"], line["sigma"]) for line in table} == {
        ("sigma 0", "0"), ("sigma 0.004", "0.004"), ("sigma 0.008", "0.008"), ("density", ""), ("sdf, views 20", "")}


def test_both_kinds_share_an_axis_with_marks_of_their_own(levels: list[Level]) -> None:
    for figure in (quality_figure(levels, "", axis_of("normal_median")),
                   changes_figure(levels, "", axis_of("normal_median"))):
        lines = [bars.lines[0] for bars in figure.axes[0].containers]
        curves, marks = ([line for line in lines if (line.get_linestyle() == "None") == alone]
                         for alone in (False, True))
        assert all(list(line.get_xdata()) == pytest.approx([0, 38 / 3, 64 / 3]) for line in curves)
        assert {(line.get_marker(), float(line.get_xdata()[0])) for line in marks} == {("D", 43 / 3), ("P", 24.0)}
        own = [line for line in marks if line.get_color() == curves[1].get_color()]
        assert [line.get_marker() for line in own] == ["D"], "the second field has no training of its own"
        named = [text.get_text() for text in figure.legends[0].get_texts()]
        assert "mesh from a density: 3: density" in named
        assert "mesh from a signed distance: 4: sdf, views 20" in named
        assert OWN not in named
