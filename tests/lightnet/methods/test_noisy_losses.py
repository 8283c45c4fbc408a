"""Losses that know the noise of the truth: what is wanted of them, in the mean over noise."""

from dataclasses import replace

import pytest
import torch

from dataset_builder.lightnet.data.batch import Batch, Prediction
from dataset_builder.lightnet.data.ranges import tone_map
from dataset_builder.lightnet.measures.metrics import ssim_map
from dataset_builder.lightnet.methods.losses import LightObjective, PicturePair, inverse_variance, two_samples
from dataset_builder.lightnet.settings import ObjectiveSpec, TrainingSpec
from tests.lightnet.random_batch import random_batch

SHARE = 0.3
"""Standard error of a half, of its light."""


def halved(seed: int, share: float = SHARE) -> Batch:
    """A batch whose truth is the mean of two noisy halves; the light itself is that of `random_batch`."""
    batch = random_batch(size=32, examples=1)
    generator = torch.Generator().manual_seed(seed)
    deviates = ((torch.rand(batch.truth.i_t.shape, generator=generator) - 0.5) * 12**0.5 for _ in range(2))
    one, other = (batch.truth.i_t * (1 + share * deviate) for deviate in deviates)
    truth = replace(batch.truth, i_t=(one + other) / 2, i_t_half=one, i_t_se=share * batch.truth.i_t / 2**0.5)
    return replace(batch, truth=truth)


def pair_of(batch: Batch, found: torch.Tensor) -> PicturePair:
    return PicturePair(found=found, wanted=tone_map(batch.truth.i_t), inside=batch.inputs.inside)


def test_two_samples_take_off_the_bias_of_the_display_curve() -> None:
    clean = tone_map(random_batch(size=32, examples=1).truth.i_t)
    pairs = [pair_of(halved(seed), clean) for seed in range(200)]
    inside = pairs[0].inside.expand_as(clean) > 0
    plain, two = (torch.stack(pictures).mean(dim=0)[inside].mean() - clean[inside].mean() for pictures in (
        [pair.wanted for pair in pairs],
        [two_samples(pair, halved(seed)).wanted for seed, pair in enumerate(pairs)]))
    assert plain < -2e-3 and abs(two) < 0.2 * abs(plain)


def test_two_samples_know_the_variance_of_their_mean_and_take_it_off_ssim() -> None:
    """Of a prediction that is the light itself: SSIM against noisy truth is far below 1, without its noise near 1."""
    clean = tone_map(random_batch(size=32, examples=1).truth.i_t)
    found = [two_samples(pair_of(halved(seed), clean), halved(seed)) for seed in range(100)]
    inside = found[0].inside.expand_as(clean) > 0
    assert all(one.noise is not None for one in found)
    deviation = torch.stack([one.wanted for one in found]).var(dim=0)[inside].mean()
    noise = torch.stack([one.noise for one in found if one.noise is not None]).mean(dim=0)
    assert noise[inside].mean() == pytest.approx(float(deviation), rel=0.2)
    noisy, without = (torch.stack([ssim_map(clean, one.wanted, noise)[inside].mean() for one in found
                                   for noise in [one.noise if known else None]]).mean() for known in (False, True))
    assert 1 - without < 0.3 * (1 - noisy)


def test_weights_by_hand() -> None:
    """1 / (v + 0.05^2): a half of the picture has no noise, the other a variance v of display values."""
    batch = halved(0)
    i_t = torch.full_like(batch.truth.i_t, 0.5)
    error = torch.zeros_like(i_t)
    error[..., 16:] = 0.01
    spread = float(((tone_map(i_t + 0.01) - tone_map(i_t - 0.01)) / 2).square().mean())
    weight = inverse_variance(replace(batch, truth=replace(batch.truth, i_t=i_t, i_t_se=error)))
    inside = batch.inputs.inside > 0
    none, some = (weight[..., part][inside[..., part]].unique() for part in (slice(16), slice(16, None)))
    assert float(none.mean() / some.mean()) == pytest.approx(1 + spread / 0.05**2, rel=1e-3)


def test_weights_are_inverse_variances_with_a_floor_and_a_mean_of_1() -> None:
    batch = halved(0)
    weight, inside = inverse_variance(batch), batch.inputs.inside > 0
    assert weight[inside].mean() == pytest.approx(1, rel=1e-5)
    surer = replace(batch, truth=replace(batch.truth, i_t_se=torch.zeros_like(batch.truth.i_t)))
    assert torch.allclose(inverse_variance(surer)[inside], torch.ones(1))
    noise = torch.zeros_like(batch.truth.i_t)
    noise[..., :16] = 0.5 * batch.truth.i_t[..., :16]
    weight = inverse_variance(replace(batch, truth=replace(batch.truth, i_t_se=noise)))
    assert weight[..., :16][inside[..., :16]].max() <= weight[..., 16:][inside[..., 16:]].min()


@pytest.mark.parametrize("noise", ["weighted", "two_samples"])
def test_they_are_what_the_plain_loss_is_where_there_is_no_noise(noise: str) -> None:
    batch = halved(0, share=0.0)
    prediction = Prediction(i_t=0.8 * batch.truth.i_t, d=batch.truth.d, r=batch.truth.r)
    spec = ObjectiveSpec(fr=0, l1=1)
    told = LightObjective(spec.model_copy(update={"noise": noise}))(batch, prediction)
    plain = LightObjective(spec)(batch, prediction)
    assert told.total.item() == pytest.approx(plain.total.item(), rel=1e-4)
    assert told.terms.keys() == plain.terms.keys()


def test_only_lightnet_asks_for_noise_and_only_where_it_is_told_to() -> None:
    asks = {noise: TrainingSpec(objective=ObjectiveSpec(noise=noise)).extra
            for noise in ("plain", "weighted", "two_samples")}
    assert asks == {"plain": (), "weighted": ("i_t_se",), "two_samples": ("i_t_half",)}
    assert TrainingSpec(method="dpr", objective=ObjectiveSpec(noise="weighted")).extra == ()
