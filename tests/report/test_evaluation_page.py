"""The files of an evaluation say what its rows say."""

import csv
import re
from collections.abc import Callable
from io import BytesIO, StringIO
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.errors import OutputError
from dataset_builder.lightnet.measures.metrics import METRICS, Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.report.evaluation_page import (
    COLUMNS,
    Evaluation,
    console_table,
    csv_table,
    markdown,
    summary_figure,
    verdict_lines,
    write_page,
)
from dataset_builder.report.page_parts import png
from dataset_builder.seeding import rng

NAMES = ("net", "other", "copy_i_s")


def rows(objects: int = 4) -> list[ScoreRow]:
    """Eight examples of a few objects, by three methods of different quality."""
    made = []
    for index in range(8):
        for place, name in enumerate(NAMES):
            psnr, l1 = (float(value) for value in rng(0, name, index).uniform(0, 1, 2))
            metrics = Metrics(l1=0.02 + 0.03 * place + 0.01 * l1, psnr=28 - 4 * place + psnr, ssim=0.9, lab=0.3)
            made.append(ScoreRow(method=name, key=f"{index:08d}", view=f"evaluation/{index // 2:06d}",
                                 object=f"evaluation-chair-{index % objects:02d}", room="evaluation-room-00",
                                 level=index % 2, sigma=0.004, metrics=metrics, seconds=0.01 * (place + 1)))
    return made


def evaluation(objects: int = 4, *, seen: bool = False) -> Evaluation:
    """Two trained methods and one that learns nothing."""
    return Evaluation(dataset="mini", split="evaluation", rows=rows(objects), trained=NAMES[:2], seen=seen,
                      notes={name: f"about {name}" for name in NAMES})


def cells(text: str, first: str) -> list[str]:
    """Cells of the line of a Markdown table that begins with `first`."""
    line = next(line for line in text.splitlines() if line.startswith(f"| {first}"))
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_table_has_every_row_and_its_figures() -> None:
    lines = list(csv.DictReader(StringIO(csv_table(rows()).decode())))
    assert len(lines) == 24 and tuple(lines[0]) == COLUMNS
    for line, row in zip(lines, rows(), strict=True):
        assert (line["method"], line["key"], line["object"], line["level"]) == (row.method, row.key, row.object,
                                                                                str(row.level))
        for metric in METRICS:
            assert float(line[metric.name]) == pytest.approx(getattr(row.metrics, metric.name), rel=1e-6)


def test_the_summary_has_the_means_of_the_table() -> None:
    lines = list(csv.DictReader(StringIO(csv_table(rows()).decode())))
    text = markdown(evaluation())
    assert cells(text, "PSNR")[1:] == [f"{mean:.2f} ± {error:.2f}" for mean, error in map(by_hand(lines), NAMES)]
    assert cells(text, "seconds")[1:] == ["0.01", "0.02", "0.03"]
    assert cells(text, "metric")[1:] == list(NAMES)
    assert "8 examples, 4 views, 4 objects, 1 room." in text


def by_hand(lines: list[dict[str, str]]) -> Callable[[str], tuple[float, float]]:
    """Mean PSNR of a method and its standard error, from the means of its four objects of two examples each."""
    def found(name: str) -> tuple[float, float]:
        own = {line["key"]: float(line["psnr"]) for line in lines if line["method"] == name}
        means = [(own[f"{index:08d}"] + own[f"{index + 4:08d}"]) / 2 for index in range(4)]
        return float(np.mean(means)), float(np.std(means, ddof=1)) / sqrt(4)

    return found


def test_every_pair_is_compared_in_every_metric() -> None:
    text = markdown(evaluation())
    for pair in ("net - other", "net - copy_i_s", "other - copy_i_s"):
        assert sum(line.startswith(f"| {pair} |") for line in text.splitlines()) == len(METRICS)
    assert "other - net" not in text
    _, metric, difference, naive, interval, ahead, verdict = cells(text, "net - copy_i_s | PSNR")
    assert (metric, ahead, verdict) == ("PSNR", "8 of 8", "better") and naive.startswith("± ")
    mean, error = (float(number) for number in difference.split(" ± "))
    low, high = (float(number) for number in interval.split(" to "))
    assert (low + high) / 2 == pytest.approx(mean, abs=0.02)
    assert (high - low) / 2 == pytest.approx(3.182 * error, abs=0.05)


def test_one_object_says_nothing_of_others() -> None:
    text = markdown(evaluation(objects=1))
    assert "1 object," in text and "one object: none" in text
    assert "±" not in cells(text, "PSNR")[1] and cells(text, "net - copy_i_s | PSNR")[-1] == "not told apart"
    assert png(summary_figure(evaluation(objects=1)))


def test_definitions_notes_and_warnings_are_there() -> None:
    text = markdown(evaluation())
    assert all(f"- {metric.symbol}: {metric.definition}." in text for metric in METRICS)
    assert all(f"- {name}: about {name}" in text for name in NAMES)
    told = Evaluation(**{**vars(evaluation()), "remarks": ["split evaluation: 1 of 9 left out"]})
    assert "Split evaluation: 1 of 9 left out." in markdown(told) and told.remarks[0] in verdict_lines(told)
    assert "trained on this split" not in text and "trained on this split" in markdown(evaluation(seen=True))


def test_the_terminal_shows_the_same() -> None:
    found = evaluation()
    table = console_table(found)
    assert [next(iter(column.cells)) for column in table.columns][:3] == [
        "net", cells(markdown(found), "L1")[1], cells(markdown(found), "PSNR")[1]]
    lines = verdict_lines(found)
    assert len(lines) == 3 and re.fullmatch(
        r"net against copy_i_s: \+\d\.\d\d ± 0\.\d\d dB, better; better in 8 of 8", lines[1])


def test_the_figure_shows_every_method_in_every_metric() -> None:
    figure = summary_figure(evaluation())
    assert [axes.get_title().split(":")[0] for axes in figure.axes] == [metric.symbol for metric in METRICS]
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == list(NAMES)
    means = [line.get_xdata()[0] for line in figure.axes[1].lines if len(line.get_xdata()) == 1 and
             line.get_marker() == "o"]
    expected = [np.mean([row.metrics.psnr for row in rows() if row.method == name]) for name in NAMES]
    assert means == pytest.approx(expected)


def test_files_are_written_whole(tmp_path: Path) -> None:
    write_page(evaluation(), tmp_path / "new")
    assert {path.name for path in (tmp_path / "new").iterdir()} == {"table.csv", "summary.md", "summary.png"}
    with Image.open(BytesIO((tmp_path / "new" / "summary.png").read_bytes())) as picture:
        assert picture.width > 1500
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="choose another output folder"):
        write_page(evaluation(), tmp_path / "file")


def test_one_object_has_no_error_over_objects_and_that_is_said() -> None:
    """Nothing that is no number is printed for it."""
    said = "One object: no standard error over objects, and no difference is told apart"
    texts = [markdown(evaluation(1)), "\n".join(verdict_lines(evaluation(1)))]
    assert all(said in text and not re.search(r"\b(nan|inf)\b", text) for text in texts)
    assert said not in markdown(evaluation(2)) and said not in verdict_lines(evaluation(2))
