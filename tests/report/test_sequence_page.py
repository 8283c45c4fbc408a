"""The verb on views that follow each other: every figure in files, what is missing said, misuse refused."""

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.lightnet.results.spreads import Spread
from dataset_builder.report.sequence_page import COLUMNS, spread_text
from tests.lightnet.formula_method import write_checkpoint
from tests.lightnet.turning_set import write_turning


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sequences of five views, of which one is missing; not to be changed."""
    return write_turning(tmp_path_factory.mktemp("turning") / "turning", sequences=2, missing=(4,))


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An untrained LighTNet."""
    return write_checkpoint(tmp_path_factory.mktemp("small") / "last.pt")


def lines(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_verb_writes_what_it_measured(folder: Path, checkpoint: Path, tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["evaluate", str(folder), "--checkpoint", str(checkpoint), "--sequence", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "split turn" in said and "9 of 10 views in 2 sequences, 7 neighbours; mean ± standard" in said
    methods = ["lightnet", "copy_i_s", "d_s_prime", "dr_s_prime", "truth"]
    rows = lines(out / "sequences.csv")
    assert tuple(rows[0]) == COLUMNS
    assert [(row["method"], row["sequence"], row["views"], row["neighbours"]) for row in rows] == [
        (method, name, views if method != "truth" else "0", pairs) for method in methods
        for name, views, pairs in (("", "9", "7"), ("turn-00-00-0-0", "4", "3"), ("turn-01-00-0-0", "5", "4"))]
    scores = [float(row["psnr"]) for row in lines(out / "table.csv") if row["method"] == "copy_i_s"]
    own = next(row for row in rows if row["method"] == "copy_i_s")
    assert float(own["psnr"]) == pytest.approx(np.mean(scores), rel=1e-5)
    assert float(own["psnr_sd"]) == pytest.approx(np.std(scores, ddof=1), rel=1e-4)
    pairs = lines(out / "flicker.csv")
    assert len(pairs) == 5 * 7
    assert float(own["flicker"]) == pytest.approx(np.mean([float(row["flicker"]) for row in pairs
                                                           if row["method"] == "copy_i_s"]), rel=1e-5)
    page = (out / "sequences.md").read_text()
    assert f"PSNR, dB (high is better) | {float(rows[0]['psnr']):.2f} ± {float(rows[0]['psnr_sd']):.2f}" in page
    assert "## By sequence" in page and "copy_i_s: L1 " in said and "truth: flicker " in said
    with Image.open(out / "sequences.png") as figure:
        assert figure.width > 1000


def test_sequences_need_all_of_their_views(folder: Path, checkpoint: Path, tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["evaluate", str(folder), "--checkpoint", str(checkpoint), "--sequence", "--out", str(tmp_path / "out")]
    assert main([*asked, "--examples", "3"]) == 2
    assert "--examples: expected none beside --sequence, which needs every view, got 3" in capsys.readouterr().err
    assert main([*asked, "--split", "train"]) == 2
    assert "expected sequences, got views that do not follow each other" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_deviations_are_shown_where_there_are_some() -> None:
    assert spread_text(Spread(mean=27.5716, deviation=1.485, within=1.0, count=600), "psnr") == "27.57 ± 1.49"
    assert spread_text(Spread(mean=0.0366, deviation=float("nan"), within=float("nan"), count=1), "l1") == "0.0366"
