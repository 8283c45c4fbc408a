from dataclasses import replace
from itertools import pairwise
from typing import get_args

import pytest
import torch
from torch import nn
from torch.nn import functional

from dataset_builder.lightnet.data.batch import Prediction
from dataset_builder.lightnet.methods.lightnet import BRIGHTEST, DARKEST, LighTNet, compose, mended
from dataset_builder.lightnet.methods.losses import LightObjective
from dataset_builder.lightnet.methods.method import count_parameters
from dataset_builder.lightnet.settings import Formulation, ModelSpec, ObjectiveSpec, Shading
from tests.lightnet.random_batch import filled, random_batch

VARIANTS = [(formulation, shading) for formulation in get_args(Formulation) for shading in get_args(Shading)]


def network(formulation: Formulation = "dr_alpha_s", shading: Shading = "residual", *, width: int = 4, downs: int = 2,
            trained: bool = False) -> LighTNet:
    """A small network; `trained`: its heads say something."""
    torch.manual_seed(0)
    spec = ModelSpec(width=width, downs=downs, formulation=formulation, shading=shading)
    found = LighTNet(spec, LightObjective(ObjectiveSpec(fr=0)))
    for module in found.modules():
        if trained and isinstance(module, nn.Conv2d) and module.bias is not None:
            nn.init.normal_(module.weight, 0, 0.3)
    return found


def block(before: int, after: int) -> int:
    """Numbers of two convolutions and two norms."""
    return 9 * before * after + 9 * after * after + 4 * after


def encoder(channels: int, widths: list[int]) -> int:
    return sum(block(before, after) for before, after in pairwise([channels, *widths]))


def decoder(widths: list[int]) -> int:
    """With one head."""
    return sum(block(fine + coarse, fine) for fine, coarse in pairwise(widths)) + head(widths)


def head(widths: list[int]) -> int:
    return 3 * widths[0] + 3


def test_the_whole_network_has_as_many_parameters_as_its_design() -> None:
    for width, total in ((16, 3_090_796), (64, 49_356_172)):
        widths = [width, 2 * width, 4 * width, 8 * width, 8 * width]
        by_hand = encoder(4, widths) + encoder(10, widths) + 3 * decoder(widths) + head(widths)
        with torch.device("meta"):
            found = LighTNet(ModelSpec(width=width, downs=4), LightObjective(ObjectiveSpec(fr=0)))
        assert count_parameters(found) == by_hand == total


def test_a_variant_has_the_networks_that_it_uses() -> None:
    w = [4, 8, 16]
    e, e_r, e_d = encoder(4, w) + decoder(w), encoder(10, w), encoder(7, w)
    expected = {
        ("d_s", "raw"): e, ("d_s", "residual"): e + e_d + decoder(w), ("d_s", "direct"): e + e_d + decoder(w),
        ("dr_s", "raw"): e + head(w), ("dr_s", "residual"): e + head(w) + e_r + decoder(w),
        ("dr_s", "direct"): e + head(w) + e_r + decoder(w),
    } | {(formulation, shading): e + head(w) + e_r + decoder(w) * (1 if shading == "raw" else 2)
         for formulation, shading in VARIANTS if "alpha" in formulation}
    assert {variant: count_parameters(network(*variant)) for variant in VARIANTS} == expected


def test_formulas_by_hand() -> None:
    d, r, s, a = (torch.tensor(value) for value in (0.5, 0.25, 4.0, -0.125))
    wanted = {("d_s", None, None): 2.0, ("dr_s", r, None): 3.0, ("dr_s_plus_alpha", r, a): 2.875,
              ("dr_alpha_s", r, a): 2.5}
    for (formulation, its_r, its_alpha), value in wanted.items():
        spec = ModelSpec(formulation=formulation)
        assert compose(spec, d=d, r=its_r, shading=s, alpha=its_alpha).item() == value


@pytest.mark.parametrize(("formulation", "shading"), VARIANTS)
def test_a_picture_is_the_formula_of_its_parts(formulation: Formulation, shading: Shading) -> None:
    inputs = random_batch().inputs
    found = network(formulation, shading, trained=True)(inputs)
    assert found.d is not None and found.shading is not None
    assert (found.r is None) == (formulation == "d_s") and (found.alpha is None) == ("alpha" not in formulation)
    zero = torch.zeros_like(found.d)
    r, alpha = (zero if part is None else part for part in (found.r, found.alpha))
    wanted = {"d_s": found.d * found.shading, "dr_s": (found.d + r) * found.shading,
              "dr_s_plus_alpha": (found.d + r) * found.shading + alpha,
              "dr_alpha_s": (found.d + r + alpha) * found.shading}[formulation]
    torch.testing.assert_close(found.i_t, wanted, rtol=1e-6, atol=1e-6)
    assert torch.equal(found.shading, inputs.s_prime) == (shading == "raw")
    assert bool(((found.d >= 0) & (found.d <= 1) & (r >= 0) & (r <= 1) & (found.shading >= 0)).all())


