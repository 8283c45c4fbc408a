"""The comparison itself: right where nothing differs, and able to fail."""

import numpy as np
import pytest

from tests.gpu.comparison import deviations, limit

SIDE = 16


def pictures(seed: int, factor: float, shared: float = 0.0) -> list[float]:
    """|z| of two noisy pictures, of which the second is brighter by a factor; shared: deviation of a whole picture."""
    rng = np.random.default_rng(seed)
    errors = np.full((SIDE, SIDE, 3), 0.1), np.full((SIDE, SIDE, 3), 0.2)
    first, second = (mean + rng.normal(size=(SIDE, SIDE, 3)) * error + shared * error * rng.normal()
                     for mean, error in zip((1.0, factor), errors, strict=True))
    return [abs(found.z) for found in deviations((first, second), errors, together=shared > 0)]


@pytest.mark.parametrize("shared", [0.0, 0.7])
def test_noise_passes(shared: float) -> None:
    """200 pictures of 15 tests each, at a rate of one false alarm in a thousand: three or more come one time in 900."""
    bound = limit(15)
    assert sum(max(pictures(seed, 1.0, shared)) > bound for seed in range(200)) < 3


def test_a_factor_does_not() -> None:
    bound = limit(15)
    assert all(max(pictures(seed, 1.1)) > bound for seed in range(30))


def test_the_limit_is_bonferronis() -> None:
    assert limit(1) == pytest.approx(3.2905, abs=1e-4) and limit(1000) == pytest.approx(4.8916, abs=1e-3)


def test_without_noise_rounding_alone_passes() -> None:
    image, none = np.full((4, 4, 1), 2.0), np.zeros((4, 4, 1))
    assert all(found.z == 0 for found in deviations((image, image * (1 + 1e-7)), (none, none)))
    assert all(found.z == np.inf for found in deviations((image, image * 1.01), (none, none)))
