"""Means and errors by hand, intervals that cover what they say, and who is called better."""

from math import inf, isnan, sqrt

import numpy as np
import pytest

from dataset_builder.lightnet.measures.metrics import METRICS, Metrics
from dataset_builder.lightnet.results.clustered_means import Paired, chosen, compare, estimate, methods, summarise
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.seeding import rng


def row(method: str, index: int, psnr: float, *, thing: str = "", l1: float = 0.1, seconds: float = 1.0) -> ScoreRow:
    """A row whose other figures do not matter."""
    return ScoreRow(method=method, key=f"{index:08d}", view=f"evaluation/{index:06d}",
                    object=thing or f"object-{index}", room="room", level=0, sigma=0.004, seconds=seconds,
                    metrics=Metrics(l1=l1, psnr=psnr, ssim=0.5, lab=0.2))


def by_metric(found: list[Paired], name: str) -> Paired:
    """The comparison in one metric."""
    return next(one for one in found if one.metric == name)


def test_an_object_each_gives_the_usual_standard_error() -> None:
    values = [1.0, 2.0, 4.0, 9.0]
    found = estimate(values, ["a", "b", "c", "d"])
    assert found.mean == 4.0 and (found.examples, found.objects) == (4, 4)
    assert found.error == pytest.approx(np.std(values, ddof=1) / 2, rel=1e-12) == pytest.approx(found.naive)


def test_examples_of_one_object_count_together() -> None:
    found = estimate([1.0, 1.0, 3.0, 3.0], ["a", "a", "b", "b"])
    assert found.error == pytest.approx(1.0) and found.naive == pytest.approx(sqrt(1 / 3))
    assert found.half_width == pytest.approx(12.706, rel=1e-4)


def test_looking_again_at_the_same_examples_teaches_nothing() -> None:
    values, objects = [1.0, 2.0, 4.0, 9.0, 5.0], ["a", "b", "c", "d", "d"]
    once, often = estimate(values, objects), estimate(values * 7, objects * 7)
    assert often.error == pytest.approx(once.error, rel=1e-12)
    assert often.naive < 0.5 * once.naive


def test_one_object_has_no_error() -> None:
    found = estimate([1.0, 2.0], ["a", "a"])
    assert isnan(found.error) and found.naive == pytest.approx(0.5) and found.half_width == inf
    assert isnan(estimate([1.0], ["a"]).naive)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    """4000 draws of six objects with five like examples each: a share of 95% has a deviation of 0.34%, bounds are 4."""
    stream = rng(0, "coverage")
    objects = [name for name in "abcdef" for _ in range(5)]
    covered = naively = 0
    for _ in range(4000):
        values = stream.normal(size=6).repeat(5) + 0.3 * stream.normal(size=30)
        found = estimate(list(values), objects)
        covered += abs(found.mean) <= found.half_width
        naively += abs(found.mean) <= 1.96 * found.naive
    assert 0.9362 < covered / 4000 < 0.9638
    assert naively / 4000 < 0.7


def test_summaries_by_method_in_order() -> None:
    rows = [row("net", 0, 20.0, seconds=3.0), row("copy", 0, 10.0), row("net", 1, 24.0, seconds=1.0),
            row("copy", 1, 12.0), row("net", 2, 22.0, seconds=2.0)]
    net, copy = summarise(rows)
    assert methods(rows) == ["net", "copy"] == [net.method, copy.method]
    assert net.metrics["psnr"].mean == 22.0 and net.metrics["psnr"].error == pytest.approx(2 / sqrt(3))
    assert net.seconds == 2.0 and copy.metrics["psnr"].examples == 2
    assert set(net.metrics) == {metric.name for metric in METRICS}


def test_differences_are_taken_on_the_same_examples() -> None:
    gains = [1.0, 2.0, 3.0]
    hard = [10.0, 20.0, 30.0]
    rows = [row("copy", index, value) for index, value in enumerate(hard)]
    rows += [row("net", index, value + gain) for index, (value, gain) in enumerate(zip(hard, gains, strict=True))]
    rows.append(row("net", 7, 99.0))
    found = by_metric(compare(rows, "net", "copy"), "psnr")
    assert found.difference.mean == pytest.approx(2.0) and found.difference.error == pytest.approx(1 / sqrt(3))
    assert (found.ahead, found.difference.examples, found.verdict) == (3, 3, "open")
    back = by_metric(compare(rows, "copy", "net"), "psnr")
    assert back.difference.mean == pytest.approx(-2.0) and back.ahead == 0


@pytest.mark.parametrize(("gains", "verdict"), [
    ([1.0, 1.1, 0.9, 1.0], "better"), ([-1.0, -1.1, -0.9, -1.0], "worse"), ([1.0, -1.0, 2.0, -1.0], "open"),
    ([0.0, 0.0, 0.0, 0.0], "open"),
])
def test_verdicts_know_which_way_is_good(gains: list[float], verdict: str) -> None:
    rows = [row("net", index, 20 + gain, l1=0.5 - gain / 10) for index, gain in enumerate(gains)]
    rows += [row("copy", index, 20.0, l1=0.5) for index in range(4)]
    found = compare(rows, "net", "copy")
    assert by_metric(found, "psnr").verdict == verdict == by_metric(found, "l1").verdict


def test_one_object_tells_nobody_apart() -> None:
    rows = [row("net", index, 30.0, thing="chair") for index in range(9)]
    rows += [row("copy", index, 10.0, thing="chair") for index in range(9)]
    assert by_metric(compare(rows, "net", "copy"), "psnr").verdict == "open"


def test_best_median_and_worst() -> None:
    rows = [row("copy", 9, 50.0), *(row("net", index, psnr) for index, psnr in enumerate([21, 25, 17, 30, 25]))]
    assert {name: one.key[-1] for name, one in chosen(rows, "net").items()} == {"best": "3", "median": "4",
                                                                               "worst": "2"}
    assert [one.metrics.psnr for one in chosen(rows[1:5], "net").values()] == [30, 21, 17]
    assert [(name, one.key[-1]) for name, one in chosen(rows[1:3], "net").items()] == [("best", "1"), ("worst", "0")]
    assert list(chosen(rows, "copy")) == ["best"]
