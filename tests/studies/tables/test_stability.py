"""The paper's table of stability: its numbers, and a small one whole."""

import csv
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.studies.tables import paper, table_kinds
from dataset_builder.studies.trainings import base_of
from tests.lightnet.synthetic import write_synthetic
from tests.lightnet.turning_set import write_turning

TINY = ("model={width: 4, downs: 2}", "data={crop: 32, batch: 2, workers: 0}", "check={every: 2, examples: 2}",
        "steps=2")


def table(folder: Path, out: Path) -> int:
    settings = [text for override in TINY for text in ("--set", override)]
    return main(["table", "stability", str(folder), "--out", str(out), "--device", "cpu", *settings])


def test_the_papers_numbers_and_what_it_says_of_them() -> None:
    mean, deviation = paper.STABILITY, paper.STABILITY_DEVIATIONS
    assert (mean["pix2pix"].l1, deviation["pix2pix"].l1, mean["lightnet"].psnr) == (0.0366, 0.0081, 31.7297)
    for metric, better in (("l1", -1), ("psnr", 1), ("ssim", 1), ("lab", -1)):
        assert better * (mean["lightnet"].of(metric) - mean["pix2pix"].of(metric)) > 0
        steadier = metric in ("ssim", "lab")
        assert (deviation["lightnet"].of(metric) < deviation["pix2pix"].of(metric)) == steadier


def test_rows_are_those_of_the_paper_and_two_that_learn_nothing() -> None:
    found = table_kinds.stability(base_of(TrainingSpec()))
    assert [(row.name, row.printed) for row in found.rows] == [
        ("pix2pix", paper.STABILITY["pix2pix"]), ("lightnet", paper.STABILITY["lightnet"]), ("copy_i_s", None),
        ("dr_s_prime", None)]
    assert found.rows[0].spec == table_kinds.methods(base_of(TrainingSpec())).rows[0].spec


def test_a_table_is_measured_on_the_sequences(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, out = write_turning(tmp_path / "set", sequences=2, frames=4, train=4, size=32), tmp_path / "out"
    assert table(folder, out) == 0
    said = capsys.readouterr().out
    assert "8 of 8 views in 2 sequences, 6 neighbours; mean ± standard deviation over views:" in said
    assert "L1: LighTNet's deviation over views is 1.20 times Pix2Pix's in the paper, " in said
    with (out / "lightnet/seed-0/scores.csv").open(encoding="utf-8") as stream:
        scores = [float(row["psnr"]) for row in csv.DictReader(stream)]
    assert len(scores) == 8
    page = (out / "stability.md").read_text()
    ours = f"{np.mean(scores):.2f} ± {np.std(scores, ddof=1):.2f}"
    psnr = next(line for line in page.splitlines() if line.startswith("| PSNR")).split(" | ")
    assert psnr[1] == "27.57 ± 1.49" and psnr[3:5] == ["31.73 ± 1.94", ours]
    head = next(line for line in page.splitlines() if line.startswith("| figure")).strip("| ").split(" | ")
    assert head == ["figure", "Pix2Pix, paper", "Pix2Pix", "LighTNet, paper", "LighTNet", "I_s as it is",
                    "(D + R) S', true D and R", "truth"]
    assert "not the paper's run" in page and (out / "table.md").is_file() and (out / "sequences.png").is_file()
    assert table(folder, out) == 0
    assert capsys.readouterr().out.count("kept from an earlier run") == 4


def test_a_dataset_without_sequences_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert table(write_synthetic(tmp_path / "set", train=2, held_out=2, size=32), tmp_path / "out") == 2
    assert "expected a split with sequences, got train, evaluation without" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
