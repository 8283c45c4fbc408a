"""What is said of the order of a table's rows, with one seed and with several; scores come back from disk."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.lightnet.measures.metrics import METRICS, Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.report.table_page import markdown, table_figure
from dataset_builder.seeding import rng
from dataset_builder.studies.tables import paper, table_kinds
from dataset_builder.studies.tables.result import Order, RowResult, orders, over_seeds, printed_pairs, verdict
from dataset_builder.studies.trainings import base_of, read_scores, write_scores

BASE = base_of(TrainingSpec())


def made(psnr: Sequence[float], others: Sequence[str], method: str = "x") -> tuple[ScoreRow, ...]:
    """Scores of one seed: only PSNR varies; objects are given."""
    return tuple(ScoreRow(method=method, key=f"{index:08d}", view=f"test/{index}", object=name, room="r", level=0,
                          sigma=0.0, metrics=Metrics(l1=0.1, psnr=value, ssim=0.5, lab=0.2), seconds=1.0)
                 for index, (value, name) in enumerate(zip(psnr, others, strict=True)))


OBJECTS = [f"object-{index // 2}" for index in range(16)]
BASIC = list(rng(3, "difficulty").normal(25, 3, 16))


def table_of(gains: dict[str, float], noise: float, seeds: int = 1, off: Sequence[str] = ()) -> list[RowResult]:
    """Results of table 1's methods: difficulty of the example, a gain by method, and noise of its own."""
    table = table_kinds.methods(BASE)
    return [RowResult(row=table.row(name), facts={"off": list(off)}, scores=tuple(
        made([value + gain + step for value, step in zip(BASIC, rng(4, name, seed).normal(0, noise, 16), strict=True)],
             OBJECTS) for seed in range(seeds))) for name, gain in gains.items()]


PRINTED = {"pix2pix": -3.5, "dpr": -5.0, "ssvbrdf": -4.2, "lightnet": 0.0}


def psnr_order(found: list[RowResult]) -> Order:
    return next(order for order in orders(table_kinds.methods(BASE), found) if order.metric == "psnr")


def test_printed_pairs_go_the_way_each_metric_is_better() -> None:
    low = printed_pairs(paper.METHODS, "l1", "low")
    assert ("lightnet", "pix2pix", pytest.approx(0.0126)) in low and len(low) == 10
    assert ("lightnet", "dpr", pytest.approx(0.045)) in printed_pairs(paper.METHODS, "ssim", "high")
    equal = {"a": paper.FULL, "b": paper.FULL}
    assert printed_pairs(equal, "psnr", "high") == []


def test_an_order_that_is_as_printed_is_recognised() -> None:
    """Examples differ by far more than methods, which only pairs of the same example see through."""
    found = psnr_order(table_of(PRINTED, noise=0.1))
    assert found.kendall == 1 and found.count("as printed") == 6 and found.count("against") == 0
    assert [pair.printed for pair in found.pairs if (pair.better, pair.worse) == ("lightnet", "dpr")] == [
        pytest.approx(4.78)]
    text = verdict([found])
    assert text == "The paper's order is reproduced, by all metrics and pairs."


def test_the_reverse_order_is_recognised() -> None:
    found = psnr_order(table_of({name: -gain for name, gain in PRINTED.items()}, noise=0.1))
    assert found.kendall == -1 and found.count("against") == 6
    assert "not reproduced: 6 of 6 pairs are told apart, 6 of them against it" in verdict([found])


def test_equal_rows_are_not_told_apart() -> None:
    """64 tables of methods that are equal: 5 % of pairs are told apart by chance. Bounds are exceeded once in 10^4."""
    told = 0
    for number in range(64):
        found = [RowResult(row=table_kinds.methods(BASE).row(name), facts={}, scores=(made(list(
            np.add(BASIC, rng(number, name).normal(0, 1, 16))), OBJECTS),)) for name in ("pix2pix", "lightnet")]
        told += len(psnr_order(found).pairs) - psnr_order(found).count("not told apart")
    assert told <= 11, "binomial with 64 draws of 5 %"
    assert "neither" in verdict([psnr_order(table_of(dict.fromkeys(PRINTED, 0.0), noise=0.0))])


def test_rows_with_losses_off_are_told() -> None:
    found = table_of(PRINTED, noise=0.1, off=["fr is off, its weight 0.05 is not used: it needs --vgg-weights"])
    assert all(pair.altered for pair in psnr_order(found).pairs)
    assert "In 6 of 6 pairs a row has losses off" in verdict([psnr_order(found)])
    page = markdown(table_kinds.methods(BASE), found, "settings")
    assert "LighTNet (FR off: no weights)" in page


def test_seeds_widen_the_interval_of_a_difference() -> None:
    """By hand: two seeds whose means are 1 and 3 on the same two objects; the variance of their mean is 1."""
    found = over_seeds([[1.0, 1.0], [3.0, 3.0]], ["a", "b"])
    assert (found.mean, found.error) == (2.0, pytest.approx(1.0))
    assert over_seeds([[1.0, 3.0]], ["a", "b"]).error == pytest.approx(1.0)
    found = table_of(PRINTED, noise=0.1, seeds=3)
    assert found[0].spread("psnr") > 0 and np.isnan(table_of(PRINTED, noise=0.1)[0].spread("psnr"))


def test_intervals_over_two_seeds_cover_the_truth() -> None:
    """2000 draws of six objects with two examples each, where trainings differ by more than objects: a share of 95% has
    a deviation of 0.49%, the bound is four below. Intervals of six objects' freedom cover 80% here."""
    stream, covered = rng(5, "coverage"), 0
    objects = [name for name in "abcdef" for _ in range(2)]
    for _ in range(2000):
        truth = 0.3 * stream.normal(size=6).repeat(2)[None] + stream.normal(size=(2, 1))
        found = over_seeds(truth.tolist(), objects)
        covered += abs(found.mean) <= found.half_width
    assert covered / 2000 > 0.95 - 4 * 0.0049


def test_a_table_shows_printed_rows_that_were_not_measured() -> None:
    page = markdown(table_kinds.methods(BASE), table_of(PRINTED, noise=0.1), "settings")
    assert "Not measured: LighTNet†, trained on I_s of fields" in page and "PSNR 29.93" in page and "| 30.17 |" in page
    assert len(table_figure(table_kinds.methods(BASE), table_of(PRINTED, noise=0.1), "settings").axes) == len(METRICS)


def test_scores_are_read_back_to_the_last_digit(tmp_path: Path) -> None:
    scores = made([float(np.nextafter(20, 21)), 1 / 3, float("nan")], ["a", "b, c", 'd "e"'])
    write_scores(scores, tmp_path / "scores.csv")
    back = read_scores(tmp_path / "scores.csv")
    assert back[:2] == scores[:2] and np.isnan(back[2].metrics.psnr)
    (tmp_path / "scores.csv").write_text("key\n1\n")
    assert read_scores(tmp_path / "scores.csv") == () == read_scores(tmp_path / "none.csv")
