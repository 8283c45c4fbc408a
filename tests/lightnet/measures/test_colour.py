"""CIELAB and the angle between its colours, against 50 digits, scikit-image and what was measured of other forms."""

import math

import mpmath
import numpy as np
import pytest
import torch
from skimage.color import rgb2lab

from dataset_builder.lightnet.measures.colour import DARK, WHITE, XYZ_FROM_RGB, lab, lab_angle

norm = torch.linalg.vector_norm


def pixels(*colours: tuple[float, float, float], dtype: torch.dtype = torch.float32) -> torch.Tensor:
    """(3, 1, N) a row of colours."""
    return torch.tensor(colours, dtype=dtype).T[:, None]


def exact_lab(rgb: list[float]) -> list[mpmath.mpf]:
    """CIE's formulas in 50 digits."""
    with mpmath.workdps(50):
        knee, slope, offset, gamma = map(mpmath.mpf, ("0.04045", "12.92", "0.055", "2.4"))
        linear = [v / slope if v <= knee else ((v + offset) / (1 + offset)) ** gamma for v in map(mpmath.mpf, rgb)]
        ratios = [mpmath.fdot([mpmath.mpf(str(k)) for k in row], linear) / mpmath.mpf(str(white))
                  for row, white in zip(XYZ_FROM_RGB, WHITE, strict=True)]
        delta = mpmath.mpf(6) / 29
        x, y, z = (mpmath.cbrt(t) if t > delta ** 3 else t / (3 * delta ** 2) + mpmath.mpf(4) / 29 for t in ratios)
        return [116 * y - 16, 500 * (x - y), 200 * (y - z)]


def exact_angle(x: list[float], y: list[float]) -> mpmath.mpf:
    """The angle in 50 digits, by the cross product: not the form that is tested."""
    with mpmath.workdps(50):
        (a, b, c), (d, e, f) = ([mpmath.mpf(v) for v in side] for side in (x, y))
        cross = mpmath.norm(mpmath.matrix([b * f - c * e, c * d - a * f, a * e - b * d]))
        return mpmath.atan2(cross, a * d + b * e + c * f)


def lab_colours(count: int, seed: int) -> torch.Tensor:
    """(count, 3) colours of Lab with L from 5 to 100."""
    generator = torch.Generator().manual_seed(seed)
    low, high = torch.tensor([5.0, -60, -60]), torch.tensor([100.0, 60, 60])
    return low + (high - low) * torch.rand(count, 3, generator=generator)


def apart(x: torch.Tensor, theta: float, seed: int) -> torch.Tensor:
    """Colours of other norms, an angle away from x (count, 3) to float32 rounding."""
    generator = torch.Generator().manual_seed(seed)
    wide = x.double()
    across = torch.linalg.cross(wide, torch.randn(x.shape, generator=generator).double())
    across *= norm(wide, dim=-1, keepdim=True) / norm(across, dim=-1, keepdim=True)
    scale = 0.5 + torch.rand(len(x), 1, generator=generator)
    return (scale * (wide * math.cos(theta) + across * math.sin(theta))).float()


