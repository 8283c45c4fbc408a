"""The four figures against scikit-image, torchmetrics and values by hand; only the object counts."""

import math
from dataclasses import asdict, fields

import numpy as np
import pytest
import torch
from skimage.color import rgb2lab
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from torchmetrics.functional.image import peak_signal_noise_ratio as torch_psnr

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.ranges import linear_light, tone_map
from dataset_builder.lightnet.measures.metrics import BEST_PSNR, METRICS, Metrics, mean_metrics, measure


def picture(seed: int, size: int = 40) -> torch.Tensor:
    """(1, 3, size, size) exposed light, with highlights."""
    return torch.rand(1, 3, size, size, generator=torch.Generator().manual_seed(seed)) ** 3 * 4


def disc(size: int = 40, radius: float = 12) -> torch.Tensor:
    """(1, 1, size, size) a disc off the middle."""
    rows, columns = torch.meshgrid(torch.arange(size), torch.arange(size), indexing="ij")
    return ((rows - 0.4 * size) ** 2 + (columns - 0.5 * size) ** 2 < radius ** 2).float()[None, None]


def one(predicted: torch.Tensor, truth: torch.Tensor, inside: torch.Tensor) -> Metrics:
    """Figures of a single example."""
    return measure(predicted, truth, inside)[0]


@pytest.fixture(scope="module")
def pair() -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Prediction, truth and a disc; all light everywhere."""
    truth = picture(0)
    noise = torch.randn(truth.shape, generator=torch.Generator().manual_seed(1))
    return (truth * (1 + 0.3 * noise)).abs(), truth, disc()


def test_figures_are_those_of_scikit_image(pair: tuple[torch.Tensor, ...]) -> None:
    found = one(*pair)
    inside = pair[2][0, 0].numpy() > 0
    x, y = ((tone_map(image.double()) * pair[2])[0].permute(1, 2, 0).numpy() for image in pair[:2])
    assert found.l1 == pytest.approx(np.abs(x - y)[inside].mean(), rel=1e-5)
    assert found.psnr == pytest.approx(peak_signal_noise_ratio(y[inside], x[inside], data_range=1), abs=1e-4)
    whole = structural_similarity(x, y, full=True, channel_axis=2, data_range=1, gaussian_weights=True, sigma=1.5,
                                  use_sample_covariance=False)[1]
    assert found.ssim == pytest.approx(whole[inside].mean(), abs=1e-5)
    a, b = rgb2lab(x)[inside], rgb2lab(y)[inside]
    cosine = (a * b).sum(-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    lit = (np.linalg.norm(a, axis=-1) > 1) & (np.linalg.norm(b, axis=-1) > 1)
    assert lit.all() and found.lab == pytest.approx(np.arccos(cosine).mean(), abs=1e-5)


def test_psnr_is_that_of_torchmetrics(pair: tuple[torch.Tensor, ...]) -> None:
    whole = torch.ones_like(pair[2])
    wanted = torch_psnr(tone_map(pair[0]), tone_map(pair[1]), data_range=1.0)
    assert one(pair[0], pair[1], whole).psnr == pytest.approx(float(wanted), abs=1e-4)


def test_figures_by_hand() -> None:
    """Display 0.5 against 0.6: L1 0.1, 20 dB, (0.6 + C1) / (0.61 + C1), and greys have one direction."""
    found = one(*(linear_light(torch.full((1, 3, 20, 20), value)) for value in (0.5, 0.6)), torch.ones(1, 1, 20, 20))
    assert found.l1 == pytest.approx(0.1, abs=1e-6) and found.psnr == pytest.approx(20, abs=1e-4)
    assert found.ssim == pytest.approx((0.6 + 1e-4) / (0.61 + 1e-4), abs=1e-6) and found.lab < 1e-4


def test_identical_pictures_have_the_best_figures() -> None:
    for truth in (picture(2), torch.zeros(1, 3, 40, 40), 1e4 * picture(2)):
        assert one(truth, truth, disc()) == Metrics(l1=0, psnr=BEST_PSNR, ssim=1, lab=0)
    nearly = one(picture(2) * (1 + 1e-6), picture(2), disc())
    assert nearly.psnr == BEST_PSNR and nearly.ssim <= 1


def test_only_the_object_counts(pair: tuple[torch.Tensor, ...]) -> None:
    found = one(*pair)
    dirty = torch.where(pair[2] > 0, pair[0], torch.nan)
    assert one(dirty, pair[1], pair[2]) == found
    framed = one(*(torch.nn.functional.pad(part, (7, 9, 30, 5)) for part in pair))
    assert asdict(framed) == pytest.approx(asdict(found), rel=1e-6)


def test_a_black_prediction_is_not_a_good_one() -> None:
    """An angle with black would be 0 by atan2; it counts as pi / 2."""
    truth, black = 0.5 + picture(3), torch.zeros(1, 3, 40, 40)
    found = one(black, truth, disc())
    assert found.lab == pytest.approx(math.pi / 2) and found.ssim < 0.1
    half = torch.where(torch.arange(40) % 2 == 0, truth, black)
    assert one(half, truth, torch.ones(1, 1, 40, 40)).lab == pytest.approx(math.pi / 4, abs=1e-3)


def test_predictions_are_clipped_to_the_display() -> None:
    truth, inside = torch.zeros(1, 3, 20, 20), torch.ones(1, 1, 20, 20)
    assert one(truth - 5, truth, inside) == one(truth, truth, inside)
    bright = one(truth + 1e30, truth, inside)
    assert bright.l1 == pytest.approx(1) and bright.psnr == pytest.approx(0, abs=1e-5)


def test_examples_are_measured_one_by_one() -> None:
    predicted, truth = torch.cat([picture(4), picture(5)]), torch.cat([picture(5), picture(6)])
    inside = torch.cat([disc(), disc(radius=0.5)])
    both = measure(predicted, truth, inside)
    assert both == [one(predicted[i:i + 1], truth[i:i + 1], inside[i:i + 1]) for i in range(2)]
    assert mean_metrics(both).psnr == pytest.approx((both[0].psnr + both[1].psnr) / 2)


def test_half_types_are_measured_in_float32(pair: tuple[torch.Tensor, ...]) -> None:
    half = [part.to(torch.bfloat16) for part in pair]
    assert one(*half) == one(*(part.float() for part in half))


def test_nothing_to_measure_is_an_error_and_nan_stays_nan() -> None:
    with pytest.raises(UserError, match="no pixel inside in example 1"):
        measure(picture(7).expand(2, -1, -1, -1), picture(8).expand(2, -1, -1, -1),
                torch.cat([disc(), torch.zeros(1, 1, 40, 40)]))
    broken = picture(7)
    broken[..., 16, 20] = torch.nan
    assert math.isnan(one(broken, picture(8), disc()).l1) and math.isnan(one(broken, picture(8), disc()).psnr)


def test_the_table_names_every_figure() -> None:
    assert [metric.name for metric in METRICS] == [field.name for field in fields(Metrics)]
    assert f"at most {BEST_PSNR:g}" in METRICS[1].definition
