"""Sampling in rounds: unbiased although it adapts, honest about its error, and it stops when it says it does."""

import numpy as np
import pytest
from scipy import stats

from dataset_builder.rendering.sampling import adaptive
from dataset_builder.rendering.sampling.adaptive import Goal, Sampled, more_samples, refine
from dataset_builder.rendering.sampling.moments import Estimate, of_batches, quantile, relative
from dataset_builder.rendering.sampling.pixel_noise import moderated

WIDTH, BATCHES, FIRST = 16, 4, 16
PIXELS = np.arange(WIDTH * WIDTH)
TRUTH = 1.0
NOISE = np.where(PIXELS % WIDTH < WIDTH // 2, 0.2, 4.0)
"""Skewness parameter: the right half of the picture is dark with rare bright samples."""


def skewed(pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
    """Gamma variables of mean 1 whose variance is NOISE: many small values and few large ones, like fireflies."""
    rng = np.random.default_rng(seed)
    shape = 1 / NOISE[pixels]
    sums = rng.gamma(shape[:, None] * spp / batches, 1 / shape[:, None], (len(pixels), batches))
    return of_batches((sums / (spp / batches))[..., None], spp)


def goal(error: float = 0.05, seconds: float = 0.0, cap: int = 100_000, inside=None) -> Goal:
    inside = np.ones(len(PIXELS), dtype=bool) if inside is None else inside
    return Goal(layer="i_t", channels=slice(0, 1), inside=inside, error=error, seconds=seconds, cap=cap)


def run(*goals: Goal, seed: int = 1, **options) -> Sampled:
    return refine(skewed, PIXELS, WIDTH, first=FIRST, batches=BATCHES, goals=goals, seed=seed, **options)


def all_of(done: Sampled) -> Estimate:
    """The estimate of all pixels, or of as many as were sampled."""
    return done.estimate(PIXELS[:len(done.halves[0].spp)], WIDTH)


def parts(*spp: int, seed: int) -> Sampled:
    """A fixed spp in several parts."""
    done = None
    for part, number in enumerate(spp):
        done = more_samples(skewed, PIXELS, done, spp=number, part=part, batches=BATCHES, seed=seed)
    return done


def test_parts_of_an_spp_add_up():
    done = parts(FIRST, 3 * FIRST, seed=1)
    assert (all_of(done).spp == 4 * FIRST).all() and not done.stopped
    first, second = parts(FIRST, seed=1), parts(FIRST, FIRST, seed=1)
    assert not np.array_equal(all_of(first).mean, all_of(second).mean)
    assert np.array_equal(all_of(first).mean, skewed(PIXELS, FIRST, BATCHES, 1).mean)


@pytest.mark.parametrize("spp", [(FIRST,), (FIRST, FIRST), (FIRST, 3 * FIRST, 4 * FIRST)])
def test_errors_of_parts_are_honest(spp):
    """Means of 40 runs are unbiased (|z| < 4.4), and 95% intervals hold the truth in 92 to 98% of pixels."""
    runs = [all_of(parts(*spp, seed=seed)) for seed in range(40)]
    means = np.array([found.mean.mean() for found in runs])
    assert abs(means.mean() - TRUTH) / (means.std(ddof=1) / np.sqrt(len(means))) < 4.4
    assert 0.92 <= np.mean([np.abs(found.mean - TRUTH) <= found.interval() for found in runs]) <= 0.98


def test_a_goal_that_is_tightened_goes_on_from_what_there_is():
    first = run(goal(0.2), seed=3)
    more = run(goal(0.1), seed=3, before=first)
    assert (all_of(more).spp >= all_of(first).spp).all() and all_of(more).spp.mean() > 2 * all_of(first).spp.mean()
    assert more.stopped == {"i_t": "error"} and max(more.iterations) > max(first.iterations)
    assert run(goal(0.2), seed=3, before=more).iterations == more.iterations


def test_means_of_tightened_goals_are_unbiased_and_their_errors_honest():
    """As without a stop on the way: |z| < 4.4 over 100 runs, intervals hold the truth in 92 to 98% of pixels."""
    runs = [all_of(run(goal(0.1), seed=seed, before=run(goal(0.25), seed=seed))) for seed in range(100)]
    means = np.array([found.mean.mean() for found in runs])
    assert abs(means.mean() - TRUTH) / (means.std(ddof=1) / np.sqrt(len(means))) < 4.4
    assert 0.92 <= np.mean([np.abs(found.mean - TRUTH) <= found.interval() for found in runs]) <= 0.98


def test_adaptive_means_are_unbiased():
    """Over 150 runs the mean of every half of the picture is the truth: |z| < 4.4, one false alarm in 50,000."""
    runs = [all_of(run(goal(0.15), seed=seed)).mean[:, 0] for seed in range(150)]
    for half in (PIXELS % WIDTH < WIDTH // 2, PIXELS % WIDTH >= WIDTH // 2):
        means = np.array([found[half].mean() for found in runs])
        z = (means.mean() - TRUTH) / (means.std(ddof=1) / np.sqrt(len(means)))
        assert abs(z) < 4.4


def fireflies(pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
    """Mean 1: mostly 0.8, and once in a hundred samples 20 more."""
    hits = np.random.default_rng(seed).binomial(spp // batches, 1e-2, (len(pixels), batches))
    return of_batches((0.8 + 20 * hits / (spp // batches))[..., None], spp)


def deviation_of_fireflies(error: float, runs: int = 60) -> float:
    """Mean over the picture in many runs that stop by themselves, less the truth, in standard errors."""
    means = np.array([all_of(refine(fireflies, PIXELS, WIDTH, first=FIRST, batches=BATCHES, goals=[goal(error)],
                                    seed=seed)).mean.mean() for seed in range(runs)])
    return float((means.mean() - TRUTH) / (means.std(ddof=1) / np.sqrt(runs)))


@pytest.mark.parametrize("error", [0.15, 0.1])
def test_rare_bright_paths_are_not_lost(error):
    """Pixels that no bright path has met are neither left alone nor taken for finished: |z| < 4.4."""
    assert abs(deviation_of_fireflies(error)) < 4.4


def test_the_test_of_bias_can_fail(monkeypatch):
    """Halves that go by what they found themselves are wrong, and the same test notices."""
    extra = adaptive._extra
    monkeypatch.setattr(adaptive, "_extra", lambda goal, own, other, smallest, **doubt: extra(
        goal, own, moderated(own, PIXELS, WIDTH), smallest, **doubt))
    assert abs(deviation_of_fireflies(0.1)) > 1.5 * 4.4


def test_most_pixels_reach_the_error_asked_for():
    asked = 0.05
    runs = [run(goal(asked), seed=seed) for seed in range(40)]
    assert all(done.stopped == {"i_t": "error"} for done in runs)
    errors = np.sqrt(np.mean([(all_of(done).mean[:, 0] - TRUTH) ** 2 for done in runs], axis=0))
    # Each is a root mean square of 40: the chi distribution's 99.9% point is 36% above its mean
    assert np.mean(errors < 1.36 * asked) > 0.94
    spp = np.mean([all_of(done).spp for done in runs], axis=0)
    assert spp[NOISE > 1].mean() > 4 * spp[NOISE < 1].mean()


@pytest.mark.parametrize(("asked", "pixels"), [(0.05, 256), (0.15, 256), (0.1, 64)])
def test_the_error_that_records_state_is_the_one_asked_for(asked, pixels):
    """Of both halves together; not much less either, where it took further rounds."""
    reached, inside = [], pixels > PIXELS
    for seed in range(20):
        done = run(goal(asked, inside=inside), seed=seed)
        found = all_of(done)
        assert done.stopped == {"i_t": "error"}
        reached.append(quantile(relative(found.mean[inside], found.error[inside])) / asked)
    assert max(reached) <= 1 and np.median(reached) > 0.8


def test_adaptive_intervals_cover():
    """Pixels of many runs: 95% intervals hold the truth as often as for normal variables, but for the skewness."""
    covered = []
    for seed in range(20):
        found = all_of(run(goal(0.05), seed=seed))
        covered.append(np.abs(found.mean - TRUTH)[:, 0] <= found.interval()[:, 0])
    assert 0.93 < np.mean(covered) < 0.97


def test_the_cap_holds_and_is_said():
    done = run(goal(0.001, cap=300))
    assert done.stopped == {"i_t": "cap"} and all_of(done).spp.max() <= 300 and all_of(done).spp.min() > 200


def test_time_ends_it_and_is_said():
    ticks = iter(range(1000))
    done = run(goal(1e-6, seconds=3.0), clock=lambda: float(next(ticks)))
    assert done.stopped == {"i_t": "time"} and max(done.iterations) <= 4


def test_time_that_runs_out_within_a_round_ends_it():
    ticks = iter(range(0, 1000, 2))
    done = run(goal(1e-6, seconds=3.0), clock=lambda: float(next(ticks)))
    assert done.stopped == {"i_t": "time"} and (all_of(done).spp == FIRST).all()


def test_a_time_budget_alone_is_spent():
    ticks = iter(range(1000))
    done = run(goal(0.0, seconds=3.0), clock=lambda: float(next(ticks)))
    assert done.stopped == {"i_t": "time"} and all_of(done).spp.min() > FIRST


def test_pixels_that_do_not_count_get_the_first_round_only():
    inside = PIXELS % WIDTH < 4
    done = run(goal(0.01, inside=inside))
    assert (all_of(done).spp[~inside] == FIRST).all() and (all_of(done).spp[inside] > FIRST).all()


def test_two_goals_of_one_pass_both_hold():
    loose, tight = goal(0.3), Goal(layer="s", channels=slice(0, 1), inside=PIXELS > 100, error=0.05, seconds=0,
                                   cap=100_000)
    done = run(loose, tight)
    assert done.stopped == {"i_t": "error", "s": "error"}
    assert all_of(done).spp[PIXELS > 100].mean() > 2 * all_of(done).spp[PIXELS <= 100].mean()


@pytest.mark.parametrize("count", [1, 2])
def test_masks_of_a_pixel_or_two_end(count):
    done = refine(skewed, PIXELS[:count], WIDTH, first=FIRST, batches=BATCHES, seed=5,
                  goals=[goal(0.05, cap=4096, inside=np.ones(count, dtype=bool))])
    assert done.stopped["i_t"] in ("error", "cap") and all_of(done).spp.max() <= 4096


def test_a_layer_that_is_black_needs_no_more():
    def black(pixels: np.ndarray, spp: int, batches: int, seed: int) -> Estimate:
        return of_batches(np.zeros((len(pixels), batches, 1)), spp)

    done = refine(black, PIXELS, WIDTH, first=FIRST, batches=BATCHES, goals=[goal(0.01)], seed=1)
    assert done.stopped == {"i_t": "error"} and done.iterations == (1, 1)


def test_repetitions_give_the_same_bits_and_seeds_do_not():
    first, again, other = run(goal(), seed=9), run(goal(), seed=9), run(goal(), seed=10)
    first, again, other = all_of(first), all_of(again), all_of(other)
    assert np.array_equal(first.mean, again.mean) and not np.array_equal(first.mean, other.mean)
    assert stats.pearsonr(first.mean[:, 0], other.mean[:, 0]).statistic < 0.5
