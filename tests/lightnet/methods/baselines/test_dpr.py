from dataclasses import replace

import pytest
import torch

from dataset_builder.lightnet.data.batch import Prediction
from dataset_builder.lightnet.data.ranges import mean_inside, tone_map
from dataset_builder.lightnet.methods.baselines.dpr import LIGHT, UNIT, Dpr, DprPrediction, gradient_l1
from dataset_builder.lightnet.methods.method import count_parameters
from dataset_builder.lightnet.settings import ModelSpec
from tests.lightnet.random_batch import random_batch

SMALL = ModelSpec(width=2, downs=3)


def test_at_full_size_it_has_the_parameters_of_the_public_code_in_colour() -> None:
    undone_by_batch_norm = 4 * 16
    whole = Dpr(ModelSpec(width=16, downs=4))
    assert count_parameters(whole) == 690_034 - undone_by_batch_norm and whole.multiple == 16
    assert [level.lower.residual[0].out_channels for level in whole.levels] == [16, 32, 64, 155]


@pytest.mark.parametrize("downs", [1, 2, 5])
def test_other_numbers_of_levels_give_pictures_of_the_size_asked_for(downs: int) -> None:
    method = Dpr(ModelSpec(width=2, downs=downs))
    assert method(random_batch(size=2**downs).inputs).i_t.shape == (2, 3, 2**downs, 2**downs)


def test_the_bottleneck_holds_the_target_light_at_every_pixel_and_the_picture_s_own_features() -> None:
    method, batch = Dpr(SMALL), random_batch()
    bottoms = []
    method.levels[-1].upper.register_forward_pre_hook(lambda _, given: bottoms.append(given[0]))
    method(batch.inputs)
    method(replace(batch.inputs, sh=-batch.inputs.sh))
    for bottom in bottoms:
        assert torch.equal(bottom[:, :LIGHT], bottom[:, :LIGHT, :1, :1].expand_as(bottom[:, :LIGHT]))
    assert not torch.equal(bottoms[0][:, :LIGHT], bottoms[1][:, :LIGHT])
    assert torch.equal(bottoms[0][:, LIGHT:], bottoms[1][:, LIGHT:])


def test_differences_of_neighbours_count_where_both_are_inside() -> None:
    difference = torch.tensor([[0.0, 1.0, 3.0], [0.0, 5.0, 9.0]])[None, None]
    inside = torch.tensor([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]])[None, None]
    down, right = (0 + 4) / 2, (1 + 5 + 4) / 3
    assert float(gradient_l1(difference, inside)) == pytest.approx(down + right)


def test_a_constant_offset_has_no_gradient_and_a_pattern_has() -> None:
    batch, method = random_batch(), Dpr(SMALL)
    display = tone_map(batch.truth.i_t)
    exact = method.loss("main", batch, Prediction(i_t=batch.truth.i_t))
    assert float(exact.total) == 0 and set(exact.terms) == {"l1", "gradient"}
    off = method.loss("main", batch, Prediction(i_t=batch.truth.i_t.flip(-1)))
    assert float(off.terms["l1"]) == pytest.approx(
        float(mean_inside((display.flip(-1) - display).abs(), batch.inputs.inside)), rel=1e-5)
    assert float(off.terms["gradient"]) > 0.1


def test_the_source_light_is_even_light_of_radiance_one() -> None:
    batch, method = random_batch(), Dpr(SMALL)
    even = torch.zeros(2, 3, 9)
    even[:, :, 0] = (4 * torch.pi) ** 0.5
    source = (even / UNIT).flatten(1)
    assert float(method.loss("main", batch, DprPrediction(i_t=batch.truth.i_t, source=source)).terms["source"]) == 0
    double = method.loss("main", batch, DprPrediction(i_t=batch.truth.i_t, source=2 * source))
    assert float(double.terms["source"]) == pytest.approx(3 / 27)


def test_training_finds_the_source_light() -> None:
    torch.manual_seed(0)
    batch, method = random_batch(), Dpr(SMALL)
    adam = torch.optim.Adam(method.parameters(), lr=5e-3)
    for _ in range(60):
        adam.zero_grad()
        loss = method.loss("main", batch, method(batch.inputs))
        loss.total.backward()
        adam.step()
    assert float(loss.terms["source"]) < 0.01
