import pytest
import torch
from torch.nn import functional

from dataset_builder.lightnet.methods.blocks import (
    EPSILON,
    Decoder,
    Encoder,
    ObjectNorm,
    head,
    inside_levels,
    level_widths,
)
from tests.lightnet.random_batch import disc


def drawn(channels: int) -> ObjectNorm:
    """A norm with weights of its own."""
    norm = ObjectNorm(channels)
    torch.nn.init.uniform_(norm.weight, 0.5, 2)
    torch.nn.init.uniform_(norm.bias, -1, 1)
    return norm


def by_definition(norm: ObjectNorm, x: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
    """The same in double precision, from the pixels inside alone."""
    result = torch.zeros_like(x, dtype=torch.float64)
    for index, here in enumerate(inside[:, 0] > 0):
        values = x[index].double()[:, here].reshape(norm.groups, -1)
        mean, variance = values.mean(dim=1, keepdim=True), values.var(dim=1, correction=0, keepdim=True)
        normed = ((values - mean) / (variance + EPSILON).sqrt()).reshape(x.shape[1], -1)
        result[index][:, here] = (normed * norm.weight.double()[:, None] + norm.bias.double()[:, None]).relu()
    return result


@pytest.mark.parametrize("channels", [4, 8, 12, 16])
@pytest.mark.parametrize(("scale", "shift"), [(1, 0), (1e-2, 1), (1e3, 1e3)])
def test_moments_are_those_of_the_object(channels: int, scale: float, shift: float) -> None:
    torch.manual_seed(0)
    norm, inside = drawn(channels), torch.cat([disc(24), (torch.rand(1, 1, 24, 24) < 0.3).float()])
    x = shift + scale * torch.randn(2, channels, 24, 24)
    # E[x^2] - E[x]^2 in float32: an error of some 1e-7 (shift / scale)^2 of the variance
    torch.testing.assert_close(norm(x, inside).double(), by_definition(norm, x, inside), rtol=2e-3, atol=2e-3)


def test_over_a_whole_frame_it_is_group_normalisation() -> None:
    torch.manual_seed(0)
    norm, x = drawn(16), torch.randn(3, 16, 8, 12)
    expected = functional.group_norm(x, 8, norm.weight, norm.bias, EPSILON).relu()
    torch.testing.assert_close(norm(x, torch.ones(3, 1, 8, 12)), expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("x", [torch.zeros(1, 8, 6, 6), torch.full((1, 8, 6, 6), 7.0), torch.full((1, 8, 6, 6), 1e4)])
@pytest.mark.parametrize("pixels", [0, 1, 36])
def test_constants_single_pixels_and_nothing_at_all_are_finite(x: torch.Tensor, pixels: int) -> None:
    norm, x = drawn(8), x.clone().requires_grad_()
    inside = (torch.arange(36) < pixels).float().reshape(1, 1, 6, 6)
    found = norm(x, inside)
    found.sum().backward()
    assert all(bool(torch.isfinite(each).all()) for each in (found, x.grad, norm.weight.grad, norm.bias.grad))


def test_what_is_around_an_object_changes_nothing() -> None:
    torch.manual_seed(1)
    encoder, decoder = Encoder(3, 4, 2), Decoder(4, 2)
    inside = disc(16)
    x = torch.randn(1, 3, 16, 16) * inside

    def features(margins: tuple[int, int, int, int]) -> torch.Tensor:
        insides = inside_levels(functional.pad(inside, margins), 2)
        return decoder(encoder(functional.pad(x, margins), insides), insides)

    alone, framed = features((0, 0, 0, 0)), features((4, 20, 8, 32))
    torch.testing.assert_close(framed[..., 8:24, 4:20], alone, rtol=1e-4, atol=1e-5)
    assert alone.abs().max() > 0.1 and bool((framed * (1 - functional.pad(inside, (4, 20, 8, 32))) == 0).all())


def test_objects_of_a_batch_do_not_see_each_other() -> None:
    torch.manual_seed(2)
    encoder, inside = Encoder(3, 4, 2), disc(16).expand(3, -1, -1, -1)
    x = torch.randn(3, 3, 16, 16)
    together = encoder(x, inside_levels(inside, 2))
    alone = encoder(x[1:2], inside_levels(inside[1:2], 2))
    for many, one in zip(together, alone, strict=True):
        torch.testing.assert_close(many[1:2], one, rtol=1e-4, atol=1e-5)


def test_levels_grow_to_eight_times_the_width() -> None:
    assert level_widths(16, 4) == (16, 32, 64, 128, 128) and level_widths(3, 1) == (3, 6)
    features = Encoder(3, 4, 4)(torch.rand(1, 3, 32, 16), inside_levels(torch.ones(1, 1, 32, 16), 4))
    assert [tuple(one.shape[1:]) for one in features] == [(4, 32, 16), (8, 16, 8), (16, 8, 4), (32, 4, 2), (32, 2, 1)]


def test_a_coarse_pixel_is_inside_where_any_fine_one_is() -> None:
    inside = torch.zeros(1, 1, 4, 4)
    inside[..., 1, 2] = 1
    levels = inside_levels(inside, 2)
    assert levels[1][0, 0].tolist() == [[0, 1], [0, 0]] and levels[2][0, 0].tolist() == [[1]]


def test_a_head_says_its_bias_until_it_is_trained() -> None:
    assert bool((head(4, bias=0.5)(torch.randn(1, 4, 3, 3)) == 0.5).all())
