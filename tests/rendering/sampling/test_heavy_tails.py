"""What the largest contributions say of a layer's mean: shapes that are known, errors as often right as they claim, and
means that are low because their bright paths have not come."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.rendering.sampling.adaptive import Goal, refine
from dataset_builder.rendering.sampling.heavy_tails import LayerMean, layer_mean, least_known, pareto_tail
from dataset_builder.rendering.sampling.moments import Estimate, of_batches

PIXELS, WIDTH, BATCHES, SPP, RUNS = 576, 24, 4, 16, 150
EVERYWHERE = np.ones(PIXELS, dtype=bool)
ALL = slice(0, 3)


def layer(means: np.ndarray) -> Estimate:
    """Of (P, B) batch means, the same in every channel."""
    return of_batches(np.repeat(means[..., None], 3, axis=2), SPP)


def means_of(samples: np.ndarray) -> np.ndarray:
    """(P, B) of (P, B, n) samples."""
    return samples.mean(axis=2)


def of_runs(draw, together: bool = False) -> tuple[np.ndarray, list[LayerMean]]:
    """Means of many runs, and what is said of them. draw: random numbers -> (P, B) batch means."""
    found = [layer(draw(np.random.default_rng(seed))) for seed in range(RUNS)]
    return (np.array([each.mean.mean() for each in found]),
            [layer_mean(each, ALL, np.ones(len(each.mean), dtype=bool), together=together) for each in found])


@pytest.mark.parametrize("shape", [-0.3, 0.3, 0.8, 1.2])
def test_the_shape_of_a_generalised_pareto_distribution_is_found(shape):
    """Mean of 40 fits to 190 of 4000 values each: the prior draws it towards 1/2 by a twentieth of the distance."""
    fits = [pareto_tail(np.sort((np.random.default_rng(seed).uniform(size=4000) ** -shape - 1) / shape))
            for seed in range(40)]
    assert abs(np.mean(fits) - shape) < 0.05 * abs(shape - 0.5) + 4 * np.std(fits) / np.sqrt(40) and np.std(fits) < 0.25


@pytest.mark.parametrize("values", [np.zeros(100), np.ones(100), np.arange(20.0), np.zeros(0)])
def test_no_tail_is_none(values):
    assert pareto_tail(values) == 0.0


def test_the_error_of_even_noise_by_hand():
    """Every pixel 2 +- 0.1: the pixels' errors, and the largest contribution beside them."""
    found = layer(np.tile([2.1, 1.9, 2.1, 1.9], (PIXELS, 1)))
    said = layer_mean(found, ALL, EVERYWHERE)
    error = 0.1 / np.sqrt(3) / 2
    assert said.error == pytest.approx(np.hypot(error / np.sqrt(PIXELS), error / PIXELS)) and said.known == "known"
    assert said.top_share == pytest.approx(error / PIXELS) and said.tail == 0.0


@pytest.mark.parametrize(("batches", "halves"), [([2.1, 1.9, 2.1, 1.9], (0, 0.1)), ([2.1, 2.1, 1.9, 1.9], (0.1, 0)),
                                                 ([2.3, 2.1, 1.9, 1.7], (0.2, 0.1))])
def test_the_error_of_what_batches_share_by_hand(batches: list[float], halves: tuple[float, float]):
    """What the first half of the batches is off the mean of 2, and every other batch, beside what pixels say."""
    found = layer(np.tile(batches, (PIXELS, 1)))
    said = layer_mean(found, ALL, EVERYWHERE, together=True)
    pixels = found.error[0, 0] / np.sqrt(PIXELS)
    error = np.sqrt(((1.4 * pixels) ** 2 + halves[0] ** 2 + halves[1] ** 2) / 3)
    assert said.error == pytest.approx(np.hypot(error / 2, said.expected))


def test_a_bright_lamp_without_noise_is_no_tail():
    rng = np.random.default_rng(4)
    means = rng.normal(1, 0.1, (PIXELS, BATCHES))
    dim = layer_mean(layer(means), ALL, EVERYWHERE)
    means[:30] = 10 ** np.linspace(2, 5, 30)[:, None]
    lit = layer_mean(layer(means), ALL, EVERYWHERE)
    assert lit.known == "known" and lit.tail < 0.5 and lit.error < dim.error


def test_black_layers_are_known():
    said = layer_mean(layer(np.zeros((PIXELS, BATCHES))), ALL, EVERYWHERE)
    assert said == LayerMean(error=0, expected=0, tail=0, top_share=0)


def test_one_batch_knows_nothing():
    found = of_batches(np.random.default_rng(2).normal(1, 0.1, (PIXELS, 1, 3)), 4)
    assert layer_mean(found, ALL, EVERYWHERE).known == "unknown"


