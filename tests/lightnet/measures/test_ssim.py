"""SSIM against scikit-image in double precision, torchmetrics, and where float32 forms lose their digits."""

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter
from skimage.metrics import structural_similarity
from torchmetrics.functional.image import structural_similarity_index_measure

from dataset_builder.lightnet.measures.ssim import C1, RADIUS, ssim_map


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
