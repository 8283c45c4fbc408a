"""The learning rate is a pure function of the step."""

import pytest

from dataset_builder.lightnet.settings import OptimiserSpec
from dataset_builder.lightnet.training.schedule import LAST, rate_at


def test_it_rises_in_equal_steps_and_then_stays() -> None:
    spec = OptimiserSpec(rate=0.4, warm_up=4, schedule="constant")
    assert [rate_at(step, 9, spec) for step in range(9)] == pytest.approx([0.1, 0.2, 0.3, *6 * [0.4]])


def test_half_a_cosine_ends_at_its_share() -> None:
    spec = OptimiserSpec(rate=1.0, warm_up=0, schedule="cosine")
    rates = [rate_at(step, 101, spec) for step in range(101)]
    assert rates[0] == 1.0
    assert rates[50] == pytest.approx((1 + LAST) / 2)
    assert rates[100] == pytest.approx(LAST)
    assert rates == sorted(rates, reverse=True)


@pytest.mark.parametrize("steps", [1, 2, 20])
def test_a_training_shorter_than_its_warm_up(steps: int) -> None:
    spec = OptimiserSpec(rate=1.0, warm_up=20)
    assert all(0 < rate_at(step, steps, spec) <= 1 for step in range(steps))
