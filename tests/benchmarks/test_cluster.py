"""The simulation of a build on many workers against what can be worked out: exact cases, and laws by Z-tests."""

import os
import time
from math import ceil, exp, sqrt

import numpy as np
import pytest

from benchmarks._cluster import HOUR, Cluster, Load, Run, simulate
from dataset_builder.engine import local

SIGMAS = 4.5
"""A right simulation fails one of these tests in 150,000 runs; with a seed each, always or never."""


def even(count: int, seconds: float = 10.0, **others: float) -> Load:
    return Load(seconds=np.full(count, seconds), **others)


@pytest.mark.parametrize(("count", "workers"), [(1, 1), (12, 4), (13, 4), (3, 7)])
def test_equal_tasks_in_rounds(count: int, workers: int) -> None:
    run = simulate(even(count), Cluster(workers=workers, begin=5), seed=0)
    assert run.end == pytest.approx(5 + 10 * ceil(count / workers))
    assert (run.useful, run.lost, run.examples) == (pytest.approx(10 * count), 0, count)
    assert run.away == pytest.approx(5 * workers)
    assert run.idle == pytest.approx(workers * (run.end - 5) - 10 * count)


def test_a_slow_writer_sets_the_pace() -> None:
    """It is busy from the first results on: 100 workers would bring one every 0.1 s, it takes 2 for each."""
    cluster = Cluster(workers=100, per_task=0.5, per_example=0.5, per_byte=0.01)
    run = simulate(even(500, bytes=100), cluster, seed=0)
    assert run.end == pytest.approx(10 + 500 * 2) and run.writing == pytest.approx(500 * 2)
    assert run.writer_share > 0.98 and run.utilisation < 0.06
    # Workers wait once all that may be in flight waits for the writer
    assert run.longest_queue <= 200


def test_shards_are_published_when_their_last_example_is_there() -> None:
    """Three whole ones and one of two examples, 3 s each and 0.1 s for each of 10 bytes an example."""
    run = simulate(even(14, bytes=10, per_shard=4), Cluster(workers=1, per_shard=3, per_published=0.1), seed=0)
    assert run.writing == pytest.approx(4 * 3 + 14 * 10 * 0.1)
    assert run.end == pytest.approx(14 * 10 + 3 + 2 * 10 * 0.1)


def test_results_wait_as_queues_do() -> None:
    """M/D/1, by Pollaczek and Khinchine: at load r, a result waits r / (2 (1 - r)) services on average. Results come at
    random where 200 workers have tasks of exponential length."""
    random, count, service, load = np.random.default_rng(3), 60_000, 1.0, 0.7
    lengths = random.exponential(200 * service / load, count)
    run = simulate(Load(seconds=lengths), Cluster(workers=200, per_task=service), seed=3)
    assert run.waits / count == pytest.approx(service * load / (2 * (1 - load)), rel=0.08)


@pytest.mark.parametrize("rate", [0.3, 2.0])
def test_lost_workers_begin_their_task_again(rate: float) -> None:
    """A task of t that is begun anew whenever its worker is lost at the rate q, which then is away for a, takes
    (1 / q + a) (e^(q t) - 1) on average; its squares give the variance."""
    length, absence, count = 0.5 * HOUR, 0.1 * HOUR, 4000
    q = rate / HOUR
    run = simulate(even(count, length), Cluster(workers=1, losses=rate, absence=absence), seed=11)
    mean = (1 / q + absence) * (exp(q * length) - 1)
    # Losses of a task are geometric with the mean m; the time until each is exponential, cut off at t
    m = exp(q * length) - 1
    cut = 1 / q - length / m
    spread = m * (2 / q**2 - (length**2 + 2 * length / q) / m - cut**2) + (m + m * m) * (cut + absence)**2
    assert abs(run.end - count * mean) < SIGMAS * sqrt(count * spread)
    assert abs(run.losses - count * m) < SIGMAS * sqrt(count * (m + m * m))
    assert run.useful == pytest.approx(count * length)
    assert run.lost == pytest.approx(run.end - run.useful - run.away)


def test_tasks_that_run_out_of_memory_lose_half_of_themselves_on_average() -> None:
    count, share, per_task = 20_000, 0.1, 2
    run = simulate(even(count, 10.0, per_task=per_task), Cluster(workers=50, memory_share=share), seed=5)
    tasks, dies = count / per_task, 1 - (1 - share) ** per_task
    assert abs(run.out_of_memory - tasks * dies) < SIGMAS * sqrt(tasks * dies * (1 - dies))
    whole = 10 * per_task
    assert abs(run.lost - run.out_of_memory * whole / 2) < SIGMAS * whole * sqrt(run.out_of_memory / 12)


def test_slow_workers_do_less() -> None:
    """All at half speed take twice as long; where half of them are, three quarters of the speed are left."""
    whole = simulate(even(4000), Cluster(workers=10, slow_share=1, slow_speed=0.5), seed=0)
    assert whole.end == pytest.approx(2 * 10 * 400)
    speeds = np.where(np.random.default_rng(7).random(40) < 0.5, 0.5, 1.0)
    half = simulate(even(4000), Cluster(workers=40, slow_share=0.5, slow_speed=0.5), seed=7)
    assert half.end == pytest.approx(4000 * 10 / speeds.sum(), rel=0.02)


def test_everything_at_once_adds_up_and_repeats_itself() -> None:
    random = np.random.default_rng(1)
    load = Load(seconds=random.gamma(4, 10, 3000), bytes=1e6, per_task=3, per_shard=50)
    cluster = Cluster(workers=60, begin=20, losses=2, absence=90, slow_share=0.2, slow_speed=0.5, memory_share=0.02,
                      per_task=0.01, per_example=0.02, per_byte=1e-8, per_shard=0.5, per_published=1e-8)
    run: Run = simulate(load, cluster, seed=2)
    assert run.examples == 3000 and run.losses > 10 and run.out_of_memory > 10
    assert run.useful + run.lost + run.away + run.idle == pytest.approx(60 * run.end)
    assert run.idle >= 0 and run.lost > 0 and 0 < run.utilisation < 1
    assert simulate(load, cluster, seed=2) == run and simulate(load, cluster, seed=4) != run


def nap(seconds: float) -> tuple[int, float, float]:
    begin = time.monotonic()
    time.sleep(seconds)
    return os.getpid(), begin, time.monotonic()


def test_two_real_workers_take_as_long_as_two_simulated_ones() -> None:
    """The local engine on naps, whose real lengths are what is simulated, from where the later worker began."""
    told = list(local.run(nap, [0.05, 0.15, 0.1, 0.2, 0.05] * 4, workers=2))
    begun = {process: min(begin for own, begin, _ in told if own == process) for process, _, _ in told}
    if len(begun) < 2:
        pytest.skip("the second process began when all was done")
    start = max(begun.values())
    rest = sorted((begin, end) for _, begin, end in told if begin >= start)
    first = max([end for _, begin, end in told if begin < start <= end], default=start) - start
    lengths = np.array([first, *(end - begin for begin, end in rest)])
    run = simulate(Load(seconds=lengths), Cluster(workers=2), seed=0)
    real = max(end for _, end in rest) - start
    assert real >= run.end * 0.99 and real < run.end + 0.5
