import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from dataset_builder.cli.common import positive_number
from dataset_builder.planning.cost import Cost, CostEstimate, estimate
from dataset_builder.planning.fleet import Bill, Fleet, bill
from dataset_builder.planning.plan import Planner
from dataset_builder.spec.resolve import LoadedSpec

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
