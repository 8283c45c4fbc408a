"""Figures of noisy truth on made pictures whose light is known: light times gamma noise, as sums of samples have."""

from functools import lru_cache

import numpy as np
import pytest
import torch
from scipy.special import ndtr
from scipy.stats import gamma

from dataset_builder.lightnet.measures.metrics import METRICS, Metrics, measure
from dataset_builder.lightnet.measures.truth_noise import NoisyTruth, moved, width_of, without_noise
from dataset_builder.lightnet.results.clustered_means import estimate
from dataset_builder.seeding import rng
from tests.lightnet.random_batch import disc

SIZE = 40
INSIDE = disc(SIZE)


def picture(seed: int = 0) -> torch.Tensor:
    """(1, 3, SIZE, SIZE) smooth light, 0.05 to 2."""
    draws, (y, x) = rng(seed, "light"), np.mgrid[:SIZE, :SIZE] / SIZE
    light = (0.05 + draws.uniform(0.8, 1.6) * x**2) * (1 + 0.3 * np.sin(draws.uniform(8, 20) * y))
    return torch.from_numpy(np.stack([light, 0.7 * light, 0.4 * light])[None])


def noisy(light: torch.Tensor, share: float, seed: int) -> NoisyTruth:
    """The same under noise of standard error `share` of it, whose channels have much in common."""
    draws = rng(seed, "noise")
    normal = np.sqrt(0.9) * draws.normal(size=(1, SIZE, SIZE)) + np.sqrt(0.1) * draws.normal(size=(3, SIZE, SIZE))
    factor = gamma.ppf(ndtr(normal), share**-2) * share**2
    return NoisyTruth(i_t=light * torch.from_numpy(factor)[None], error=share * light, inside=INSIDE, seed=seed)


def figures(metrics: Metrics) -> np.ndarray:
    return np.array([getattr(metrics, metric.name) for metric in METRICS])


def predicted(light: torch.Tensor, seed: int = 0) -> torch.Tensor:
    """Light that is off by some 15%."""
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    return light * torch.from_numpy(1 + 0.2 * np.sin(rng(seed, "off").uniform(6, 12) * x + 5 * y))


@lru_cache
def over_noise(share: float) -> tuple[np.ndarray, ...]:
    """Means over noise of: the ceiling, a perfect prediction as measured, and of one that is off the figures as
    measured, and corrected."""
    light = picture()
    off = predicted(light)
    found = []
    for seed in range(8):
        truth = noisy(light, share, seed)
        found.append([figures(truth.ceiling), *(figures(measure(one, truth.i_t, INSIDE)[0]) for one in (light, off)),
                      figures(truth.corrected(off))])
    return tuple(np.mean(found, axis=0))


@pytest.mark.parametrize(("share", "psnr", "rest"), [(0.1, 0.15, 0.03), (0.2, 0.4, 0.08)])
def test_the_ceiling_is_what_a_perfect_prediction_gets(share: float, psnr: float, rest: float) -> None:
    ceiling, perfect, *_ = over_noise(share)
    assert ceiling[1] == pytest.approx(perfect[1], abs=psnr)
    assert ceiling[[0, 2, 3]] == pytest.approx(perfect[[0, 2, 3]], rel=rest, abs=0.2 * rest)


@pytest.mark.parametrize(("share", "left"), [(0.1, 0.35), (0.2, 0.35)])
def test_corrected_figures_are_those_of_the_light(share: float, left: float) -> None:
    """No metric keeps more than a third of what noise does to it, PSNR no more than a tenth."""
    _, _, measured, corrected = over_noise(share)
    light = picture()
    clean = figures(measure(predicted(light), light, INSIDE)[0])
    assert (abs(corrected - clean) <= left * abs(measured - clean)).all()
    assert abs(corrected - clean)[1] <= 0.1 * abs(measured - clean)[1]


def test_intervals_of_corrected_figures_hold_those_of_the_light() -> None:
    """Datasets of eight objects: 95% of intervals should hold the mean over all objects; as measured, few do."""
    lights = [picture(seed) for seed in range(160)]
    pairs = [(predicted(light, seed), noisy(light, 0.2, seed)) for seed, light in enumerate(lights)]
    values = {"clean": [measure(off, light, INSIDE)[0].psnr for (off, _), light in zip(pairs, lights, strict=True)],
              "measured": [measure(off, truth.i_t, INSIDE)[0].psnr for off, truth in pairs],
              "corrected": [truth.corrected(off).psnr for off, truth in pairs]}
    mean, names = float(np.mean(values["clean"])), [str(number) for number in range(8)]
    held = {name: sum(abs(found.mean - mean) <= found.half_width for found in (
        estimate(values[name][first:first + 8], names) for first in range(0, 160, 8))) for name in values}
    assert held["corrected"] >= 17 and held["clean"] >= 17 and held["measured"] < 17


def test_a_perfect_prediction_is_told_from_the_ceiling() -> None:
    """PSNR is then a bound, far above what the truth's noise lets it show."""
    light = picture()
    truth = noisy(light, 0.1, 3)
    assert truth.corrected(light).psnr > truth.ceiling.psnr + 8
    assert truth.corrected(light).l1 < 0.5 * truth.ceiling.l1 and truth.corrected(light).ssim > 0.97


def test_without_noise_nothing_changes() -> None:
    light = picture()
    truth = NoisyTruth(i_t=light, error=torch.zeros_like(light), inside=INSIDE)
    assert figures(truth.ceiling) == pytest.approx([0, 100, 1, 0], abs=1e-9)
    off = predicted(light)
    assert figures(truth.corrected(off)) == pytest.approx(figures(measure(off, light, INSIDE)[0]), rel=1e-5)


def test_log_normal_noise_is_taken_off_a_logarithm() -> None:
    """The mean of log y is log x - w^2 / 2."""
    light = torch.tensor([0.1, 1.0, 7.0], dtype=torch.float64)
    width = torch.full_like(light, 0.3)
    assert without_noise(torch.log, light, width).tolist() == pytest.approx((light.log() + 0.045).tolist())
    assert without_noise(lambda values: values, light, width).tolist() == pytest.approx(light.tolist(), rel=1e-3)
    assert width_of(light, 1e-3 * light).tolist() == pytest.approx([1e-3] * 3, rel=1e-5)
    assert width_of(torch.zeros(1), torch.ones(1)).item() == pytest.approx(np.sqrt(np.log(4 / 3)), rel=1e-6)
    assert moved(light, 0 * width, 2.0).tolist() == light.tolist()


def test_channels_noise_goes_together_as_it_was_made() -> None:
    together = noisy(picture(), 0.2, 5).together
    assert together[0, 1:].tolist() == pytest.approx([0.9, 0.9], abs=0.06) and together[1, 1] == pytest.approx(1)
    bare = NoisyTruth(i_t=picture(), error=torch.zeros_like(picture()), inside=INSIDE)
    assert torch.equal(bare.together, torch.eye(3, dtype=torch.float64))


def test_draws_of_the_lab_angle_have_a_small_error() -> None:
    truth = noisy(picture(), 0.2, 5)
    assert 0 < truth.lab_error < 0.1 * truth.ceiling.lab
