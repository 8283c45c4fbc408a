"""The figures against scikit-image, torchmetrics and values by hand; SSIM too where float32 forms lose digits."""

import math
from dataclasses import asdict, fields

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from skimage.color import rgb2lab
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from torchmetrics.functional.image import peak_signal_noise_ratio as torch_psnr
from torchmetrics.functional.image import structural_similarity_index_measure

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.ranges import linear_light, tone_map
from dataset_builder.lightnet.measures.metrics import (
    BEST_PSNR,
    C1,
    METRICS,
    RADIUS,
    Metrics,
    mean_metrics,
    measure,
    ssim_map,
)


def noise(*shape: int, seed: int, size: float = 1) -> torch.Tensor:
    """Normal noise, float64."""
    return size * torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def scikit(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """(C, H, W) map of scikit-image in float64, with the definition that ours states."""
    return torch.from_numpy(structural_similarity(x.double().numpy(), y.double().numpy(), full=True, channel_axis=0,
                                                  data_range=1, gaussian_weights=True, sigma=1.5,
                                                  use_sample_covariance=False)[1])


BASE = noise(3, 40, 40, seed=0)
HARD = {
    "equal constants": (torch.full((3, 40, 40), 0.3), torch.full((3, 40, 40), 0.3), 1),
    "0 and 0": (torch.zeros(3, 40, 40), torch.zeros(3, 40, 40), 1),
    "0.5 and 0.6": (torch.full((3, 40, 40), 0.5), torch.full((3, 40, 40), 0.6), (0.6 + C1) / (0.61 + C1)),
    "-0.2 and 0.2": (torch.full((3, 40, 40), -0.2), torch.full((3, 40, 40), 0.2), (-0.08 + C1) / (0.08 + C1)),
    "equal noise": (BASE, BASE, 1),
    "0.5 and a little noise": (0.5 + 1e-4 * BASE, torch.full((3, 40, 40), 0.5), None),
    "10 and noise": (torch.full((3, 40, 40), 10.0), 10 + BASE, None),
    "1000 and noise": (1000 + 0.3 * noise(3, 40, 40, seed=1), 1000 + BASE, None),
}
"""Two images, and the value everywhere where it is known."""


@pytest.mark.parametrize("case", HARD)
def test_five_digits_where_float32_is_hard(case: str) -> None:
    x, y, value = (side.float() if isinstance(side, torch.Tensor) else side for side in HARD[case])
    found, wanted = ssim_map(x, y), scikit(x, y)
    assert (found - wanted).abs().max() < 2e-5
    assert float(found.mean()) == pytest.approx(float(wanted.mean()), rel=1e-5)
    if value is not None:
        assert found.flatten().tolist() == pytest.approx([value] * found.numel(), rel=1e-6)


def test_the_usual_form_would_fail_there() -> None:
    """The cases above can tell: E[x²] - E[x]² without taking the mean off is wrong in the second digit or worse."""
    x, y = (side.float().numpy() for side in HARD["1000 and noise"][:2])
    blurred = [gaussian_filter(side, (0, 1.5, 1.5), radius=RADIUS) for side in (x, y, x * x, y * y, x * y)]
    covariance = blurred[4] - blurred[0] * blurred[1]
    variances = blurred[2] + blurred[3] - blurred[0] ** 2 - blurred[1] ** 2
    usual = (2 * covariance + 9e-4) / (variances + 9e-4)
    assert np.abs(usual - scikit(*map(torch.from_numpy, (x, y))).numpy()).max() > 0.01


@pytest.mark.parametrize("shape", [(3, 30, 41), (1, 11, 11)])
def test_the_map_of_scikit_image_to_the_border(shape: tuple[int, ...]) -> None:
    x = noise(*shape, seed=2, size=0.2) + 0.5
    y = x + noise(*shape, seed=3, size=0.1)
    assert (ssim_map(x, y) - scikit(x, y)).abs().max() < 1e-11
    assert (ssim_map(x.float(), y.float()) - scikit(x.float(), y.float())).abs().max() < 1e-5


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 3, 4), (1, 6, 30)])
def test_pictures_smaller_than_the_window(shape: tuple[int, ...]) -> None:
    x, y = noise(*shape, seed=4, size=0.2) + 0.5, noise(*shape, seed=5, size=0.2) + 0.5

    def smooth(values: torch.Tensor) -> np.ndarray:
        return gaussian_filter(values.numpy(), (0, 1.5, 1.5), mode="reflect", radius=RADIUS)

    mu_x, mu_y = smooth(x), smooth(y)
    covariance, variances = smooth(x * y) - mu_x * mu_y, smooth(x * x + y * y) - mu_x ** 2 - mu_y ** 2
    wanted = (2 * mu_x * mu_y + 1e-4) * (2 * covariance + 9e-4) / ((mu_x ** 2 + mu_y ** 2 + 1e-4) * (variances + 9e-4))
    assert np.abs(ssim_map(x, y).numpy() - wanted).max() < 1e-11


def test_the_map_of_torchmetrics_away_from_the_border() -> None:
    """Their border mirrors without repeating the edge, so there alone the two differ."""
    x = noise(2, 3, 40, 40, seed=6, size=0.2) + 0.5
    y = x + noise(2, 3, 40, 40, seed=7, size=0.1)
    theirs = structural_similarity_index_measure(x, y, data_range=1.0, return_full_image=True)[1]
    inner = (..., slice(RADIUS, -RADIUS), slice(RADIUS, -RADIUS))
    assert theirs.shape == x.shape
    assert (ssim_map(x, y) - theirs)[inner].abs().max() < 1e-6
    assert (ssim_map(x.float(), y.float()) - theirs)[inner].abs().max() < 1e-4


def test_both_sides_are_alike() -> None:
    x, y = noise(3, 20, 20, seed=8).float(), noise(3, 20, 20, seed=9).float()
    assert torch.equal(ssim_map(x, y), ssim_map(y, x))


def test_never_beyond_one_and_always_with_a_gradient() -> None:
    """Without a clamp an ulp more than 1 on nearly equal images, and a million where 0 is next to -1.3e5."""
    small = noise(1, 30, 30, seed=10).float()
    half = torch.zeros(1, 30, 30)
    half[..., 15:] = -1.3e5
    for x in (half, half + 0.3 * small, 1e4 * small, 0.5 + 0.2 * small, torch.zeros(1, 30, 30), 0.9 + 1e-7 * small):
        for y in (x, 1.0001 * x, x.flip(-1), half + 0.3 * small.flip(-1), small):
            leaf = x.clone().requires_grad_()
            found = ssim_map(leaf, y)
            found.sum().backward()
            assert found.abs().max() <= 1 and leaf.grad.isfinite().all()


def test_equal_images_are_at_rest() -> None:
    x = (noise(3, 30, 30, seed=11, size=0.2) + 0.5).requires_grad_()
    ssim_map(x, x.detach()).sum().backward()
    assert x.grad.abs().max() < 1e-9


def test_gradient_against_finite_differences() -> None:
    """The mean that is taken off has no part in it: mathematically SSIM does not know of it."""
    x, y = noise(2, 7, 8, seed=12, size=0.3) + 0.5, noise(2, 7, 8, seed=13, size=0.3) + 0.5
    assert torch.autograd.gradcheck(ssim_map, (x.requires_grad_(), y.requires_grad_()))


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
