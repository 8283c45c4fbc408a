import math

import pytest
import torch
from torch import nn

from dataset_builder.lightnet.data.batch import Prediction
from dataset_builder.lightnet.data.ranges import mean_inside, tone_map
from dataset_builder.lightnet.methods.baselines.pix2pix import Generator, Pix2Pix, discriminator
from dataset_builder.lightnet.methods.blocks import BRIGHTEST, BatchNorm, InstanceNorm, light_of, signed
from dataset_builder.lightnet.methods.method import count_parameters
from dataset_builder.lightnet.settings import ModelSpec
from tests.lightnet.random_batch import random_batch

SMALL = ModelSpec(width=2, downs=5)


def test_at_full_size_it_has_the_parameters_of_the_public_code() -> None:
    with torch.device("meta"):
        counts = [count_parameters(Generator(channels, 3, 64, downs)) for channels, downs in ((3, 8), (6, 8), (6, 7))]
        assert counts == [54_413_955, 54_417_027, 41_832_067]
        assert [count_parameters(discriminator(channels, 64)) for channels in (6, 9)] == [2_768_705, 2_771_777]
        whole = Pix2Pix(ModelSpec(width=64, downs=8))
    assert count_parameters(whole) == 54_417_027 + 2_771_777 and whole.multiple == 256


@pytest.mark.parametrize("downs", range(1, 9))
def test_any_number_of_downs_gives_pictures_of_the_size_asked_for(downs: int) -> None:
    generator = Generator(6, 3, 1, downs)
    said = generator(torch.rand(2, 6, 2**downs, 2**(downs + 1)))
    assert said.shape == (2, 3, 2**downs, 2**(downs + 1)) and bool((said.abs() <= 1).all())
    dropouts = sum(isinstance(module, nn.Dropout) for module in generator.modules())
    assert dropouts == max(downs - 5, 0)


def test_the_discriminator_judges_patches_of_70_pixels() -> None:
    judge = discriminator(9, 1).eval()
    x = torch.rand(1, 9, 256, 256, requires_grad=True)
    said = judge(x)
    assert said.shape == (1, 1, 30, 30)
    (gradient,) = torch.autograd.grad(said[0, 0, 15, 15], x)
    rows, columns = ((gradient[0] != 0).any(dim=0).any(dim=dim).nonzero() for dim in (0, 1))
    assert [int(found[-1] - found[0]) + 1 for found in (rows, columns)] == [70, 70]


def test_an_undecided_discriminator_costs_the_logarithm_of_two() -> None:
    batch, method = random_batch(), Pix2Pix(SMALL)
    nn.init.zeros_(method.discriminator[-1].weight)
    inside = batch.inputs.inside
    prediction = Prediction(i_t=3 * batch.truth.i_t)
    l1 = 2 * float(mean_inside((tone_map(prediction.i_t) - tone_map(batch.truth.i_t)).abs(), inside))
    judge, maker = (method.loss(phase, batch, prediction) for phase in ("discriminator", "generator"))
    assert float(judge.total.detach()) == pytest.approx(math.log(2)) and set(judge.terms) == {"d_true", "d_false"}
    assert float(maker.total.detach()) == pytest.approx(math.log(2) + 100 * l1, rel=1e-5) and l1 > 0.1
    assert float(maker.terms["l1"]) == pytest.approx(l1, rel=1e-5)


def test_the_discriminator_learns_to_tell_and_costs_the_generator_dear() -> None:
    torch.manual_seed(0)
    batch, method = random_batch(), Pix2Pix(ModelSpec(width=4, downs=5))
    false = Prediction(i_t=batch.truth.i_t.flip(-1))
    adam = torch.optim.Adam(method.parameters_of("discriminator"), lr=2e-3)
    first = method.loss("generator", batch, false).terms["gan"]
    for _ in range(30):
        adam.zero_grad()
        method.loss("discriminator", batch, false).total.backward()
        adam.step()
    judged = method.loss("discriminator", batch, false)
    assert float(judged.terms["d_true"]) < 0.5 and float(judged.terms["d_false"]) < 0.5
    assert float(method.loss("generator", batch, false).terms["gan"]) > 1.5 * float(first)


def test_a_phase_reaches_its_own_network_only_and_leaves_the_graph_for_the_next() -> None:
    batch, method = random_batch(), Pix2Pix(SMALL)
    prediction = method(batch.inputs)
    method.loss("discriminator", batch, prediction).total.backward()
    assert all(one.grad is None for one in method.generator.parameters())
    adam = torch.optim.Adam(method.parameters_of("discriminator"))
    adam.step()
    total = method.loss("generator", batch, prediction).total
    torch.autograd.backward(total, inputs=list(method.parameters_of("generator")))
    assert all(one.grad is not None for one in method.generator.parameters())


def test_dropout_is_the_global_seed_s_while_training_and_off_otherwise() -> None:
    inputs, method = random_batch(size=128).inputs, Pix2Pix(ModelSpec(width=2, downs=7))

    def drawn(seed: int) -> torch.Tensor:
        torch.manual_seed(seed)
        return method(inputs).i_t

    assert torch.equal(drawn(0), drawn(0)) and not torch.equal(drawn(0), drawn(1))
    method.eval()
    assert torch.equal(drawn(0), drawn(1))


def test_the_condition_is_both_pictures_in_display_values() -> None:
    inputs = random_batch().inputs
    seen = []
    method = Pix2Pix(SMALL)
    method.generator.register_forward_pre_hook(lambda _, given: seen.append(given[0]))
    method(inputs)
    torch.testing.assert_close(seen[0], torch.cat([2 * tone_map(inputs.i_s) - 1, 2 * tone_map(inputs.s_prime) - 1], 1))


def test_light_of_a_share_is_display_light_with_a_gradient_at_both_ends() -> None:
    share = torch.tensor([0.0, 0.25, 0.5, 1.0], requires_grad=True)
    light = light_of(share, torch.ones(4))
    torch.testing.assert_close(tone_map(light), BRIGHTEST * share)
    tone_map(light).sum().backward()
    torch.testing.assert_close(share.grad, torch.full((4,), BRIGHTEST), rtol=1e-3, atol=0)
    torch.testing.assert_close(signed(light), 2 * BRIGHTEST * share - 1)


def test_norms_take_a_single_value() -> None:
    one = torch.full((1, 3, 1, 1), 5.0)
    norm = BatchNorm(3).train()
    norm.running_mean.fill_(3)
    norm.running_var.fill_(4)
    torch.testing.assert_close(norm(one), torch.ones(1, 3, 1, 1))
    assert bool((InstanceNorm(3)(one) == 0).all())
    torch.manual_seed(0)
    many = torch.randn(2, 3, 4, 4)
    torch.testing.assert_close(InstanceNorm(3)(many), nn.InstanceNorm2d(3)(many))
    torch.testing.assert_close(BatchNorm(3)(many), nn.BatchNorm2d(3)(many))