def with_gradient(x: torch.Tensor, y: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Angles (N,) of (N, 3) colours, and their gradients (N, 3) by x."""
    leaf = x.clone().requires_grad_()
    angle = lab_angle(leaf.T[:, None], y.T[:, None])
    angle.sum().backward()
    return angle.detach().flatten(), leaf.grad


def test_lab_holds_its_digits() -> None:
    rgb = torch.rand(3, 1, 800, generator=torch.Generator().manual_seed(0)) ** 2
    found = lab(rgb).flatten(1).T
    wanted = torch.tensor([[float(v) for v in exact_lab(colour)] for colour in rgb.flatten(1).T.tolist()])
    assert (found - wanted).abs().max() < 6e-5


def test_lab_is_that_of_scikit_image_but_for_its_rounded_constants() -> None:
    rgb = np.random.default_rng(1).random((40, 50, 3))
    found = lab(torch.from_numpy(rgb).permute(2, 0, 1)).permute(1, 2, 0).numpy()
    assert found.dtype == np.float64 and np.abs(found - rgb2lab(rgb)).max() < 2e-4


@pytest.mark.parametrize(("value", "lightness"), [(0, 0), (-0.01, -0.69915), (-1, -69.915), (1, 100), (2, 181.7)])
def test_lightness_of_greys(value: float, lightness: float) -> None:
    """903.3 / 12.92 per unit below the knees; above 1 the same formulas as below."""
    found = lab(pixels((value,) * 3)).flatten()
    assert found[0] == pytest.approx(lightness, abs=0.05 if value > 1 else 2e-3)
    assert found[1:].abs().max() < 0.01


def test_gradient_of_lab_at_black_is_that_of_its_lines() -> None:
    black = pixels((0, 0, 0)).requires_grad_()
    lab(black).sum().backward()
    assert black.grad.flatten().round().tolist() == [105, 21, -56]


@pytest.mark.parametrize("value", [-1e4, -1, -1e-3, 0, 1e-30, 0.04045, 1, 10, 1e4])
def test_gradient_of_lab_is_finite(value: float) -> None:
    rgb = pixels((value,) * 3, (0, value, 0), (value, 0.5, 0)).requires_grad_()
    lab(rgb).abs().sum().backward()
    assert rgb.grad.isfinite().all()


def test_gradient_of_lab_against_finite_differences() -> None:
    rgb = pixels((0.2, 0.6, 0.9), (0.01, 0.02, 0.03), (-0.2, 0.4, 0.5), (1.2, 0.1, 3), dtype=torch.float64)
    assert torch.autograd.gradcheck(lab, rgb.requires_grad_())


def test_lab_of_half_types_is_float32() -> None:
    for dtype in (torch.float16, torch.bfloat16):
        half = pixels((0.25, 0.5, 0.75)).to(dtype)
        assert lab(half).dtype == torch.float32 and torch.equal(lab(half), lab(half.float()))


@pytest.mark.parametrize(("theta", "median", "worst"), [
    (3, 1e-8, 4e-8), (1, 4e-8, 4e-7), (1e-1, 2e-7, 1e-6), (1e-2, 1.5e-6, 1e-5), (1e-3, 1.5e-5, 1e-4),
    (1e-4, 1.5e-4, 1e-3), (1e-6, 1.5e-2, 0.1)])
def test_angle_and_gradient_hold_their_digits(theta: float, median: float, worst: float) -> None:
    """Relative errors; what is left is that of float32 unit vectors, some 1e-8 / theta."""
    x = lab_colours(200, seed=2)
    y = apart(x, theta, seed=3)
    angle, gradient = with_gradient(x, y)
    wanted = torch.tensor([float(exact_angle(*pair)) for pair in zip(x.tolist(), y.tolist(), strict=True)])
    errors = (angle - wanted).abs() / wanted
    assert errors.median() < median and errors.max() < worst
    assert (norm(gradient, dim=-1) * norm(x, dim=-1) - 1).abs().max() < max(2e-6, worst)
    direction = with_gradient(x.double(), y.double())[1]
    assert (norm(gradient - direction, dim=-1) * norm(x, dim=-1)).max() < max(1e-6, worst)


def test_gradient_of_the_angle_against_finite_differences() -> None:
    x, y = (colours.double().T[:, None].contiguous() for colours in (lab_colours(6, seed=4), lab_colours(6, seed=5)))
    assert torch.autograd.gradcheck(lab_angle, (x.requires_grad_(), y.requires_grad_()))


def test_equal_colours_have_angle_and_gradient_zero() -> None:
    """arccos has NaN gradients for 73 % of these."""
    x = lab_colours(100_000, seed=6)
    angle, gradient = with_gradient(x, x)
    assert not angle.any() and not gradient.any()


def test_opposite_and_huge_colours() -> None:
    x = lab_colours(1000, seed=7)
    for scale in (1, 1e6, 1e15):
        angle, gradient = with_gradient(-scale * x, x)
        assert (angle - math.pi).abs().max() < 1e-6 and gradient.isfinite().all()


@pytest.mark.parametrize(("x", "y", "angle"), [
    (0, 0, 0), (0, 50, math.pi / 2), (50, 0, math.pi / 2), (1e-20, 50, math.pi / 2), (1e-20, 1e-20, 0),
    (DARK, 50, math.pi / 2), (DARK, DARK, 0), (1.01 * DARK, 50, 0)])
def test_black_has_no_direction(x: float, y: float, angle: float) -> None:
    found, gradient = with_gradient(torch.tensor([[x, 0.0, 0]]), torch.tensor([[y, 0.0, 0]]))
    assert found.item() == pytest.approx(angle) and not gradient.any()


def test_what_is_outside_counts_as_zero_whatever_it_is() -> None:
    x, y = pixels((50, 20, 0), (math.nan, 1, 1), (0, 0, 0)), pixels((50, 0, 20), (1, 1, 1), (90, 0, 0))
    x.requires_grad_()
    angle = lab_angle(x, y, torch.tensor([[[1.0, 0, 0]]]))
    angle.sum().backward()
    assert angle.shape == (1, 1, 3) and angle[0, 0, 1:].tolist() == [0, 0]
    assert x.grad.isfinite().all() and x.grad[:, 0, 0].any() and not x.grad[:, 0, 1:].any()


def test_angle_by_hand() -> None:
    """60 degrees between (1, 0, 1) and (0, 1, 1); a change of the norm does not matter."""
    x, y = pixels((30, 0, 30)), pixels((0, 7, 7))
    assert lab_angle(x, y).item() == pytest.approx(math.pi / 3, abs=1e-6)
    assert lab_angle(x, 9 * y).item() == pytest.approx(math.pi / 3, abs=1e-6)
