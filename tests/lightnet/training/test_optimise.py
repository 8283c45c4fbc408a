"""One step: every phase moves its own parameters, none where a loss is not finite; rates depend on the step alone."""

from collections.abc import Iterable

import pytest
import torch
from torch import nn

from dataset_builder.lightnet.data.batch import Batch, Inputs, Prediction, Truth
from dataset_builder.lightnet.methods.method import Loss, Method
from dataset_builder.lightnet.settings import OptimiserSpec, TrainingSpec
from dataset_builder.lightnet.training.optimise import LAST, Optimisers, rate_at

PLAIN = TrainingSpec(optimiser=OptimiserSpec(rate=0.1, schedule="constant", warm_up=0, clip=0))


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


class Duel(Method):
    """Two numbers, a phase each: the second phase's loss depends on the first number too."""

    phases = ("one", "two")

    def __init__(self) -> None:
        super().__init__()
        self.a, self.b = nn.Parameter(torch.tensor(1.0)), nn.Parameter(torch.tensor(2.0))
        self.spoil: dict[str, str] = {}

    def forward(self, inputs: Inputs) -> Prediction:
        return Prediction(i_t=inputs.i_s * self.b)

    def parameters_of(self, phase: str) -> Iterable[nn.Parameter]:
        return [self.a if phase == "one" else self.b]

    def loss(self, phase: str, batch: Batch, prediction: Prediction) -> Loss:
        if phase == "one":
            total = (self.a - prediction.i_t.detach().mean()) ** 2
        else:
            total = (prediction.i_t.mean() - self.a) ** 2
        if self.spoil.get(phase) == "loss":
            total = total * float("nan")
        if self.spoil.get(phase) == "gradient":
            total = total + torch.sqrt(0 * self.b) + 0 * torch.sqrt(0 * self.a)
        return Loss(total=total, terms={phase: total.detach()})


def batch() -> Batch:
    ones = torch.ones(1, 3, 4, 4)
    inputs = Inputs(i_s=ones, s_prime=ones, inside=ones[:, :1], sh=torch.zeros(1, 3, 9))
    return Batch(keys=("00000000",), exposure=torch.ones(1), inputs=inputs, truth=Truth(i_t=ones, d=ones, r=0 * ones))


def step(method: Duel, optimisers: Optimisers) -> str:
    return optimisers.step(method, batch(), method(batch().inputs), 0).skipped


def test_each_phase_moves_its_own() -> None:
    method = Duel()
    taken = Optimisers(method, PLAIN).step(method, batch(), method(batch().inputs), 0)
    # Adam's first step has the size of the rate: a goes towards 2; b towards a, which has moved before
    assert method.a.item() == pytest.approx(1.1) and method.b.item() == pytest.approx(1.9)
    assert taken.loss == pytest.approx({"one": 1.0, "two": 0.9**2})
    assert taken.skipped == "" and taken.rate == 0.1
    assert taken.norm == pytest.approx(2.0)


@pytest.mark.parametrize("kind", ["loss", "gradient"])
@pytest.mark.parametrize(("phase", "moved"), [("one", (False, False)), ("two", (True, False))])
def test_nothing_moves_from_the_first_phase_on_that_is_not_finite(kind: str, phase: str,
                                                                  moved: tuple[bool, bool]) -> None:
    method = Duel()
    method.spoil = {phase: kind}
    skipped = step(method, Optimisers(method, PLAIN))
    assert skipped.startswith(f"{phase}: the {kind} is not finite")
    assert (method.a.item() != 1.0, method.b.item() != 2.0) == moved
    assert bool(torch.isfinite(method.a)) and bool(torch.isfinite(method.b))


def test_a_bad_step_leaves_the_moments_alone() -> None:
    spoilt, plain = Duel(), Duel()
    one, other = Optimisers(spoilt, PLAIN), Optimisers(plain, PLAIN)
    spoilt.spoil = {"one": "gradient"}
    assert step(spoilt, one)
    spoilt.spoil = {}
    assert not step(spoilt, one) and not step(plain, other)
    assert spoilt.a.item() == plain.a.item() and spoilt.b.item() == plain.b.item()


def test_gradients_are_clipped_by_their_norm() -> None:
    method = Duel()
    clipping = PLAIN.model_copy(update={"optimiser": PLAIN.optimiser.model_copy(update={"clip": 0.5})})
    taken = Optimisers(method, clipping).step(method, batch(), method(batch().inputs), 0)
    assert taken.norm == pytest.approx(2.0)
    assert method.a.grad.abs().item() == pytest.approx(0.5, rel=1e-4)