@pytest.mark.parametrize("draw", [
    lambda rng: means_of(rng.normal(1, 0.5, (PIXELS, BATCHES, SPP // BATCHES))),
    lambda rng: means_of(rng.exponential(1, (PIXELS, BATCHES, SPP // BATCHES))),
    lambda rng: means_of(rng.gamma(0.5, 2 * (1 + np.arange(PIXELS) % 5)[:, None, None] / 3, (PIXELS, BATCHES, 4)))])
def test_light_tails_are_known_and_their_errors_hold(draw):
    """150 layers: at most one in 50 is called unknown; z has a root mean square near 1, and 95% are within 2."""
    means, said = of_runs(draw)
    z = (means / np.mean(means) - 1) / [each.error for each in said]
    assert np.mean([each.known == "unknown" for each in said]) <= 0.02
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2 and np.mean(np.abs(z) < 2) > 0.92


def rare(rng: np.random.Generator) -> np.ndarray:
    """Dim light, and paths whose strength has a Pareto tail of shape 0.83: mean 1.6, no variance."""
    samples = rng.uniform(0.5, 1.5, (4 * PIXELS, BATCHES, SPP // BATCHES))
    met = rng.uniform(size=samples.shape) < 0.05
    return means_of(samples + np.where(met, 2 * (rng.pareto(1.2, samples.shape) + 1), 0))


def test_means_that_are_low_for_want_of_rare_paths_are_flagged():
    """Mean 1 + 0.05 x 2 x 6. Some are low by more than 4 standard errors of their pixels: 19 of 20 of those are
    unknown. The fewer pixels, the less is known of the tail: of a picture a quarter the size, a sixth passes."""
    means, said = of_runs(rare)
    claimed = np.array([np.sqrt(np.sum(layer(rare(np.random.default_rng(seed))).error[:, 0] ** 2)) / (4 * PIXELS)
                        for seed in range(RUNS)])
    low = (means - 1.6) / claimed < -4
    assert low.sum() >= 5
    assert np.mean([each.known == "unknown" for each in said]) > 0.9
    assert np.mean([each.known == "unknown" for each, was in zip(said, low, strict=True) if was]) > 0.95


@pytest.mark.parametrize(("shared", "most"), [(0.0, 1.1), (1.25, 1.25), (3.0, 1.4)])
def test_pixels_that_share_light_paths_have_the_error_of_their_sum(shared: float, most: float):
    """Noise that all pixels of a batch share, some times what their own gives the mean: what 150 means are off by, over
    what is claimed. Expected are 0.87, 1.04 and 1.17, each to 7%; what batches share shows in two of three degrees of
    freedom, and pixels alone would claim a third of it."""
    def draw(rng: np.random.Generator) -> np.ndarray:
        own = rng.normal(1, 0.2, (PIXELS, BATCHES))
        return own + shared * 0.2 / np.sqrt(PIXELS) * rng.normal(size=BATCHES)

    means, said = of_runs(draw, together=True)
    off = np.sqrt(np.mean((means - 1) ** 2))
    assert 0.7 < off / np.sqrt(np.mean([each.error**2 for each in said])) < most
    alone = 0.1 / np.sqrt(PIXELS)
    assert off / alone == pytest.approx(np.sqrt(1 + shared**2), rel=0.25)


def test_the_worst_of_several_counts():
    known, wide, unknown = (LayerMean(error=0.05, expected=expected, tail=tail, top_share=0.0)
                            for expected, tail in ((0.01, 0.3), (0.04, 0.3), (0.02, 0.7)))
    assert [each.known for each in (known, wide, unknown)] == ["known", "widened", "unknown"]
    assert least_known(known, unknown, wide) == "unknown" and least_known(known, wide) == "widened"
    assert replace(unknown, expected=0.005).known == "known", "it does not matter"
    assert replace(known, error=np.inf).known == "unknown" and replace(wide, top_share=0.2).known == "unknown"


@pytest.mark.parametrize(("strength", "end"), [(0.0, "error"), (1.0, "cap")])
def test_a_goal_does_not_end_on_its_error_while_the_mean_is_unknown(strength, end):
    def sample(pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
        rng = np.random.default_rng(seed)
        samples = rng.normal(1, 0.2, (len(pixels), batches, max(spp // batches, 1)))
        samples += strength * np.where(rng.uniform(size=samples.shape) < 3e-3, rng.pareto(1.05, samples.shape), 0)
        return of_batches(means_of(samples)[..., None], spp)

    goal = Goal(layer="i_t", channels=slice(0, 1), inside=EVERYWHERE, error=0.3, seconds=0, cap=256)
    done = refine(sample, np.arange(PIXELS), WIDTH, first=SPP, batches=BATCHES, goals=[goal], seed=3)
    assert done.stopped == {"i_t": end}
    assert done.together.spp.mean() == pytest.approx(256 if strength else SPP, rel=0.2)


def test_a_tail_of_equal_contributions_is_short():
    # 103 of 1,200 values are the tail; the grid of 40 of them holds the exponential distribution itself
    assert pareto_tail(np.r_[np.ones(1097), np.full(103, 2.0)]) < 0
