"""Knees and ratios of curves whose law is known, and tables that come back as they were."""

import math
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.studies.accuracy.bounds import relative_difference, worst
from dataset_builder.studies.accuracy.curves import PRICE, TOLERABLE, curve, equal_error, knee, price
from dataset_builder.studies.accuracy.precision import drifts
from dataset_builder.studies.accuracy.rows import AccuracyRow, read_table, write_table

GAIN = 400.0
"""With it, every error of the uniform curve is tolerable: 1/20 at one sample."""


def sampled(question: str, spp: float, *, fixed: float = 0.0, gain: float = 1.0, bias: float = 0.0, floor: float = 0.0,
            example: str = "00000000", spread: float = 0.0) -> AccuracyRow:
    """A row that obeys Monte Carlo's law: relMSE 1 / (gain spp) + bias, a second for 100 spp and a fixed time."""
    relmse = 1 / (gain * spp) + bias
    return AccuracyRow(question=question, setting=f"{spp:g}", value=spp, example=example, layer="i_t",
                       seconds=fixed + spp / 100, spp=spp, spp_min=spp - spread, spp_max=spp + spread, paths=spp * 1000,
                       relmse=relmse, relmse_measured=relmse + floor, relmse_reference=floor, floor=floor,
                       psnr=30.0, flip=0.1)


def uniform(**law: float) -> list[AccuracyRow]:
    """The uniform curve from 1 to 1024 spp."""
    return [sampled("uniform", 4.0**k, **law) for k in range(6)]


def test_halving_costs_four_times_by_the_law() -> None:
    first, second, *_ = curve(uniform(gain=GAIN), "uniform", "i_t")
    assert price(first, second) == pytest.approx(4)
    assert knee(curve(uniform(gain=GAIN), "uniform", "i_t")) == first


def test_fixed_costs_move_the_knee() -> None:
    # From n to 16 n spp, two steps, halving costs sqrt((16 n + c) / (n + c)): 3.5 from n = 3 c on
    for spp, fixed in ((4.0, 0.01), (16.0, 0.04), (64.0, 0.16)):
        found = knee(curve(uniform(fixed=fixed, gain=GAIN), "uniform", "i_t"))
        assert found is not None and found.value == spp
        assert math.sqrt((16 * spp / 100 + fixed) / (spp / 100 + fixed)) >= PRICE


def test_bias_is_a_knee() -> None:
    found = knee(curve(uniform(fixed=10.0, bias=0.1 / GAIN, gain=GAIN), "uniform", "i_t"))
    assert found is not None and found.value == 64


def test_what_is_not_tolerable_is_no_knee() -> None:
    """1 / sqrt(spp) is at most a tenth from 100 spp on."""
    found = knee(curve(uniform(), "uniform", "i_t"))
    assert found is not None and found.value == 256 and found.error <= TOLERABLE


def test_where_nothing_is_tolerable_the_most_accurate_is_taken() -> None:
    found = knee(curve(uniform()[:4], "uniform", "i_t"))
    assert found is not None and found.value == 64 and found.error > TOLERABLE


def test_what_the_reference_hides_is_an_upper_bound_and_no_knee() -> None:
    points = curve(uniform(fixed=100.0, floor=0.01), "uniform", "i_t")
    assert [point.at_floor for point in points] == [False] * 4 + [True] * 2
    assert points[-1].error == pytest.approx(math.sqrt(1 / 1024 + 0.01))
    best = knee(points)
    assert best is not None and not best.at_floor


def test_equal_error_of_a_method_twice_as_good() -> None:
    rows = uniform() + [sampled("adaptive", spp, gain=2, spread=1) for spp in (4, 40, 400)]
    found = equal_error(rows)
    assert len(found) == 3
    assert [ratio.seconds for ratio in found] == pytest.approx([0.5] * 3)
    assert [ratio.paths for ratio in found] == pytest.approx([0.5] * 3)


def test_equal_error_leaves_out_what_cannot_be_told() -> None:
    beyond = sampled("adaptive", 1e5, spread=1)
    other = sampled("adaptive", 16, spread=1, example="00000001")
    hidden = sampled("adaptive", 16, spread=1, floor=1.0)
    at_once = sampled("adaptive", 16)
    assert equal_error([*uniform(), beyond, other, hidden, at_once]) == []


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
    assert text.splitlines()[0].startswith("question,setting,value,example,layer,seconds,spp,")
