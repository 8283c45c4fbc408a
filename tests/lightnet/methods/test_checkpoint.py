

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest
import torch
from torch import nn
from torch.utils._python_dispatch import TorchDispatchMode

from dataset_builder.lightnet.data.batch import Batch, Inputs
from dataset_builder.lightnet.methods.checkpoint import build_method
from dataset_builder.lightnet.methods.method import Method, count_parameters
from dataset_builder.lightnet.settings import Method as Name
from dataset_builder.lightnet.settings import ModelSpec, TrainingSpec
from tests.lightnet.random_batch import filled, random_batch

NAMES = get_args(Name)
BLIND = {"lightnet": ("sh",), "pix2pix": ("sh",), "dpr": ("s_prime",), "ssvbrdf": ("s_prime",)}
"""Inputs that a method does not look at."""


def spec_of(name: Name, *, seed: int = 0) -> TrainingSpec:
    return TrainingSpec(method=name, seed=seed, model=ModelSpec(width=4, downs=3))


def small(name: Name) -> Method:
    """A method all of whose heads say something."""
    torch.manual_seed(0)
    method = build_method(spec_of(name))
    for module in method.modules():
        if isinstance(module, nn.Conv2d) and not module.weight.any():
            nn.init.normal_(module.weight, 0, 0.3)
    return method


@pytest.mark.parametrize("name", NAMES)
def test_first_weights_depend_on_the_spec_alone(name: Name) -> None:
    torch.manual_seed(1)
    first = build_method(spec_of(name)).state_dict()
    torch.manual_seed(2)
    again, other = build_method(spec_of(name)).state_dict(), build_method(spec_of(name, seed=1)).state_dict()
    assert all(torch.equal(first[key], again[key]) for key in first)
    assert any(not torch.equal(first[key], other[key]) for key in first)


@pytest.mark.parametrize("name", NAMES)
def test_the_global_random_state_is_left_alone(name: Name) -> None:
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    build_method(spec_of(name))
    assert torch.equal(torch.rand(4), expected)


def test_every_seed_will_do() -> None:
    assert all(count_parameters(build_method(spec_of("lightnet", seed=seed))) for seed in (0, 2**64 - 1))


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_belongs_to_one_phase(name: Name) -> None:
    method = build_method(spec_of(name))
    owned = [id(parameter) for phase in method.phases for parameter in method.parameters_of(phase)]
    assert sorted(owned) == sorted(id(parameter) for parameter in method.parameters())


@pytest.mark.parametrize("name", NAMES)
def test_gradients_reach_every_parameter(name: Name) -> None:
    batch, method = random_batch(), small(name)
    prediction = method(batch.inputs)
    for phase in method.phases:
        found = gradients(method, phase, method.loss(phase, batch, prediction).total)
        assert all(bool((one != 0).any()) and bool(torch.isfinite(one).all()) for one in found)


def gradients(method: Method, phase: str, total: torch.Tensor) -> tuple[torch.Tensor, ...]:
    return torch.autograd.grad(total, list(method.parameters_of(phase)), retain_graph=True)


@pytest.mark.parametrize("name", NAMES)
def test_a_small_step_lowers_the_loss_by_as_much_as_the_gradient_says(name: Name) -> None:
    batch, method = random_batch(), small(name)
    for phase in method.phases:
        before = method.loss(phase, batch, method(batch.inputs)).total
        found = gradients(method, phase, before)
        square = sum(float(one.square().sum()) for one in found)
        # As large as makes the loss fall by a thousandth of it, to first order
        step = 1e-3 * float(before.detach()) / square
        with torch.no_grad():
            for parameter, gradient in zip(method.parameters_of(phase), found, strict=True):
                parameter -= step * gradient
        after = method.loss(phase, batch, method(batch.inputs)).total
        fall = float((before - after).detach()) / (step * square)
        assert 0.7 < fall < 1.3, (phase, fall)


@pytest.mark.parametrize("name", NAMES)
def test_training_on_one_batch_brings_what_is_said_nearer_to_the_truth(name: Name) -> None:
    batch, method = random_batch(), build_method(spec_of(name))
    adams = {phase: torch.optim.Adam(method.parameters_of(phase), lr=2e-3) for phase in method.phases}
    distances = []
    for _ in range(12):
        prediction = method(batch.inputs)
        for phase, adam in adams.items():
            loss = method.loss(phase, batch, prediction)
            torch.autograd.backward(loss.total, inputs=list(method.parameters_of(phase)))
            adam.step()
            adam.zero_grad()
        # An adversary gets better too: what it says of the picture may well get worse
        distances.append(sum(float(term) for kind, term in loss.terms.items() if kind != "gan"))
    assert distances[-1] < 0.93 * distances[0]


@pytest.mark.parametrize("name", NAMES)
def test_a_method_looks_at_what_it_is_said_to_look_at(name: Name) -> None:
    inputs, method = random_batch().inputs, small(name).eval()
    seen = method(inputs).i_t
    for part in ("i_s", "s_prime", "sh"):
        changed = method(replace(inputs, **{part: getattr(inputs, part).flip(-1)})).i_t
        assert torch.equal(changed, seen) == (part in BLIND[name]), part


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("change", [lambda inputs: filled(inputs, 0), lambda inputs: filled(inputs, 1),
                                    lambda inputs: replace(filled(inputs, 1e4), sh=1e4 * inputs.sh)])
def test_black_constant_and_huge_inputs_are_finite(name: Name, change: Callable[[Inputs], Inputs]) -> None:
    batch, method = random_batch(examples=1), small(name)
    batch = replace(batch, inputs=change(batch.inputs))
    prediction = method(batch.inputs)
    assert bool(torch.isfinite(prediction.i_t).all())
    for phase in method.phases:
        found = gradients(method, phase, method.loss(phase, batch, prediction).total)
        assert all(bool(torch.isfinite(one).all()) for one in found)


@pytest.mark.parametrize("name", NAMES)
def test_the_least_size_in_a_batch_of_one_can_be_trained_on(name: Name) -> None:
    method = small(name).train()
    batch: Batch = random_batch(size=method.multiple, examples=1)
    prediction = method(batch.inputs)
    assert prediction.i_t.shape == (1, 3, method.multiple, method.multiple)
    assert all(bool(torch.isfinite(method.loss(phase, batch, prediction).total)) for phase in method.phases)


class _Asked(TorchDispatchMode):
    """Counts the numbers that Python asks for; each would wait for a GPU."""

    count = 0

    def __torch_dispatch__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        self.count += function is torch.ops.aten._local_scalar_dense.default
        return function(*args, **(kwargs or {}))


@pytest.mark.parametrize("name", NAMES)
def test_a_step_asks_for_no_number_before_its_end(name: Name) -> None:
    batch, method = random_batch(), small(name)
    with _Asked() as asked:
        prediction = method(batch.inputs)
        for phase in method.phases:
            gradients(method, phase, method.loss(phase, batch, prediction).total)
    assert asked.count == 0
    with asked:
        float(prediction.i_t.detach().sum())
    assert asked.count == 1


@pytest.mark.parametrize("name", NAMES)
def test_nothing_stands_outside_the_object_and_light_is_float32(name: Name) -> None:
    inputs, method = random_batch().inputs, small(name)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        i_t = method(inputs).i_t
    assert i_t.dtype == torch.float32 and bool((i_t * (1 - inputs.inside) == 0).all()) and bool(i_t.any())