def test_untrained_it_lights_the_source_picture_with_the_shading_as_it_is() -> None:
    inputs = random_batch().inputs
    found = network()(inputs)
    guess = inputs.i_s.clamp(DARKEST, BRIGHTEST) * inputs.inside
    torch.testing.assert_close(found.d, guess, rtol=1e-5, atol=1e-6)
    assert torch.equal(found.shading, inputs.s_prime) and bool((found.alpha == 0).all())
    torch.testing.assert_close(found.i_t, (guess + 0.04 * inputs.inside) * inputs.s_prime, rtol=1e-5, atol=1e-6)
    direct = network(shading="direct")(inputs)
    torch.testing.assert_close(direct.shading, inputs.inside.expand(-1, 3, -1, -1), rtol=1e-4, atol=1e-4)


def test_mended_shading_by_hand() -> None:
    s_prime = torch.tensor([2.0, 2.0, 2.0, 2.0, 0.0, 0.0])
    said = torch.tensor([0.0, 1.0, -1.0, -50.0, 2.0, -2.0])
    wanted = torch.tensor([2.0, 5.0, 0.735759, 0.0, 2.0, 0.0])
    torch.testing.assert_close(mended(s_prime, said), wanted)


def parts(prediction: Prediction) -> list[torch.Tensor]:
    found = (prediction.i_t, prediction.d, prediction.r, prediction.shading, prediction.alpha)
    return [part for part in found if part is not None]


@pytest.mark.parametrize(("formulation", "shading"), VARIANTS)
def test_gradients_reach_every_parameter(formulation: Formulation, shading: Shading) -> None:
    batch, method = random_batch(), network(formulation, shading, trained=True)
    method.loss("main", batch, method(batch.inputs)).total.backward()
    still = [name for name, parameter in method.named_parameters()
             if parameter.grad is None or not bool((parameter.grad != 0).any())]
    assert still == [] and all(bool(torch.isfinite(one.grad).all()) for one in method.parameters())


@pytest.mark.parametrize("value", [0.0, 1.0, 1e4])
def test_constant_pictures_are_finite_with_finite_gradients(value: float) -> None:
    batch, method = random_batch(examples=1), network(trained=True)
    batch = replace(batch, inputs=filled(batch.inputs, value))
    prediction = method(batch.inputs)
    method.loss("main", batch, prediction).total.backward()
    assert all(bool(torch.isfinite(part).all()) for part in parts(prediction))
    assert all(bool(torch.isfinite(one.grad).all()) for one in method.parameters())


def test_without_an_object_there_is_nothing() -> None:
    batch = random_batch(examples=1)
    nothing = replace(filled(batch.inputs, 0), inside=torch.zeros_like(batch.inputs.inside))
    assert all(bool((part == 0).all()) for part in parts(network(trained=True)(nothing)))


def test_one_pixel_of_a_batch_of_one_can_be_trained_on() -> None:
    batch, method = random_batch(examples=1), network(trained=True)
    pixel = torch.zeros_like(batch.inputs.inside)
    pixel[..., 15, 17] = 1
    batch = replace(batch, inputs=replace(batch.inputs, inside=pixel, i_s=batch.inputs.i_s * pixel,
                                          s_prime=batch.inputs.s_prime * pixel))
    prediction = method(batch.inputs)
    method.loss("main", batch, prediction).total.backward()
    assert int(prediction.i_t.count_nonzero()) == 3
    assert all(bool(torch.isfinite(one.grad).all()) for one in method.parameters())


def test_nothing_stands_outside_the_object_and_nothing_there_matters() -> None:
    inputs, method = random_batch().inputs, network(trained=True)
    alone = method(inputs)
    margins = (4, 8, 16, 12)
    framed = method(replace(inputs, **{name: functional.pad(getattr(inputs, name), margins)
                                       for name in ("i_s", "s_prime", "inside")}))
    for part, wide in zip(parts(alone), parts(framed), strict=True):
        assert bool((part * (1 - inputs.inside) == 0).all())
        torch.testing.assert_close(wide[..., 16:48, 4:36], part, rtol=1e-3, atol=1e-4)


def test_materials_come_from_the_source_picture_alone() -> None:
    inputs, method = random_batch().inputs, network(trained=True)
    first, second = method(inputs), method(replace(inputs, s_prime=inputs.s_prime.flip(-1)))
    assert torch.equal(first.d, second.d) and torch.equal(first.r, second.r)
    assert not torch.equal(first.alpha, second.alpha) and not torch.equal(first.shading, second.shading)


def test_in_bfloat16_what_comes_out_is_float32_and_about_the_same() -> None:
    inputs, method = random_batch().inputs, network(trained=True)
    whole = method(inputs)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        half = method(inputs)
    assert all(part.dtype == torch.float32 for part in parts(half))
    assert (half.i_t - whole.i_t).abs().mean() < 0.05 * whole.i_t.abs().mean()
