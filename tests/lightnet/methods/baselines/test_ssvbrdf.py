import numpy as np
import pytest
import torch
from torch.nn import functional

from dataset_builder.geometry.harmonics import basis, irradiance
from dataset_builder.lightnet.data.batch import Prediction
from dataset_builder.lightnet.data.ranges import mean_inside, tone_map
from dataset_builder.lightnet.methods.baselines.ssvbrdf import (
    Ssvbrdf,
    SvbrdfDecoder,
    SvbrdfEncoder,
    encoder_widths,
    lit,
)
from dataset_builder.lightnet.methods.method import count_parameters
from dataset_builder.lightnet.settings import ModelSpec
from tests.lightnet.random_batch import random_batch

SMALL = ModelSpec(width=2, downs=3)


def unit(*xyz: float) -> torch.Tensor:
    return functional.normalize(torch.tensor(xyz, dtype=torch.float64), dim=0)


def test_at_full_size_it_has_the_parameters_of_the_public_code() -> None:
    assert encoder_widths(32, 6) == [32, 64, 128, 256, 256, 512]
    with torch.device("meta"):
        assert count_parameters(SvbrdfEncoder(4, 32,
                                              6)) == 3_840_960 and count_parameters(SvbrdfDecoder(32, 6)) == 5_642_499
    whole = Ssvbrdf(ModelSpec(width=32, downs=6))
    assert count_parameters(whole) == 3_840_960 + 2 * 5_642_499 and whole.multiple == 64


@pytest.mark.parametrize("downs", [1, 2, 5])
def test_other_numbers_of_levels_give_pictures_of_the_size_asked_for(downs: int) -> None:
    method = Ssvbrdf(ModelSpec(width=2, downs=downs))
    assert method(random_batch(size=2**downs).inputs).i_t.shape == (2, 3, 2**downs, 2**downs)


def test_even_light_of_radiance_one_shades_every_normal_with_one() -> None:
    torch.manual_seed(0)
    sh = torch.zeros(1, 3, 9)
    sh[..., 0] = (4 * torch.pi) ** 0.5
    normal = functional.normalize(torch.randn(1, 3, 5, 5), dim=1)
    torch.testing.assert_close(lit(normal, sh), torch.ones(1, 3, 5, 5))


@pytest.mark.parametrize("normal", [unit(0, 0, 1), unit(1, 0, 1), unit(1, -2, 0.5), unit(0.2, 0.3, -1)])
def test_a_lamp_shades_by_the_angle_to_it(normal: torch.Tensor) -> None:
    lamp = unit(0.3, -0.5, 0.8)
    sh = torch.pi * torch.stack(basis(*lamp)).expand(1, 3, 9)
    cosine = float(normal @ lamp)
    # The addition theorem: A_l (2 l + 1) / (4 pi) P_l for degrees 0, 1 and 2
    by_angle = 1 / 4 + cosine / 2 + 5 / 16 * (3 * cosine**2 - 1) / 2
    found = lit(normal[None, :, None, None], sh)
    torch.testing.assert_close(found, torch.full((1, 3, 1, 1), max(by_angle, 0), dtype=torch.float64))


def test_light_by_channel_is_what_numpy_says_and_never_below_nothing() -> None:
    torch.manual_seed(0)
    sh, normal = torch.randn(2, 3, 9).double(), functional.normalize(torch.randn(2, 3, 4, 4).double(), dim=1)
    found = lit(normal, sh)
    for index in range(2):
        wanted = irradiance(sh[index].T.numpy(), normal[index].permute(1, 2, 0).numpy()) / np.pi
        np.testing.assert_allclose(found[index].permute(1, 2, 0), np.maximum(wanted, 0), atol=1e-12)
    assert bool((found == 0).any()) and bool((found > 0).any())


def test_light_is_float32_where_the_network_is_not() -> None:
    torch.manual_seed(0)
    sh, normal = torch.rand(1, 3, 9), functional.normalize(torch.randn(1, 3, 4, 4), dim=1)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        found = lit(normal, sh)
    assert found.dtype == torch.float32 and torch.equal(found, lit(normal, sh))


def test_a_picture_is_albedo_times_shading() -> None:
    torch.manual_seed(0)
    found = Ssvbrdf(SMALL)(random_batch().inputs)
    assert found.r is None and found.alpha is None
    torch.testing.assert_close(found.i_t, found.d * found.shading)
    assert bool(((found.d >= 0) & (found.d <= 1)).all()) and bool((found.shading >= 0).all())


def test_normals_start_out_facing_the_viewer_and_none_is_needed() -> None:
    torch.manual_seed(0)
    method, inputs = Ssvbrdf(SMALL), random_batch().inputs
    said = method.normal(method.encoder(torch.cat([inputs.i_s, inputs.inside], dim=1)))
    assert float((said[:, 2] > 0).float().mean()) > 0.9
    torch.nn.init.zeros_(method.normal.last.weight)
    torch.nn.init.zeros_(method.normal.last.bias)
    found = method(inputs)
    found.i_t.sum().backward()
    assert all(bool(torch.isfinite(one.grad).all()) for one in method.parameters())


def test_losses_are_squared_errors_over_the_object() -> None:
    batch, method = random_batch(), Ssvbrdf(SMALL)
    exact = method.loss("main", batch, Prediction(i_t=batch.truth.i_t, d=batch.truth.d))
    assert float(exact.total) == 0
    off = method.loss("main", batch, Prediction(i_t=batch.truth.i_t.flip(-1), d=batch.truth.d + 0.5))
    render = (tone_map(batch.truth.i_t.flip(-1)) - tone_map(batch.truth.i_t)).square()
    assert float(off.terms["render"]) == pytest.approx(float(mean_inside(render, batch.inputs.inside)), rel=1e-5)
    assert float(off.terms["albedo"]) == pytest.approx(0.25, rel=1e-5)
    assert float(off.total) == pytest.approx(float(off.terms["render"]) + 0.25, rel=1e-5)
