"""Curves of known rows, and tables that come back as they were."""

import math
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.studies.accuracy.bounds import relative_difference, worst
from dataset_builder.studies.accuracy.curves import curve
from dataset_builder.studies.accuracy.precision import drifts
from dataset_builder.studies.accuracy.rows import AccuracyRow, read_table, write_table
from tests.studies.accuracy.made_rows import sampled, uniform


def test_what_the_reference_hides_is_an_upper_bound() -> None:
    points = curve(uniform(fixed=100.0, floor=0.01), "uniform", "i_t")
    assert [point.at_floor for point in points] == [False] * 4 + [True] * 2
    assert points[-1].error == pytest.approx(math.sqrt(1 / 1024 + 0.01))


def test_depth_is_judged_by_the_worst() -> None:
    rows = [AccuracyRow(question="depth", setting="", value=depth, example="", layer="", bias=bias, bias_se=error)
            for depth, bias, error in ((2, -0.1, 0.01), (2, 0.05, 0.01), (4, 0.01, 0.0))]
    assert worst(rows) == pytest.approx({2: 0.12, 4: 0.01})


def test_relative_difference_by_hand() -> None:
    keep = np.array([[True, False]])
    assert relative_difference(np.array([[[3.0], [9]]]), np.array([[[2.0], [1]]]), keep) == pytest.approx(0.5)
    assert relative_difference(np.ones((1, 2, 1)), np.zeros((1, 2, 1)), keep) == 0


def test_float32_sums_drift_and_batches_do_not() -> None:
    # From 2^24 on, float32 cannot add 1
    samples = np.ones(2**24 + 2**20, dtype=np.float32)
    running, batched, noise = drifts(samples, 1024)
    assert running == pytest.approx(1 / 17, rel=1e-6) and batched == 0 and noise == 0


def test_sums_whose_length_is_no_multiple_of_the_batch() -> None:
    running, batched, _ = drifts(np.arange(1, 8, dtype=np.float32), 4)
    assert running == batched == 0


def test_the_table_comes_back(tmp_path: Path) -> None:
    rows = [sampled("uniform", 4), AccuracyRow(question="codecs", setting="float16, zip", value=math.nan, example="7",
                                               layer="all", bytes=12)]
    write_table(rows, tmp_path / "results.csv")
    write_table(read_table(tmp_path / "results.csv"), tmp_path / "again.csv")
    text = (tmp_path / "results.csv").read_text()
    assert (tmp_path / "again.csv").read_text() == text
    assert text.splitlines()[0].startswith("question,setting,value,example,layer,replicate,seconds,cpu_seconds,spp,")
