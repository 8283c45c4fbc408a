"""The comparison itself: right where nothing differs, and able to fail."""

import numpy as np
import pytest

from tests.gpu.comparison import deviations, limit

SIDE, REPLICAS = 8, 8


def worst(seed: int, factor: float, shared: float = 0.0) -> float:
    """Largest |z| of two renderings, of which the second is brighter by a factor; shared: error of whole pictures."""
    rng = np.random.default_rng(seed)
    first, second = (mean + rng.normal(size=(REPLICAS, SIDE, SIDE, 3)) * 0.1
                     + shared * rng.normal(size=(REPLICAS, 1, 1, 1)) for mean in (1.0, factor))
    return max(abs(found.z) for found in deviations(first, second))


@pytest.mark.parametrize("shared", [0.0, 0.1])
def test_noise_passes(shared: float) -> None:
    """200 runs of 15 tests each, which fail at a rate of one in a thousand: three or more do, one time in 900."""
    assert sum(worst(seed, 1.0, shared) > limit(15) for seed in range(200)) < 3


@pytest.mark.parametrize(("factor", "shared"), [(1.05, 0.0), (1.5, 0.1)])
def test_a_factor_does_not(factor: float, shared: float) -> None:
    assert all(worst(seed, factor, shared) > limit(15) for seed in range(30))


def test_the_limit_is_bonferronis() -> None:
    assert limit(1) == pytest.approx(3.2905, abs=1e-4) and limit(1000) == pytest.approx(4.8916, abs=1e-3)


def test_without_noise_rounding_alone_passes() -> None:
    image = np.full((2, 4, 4, 1), 2.0)
    assert all(found.z == 0 for found in deviations(image, image * (1 + 1e-7)))
    assert all(found.z == np.inf for found in deviations(image, image * 1.01))
