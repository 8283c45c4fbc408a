"""What share of a population the limit from a few examples holds: 95% on average, and the sure share nearly always.

`pytest -s` prints the figures that docs/accuracy.md names. Every share is of `DRAWS` studies; bounds are four standard
errors, so that of the six shares of sound code one fails in 3,000 runs.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr, ndtri, stdtr

from dataset_builder.studies.accuracy.laws import laws
from dataset_builder.studies.accuracy.other_examples import SURE, spread_of, sure_share
from dataset_builder.studies.accuracy.rows import OTHERS
from tests.studies.accuracy.made_rows import sampled, study

DRAWS = 1000
BOUND = 4 * math.sqrt(SURE * (1 - SURE) / DRAWS)
Draw = Callable[[np.random.Generator, int], np.ndarray]
Below = Callable[[float], float]


def held(count: int, draw: Draw, below: Below) -> np.ndarray:
    """Shares of a population below the limits of studies that looked at `count` examples. draw: logarithms of noise of
    so many; below: share of the population up to a logarithm."""
    references = [row for row in study(layers=("i_t",)) if row.question != OTHERS]
    found, random = laws(references, "cpu_seconds"), np.random.default_rng(count)
    example = sampled(OTHERS, 16)

    def share() -> float:
        noises = np.exp(draw(random, count)).tolist()
        others = [replace(example, reached=math.sqrt(noise / 16), example=f"{k}") for k, noise in enumerate(noises)]
        return below(math.log(spread_of([*references, *others], found, "i_t").limit))

    return np.array([share() for _ in range(DRAWS)])


@pytest.mark.parametrize("count", [3, 8, 16])
def test_the_limit_holds_as_much_as_is_said_of_log_normal_noise(count: int) -> None:
    shares = held(count, lambda random, size: 0.7 * random.standard_normal(size), lambda x: float(ndtr(x / 0.7)))
    sure, kept = sure_share(count), float(np.mean(shares >= sure_share(count)))
    print(f"{count} examples: the limit holds {shares.mean():.1%} on average, 95% in {np.mean(shares >= 0.95):.0%} of "
          f"the studies, and the sure {sure:.1%} in {kept:.1%}")
    assert shares.mean() == pytest.approx(0.95, abs=4 * shares.std() / math.sqrt(DRAWS))
    assert kept == pytest.approx(SURE, abs=BOUND)


@pytest.mark.parametrize("count", [3, 8, 16])
def test_longer_tails_to_both_sides_take_none_of_it(count: int) -> None:
    """Logarithms of Student's t with four degrees of freedom."""
    shares = held(count, lambda random, size: random.standard_t(4, size), lambda x: float(stdtr(4, x)))
    assert np.mean(shares >= sure_share(count)) >= SURE - BOUND


@pytest.mark.parametrize(("count", "share"), [(3, 0.77), (8, 0.74), (16, 0.72)])
def test_a_tail_to_the_noisy_side_alone_takes_some(count: int, share: float) -> None:
    """Noise of Pareto's law: logarithms are exponential. The page says so."""
    shares = held(count, lambda random, size: random.exponential(1, size), lambda x: 1 - math.exp(-max(x, 0)))
    kept = float(np.mean(shares >= sure_share(count)))
    print(f"{count} examples, Pareto: {shares.mean():.1%} on average, the sure share in {kept:.1%}")
    assert kept == pytest.approx(share, abs=1.5 * BOUND)


def test_sure_shares_by_hand() -> None:
    """Of two values, sqrt 2 mean and s are a normal b and the |a| of another: mean + k s is above z where b is above
    sqrt 2 (z - k |a|), summed over a grid of a."""
    across = np.abs(np.linspace(-8, 8, 160_001))
    weights = np.exp(-across**2 / 2) / np.sum(np.exp(-across**2 / 2))
    factor, z = 6.313752 * math.sqrt(1.5), float(ndtri(sure_share(2)))
    assert float(weights @ ndtr(math.sqrt(2) * (factor * across - z))) == pytest.approx(SURE, abs=1e-4)
    assert sure_share(1) == 0 and sure_share(2) < sure_share(3) < sure_share(16) < sure_share(1000) < 0.95
