import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.cli.common import gigabytes, positive_number
from dataset_builder.cli.main import main
from dataset_builder.planning.cost import Cost, CostEstimate, estimate
from dataset_builder.planning.fleet import Bill, Fleet, bill
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import backend
from dataset_builder.spec.resolve import LoadedSpec
from tests.small_specs import write_spec

Load = Callable[..., LoadedSpec]


def test_a_bill_by_hand() -> None:
    """Two hours of work for each of 50 workers, done twice as fast: 50 worker-hours at 0.04, and 30 GB at 0.1."""
    cost = CostEstimate(total=Cost(seconds=7200, bytes=30e9), error=Cost(seconds=720), examples=1, views=1, tried=1,
                        planned=1, problems=(), runs={})
    paid = bill(cost, Fleet(workers=50, speed=2, price=0.04, egress=0.1))
    assert paid == Bill(seconds=3600, error=360, worker_hours=50, money=pytest.approx(2), egress=pytest.approx(3))


def test_workers_share_views_and_more_than_views_are_idle(load: Load, dataset_data: dict[str, Any]) -> None:
    planner = Planner(load(dataset_data))
    one = estimate(planner, views=1000)
    for workers, share in ((2, 2), (one.views, one.views), (7 * one.views, one.views)):
        many = estimate(planner, views=1000, cores=workers)
        assert many.total.seconds == pytest.approx(one.total.seconds / share)
        assert replace(many.total, seconds=0) == replace(one.total, seconds=0)


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", "1e9", "x", ""])
def test_prices_and_speeds_are_positive_numbers(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="expected a number above 0"):
        positive_number(text)
    assert positive_number("0.5") == 0.5


@pytest.mark.parametrize(("text", "size"), [("4", 4 * 10**9), ("4GB", 4 * 10**9), ("4 GiB", 2**32), ("0.5mib", 2**19),
                                            ("1e3", 10**12), ("0", 0)])
def test_sizes_are_gb_or_say_their_unit(text: str, size: int) -> None:
    assert gigabytes(text) == size


@pytest.mark.parametrize("text", ["-1", "GB", "4 G", "4GiBB", "nan", "1e99GB", "4 apples", ""])
def test_other_sizes_are_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="or a number with a unit, such as 500MiB, got"):
        gigabytes(text)


def test_plan_takes_the_workers_of_a_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """One on a GPU, be it asked for or found; one per core elsewhere."""
    monkeypatch.setattr(backend, "cores", lambda: 6)
    for there in (False, True):
        monkeypatch.setattr(backend, "gpu_usable", lambda there=there: there)
        assert [backend.default_workers(wanted) for wanted in ("llvm", "cuda", "auto")] == [6, 1, 1 if there else 6]


def test_a_price_on_a_gpu_needs_its_speed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = write_spec(tmp_path)
    assert main(["plan", str(spec), "--backend", "cuda", "--price", "2"]) == 2
    assert "--price: expected --speed with it on a GPU" in capsys.readouterr().err
    assert main(["plan", str(spec), "--backend", "cuda", "--price", "2", "--speed", "10", "--views", "2"]) == 0
    assert "time on 1 GPU" in capsys.readouterr().out
