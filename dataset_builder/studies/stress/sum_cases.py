"""Seeds at both ends of their range, and sums so long that single precision could lose them."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dataset_builder.rendering.sampling.estimate import estimate
from dataset_builder.studies.stress.bench import Shot, at, judged, off_by, on_floor, render, sigmas
from dataset_builder.studies.stress.case import SIGMAS, Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.number_cases import DOWN, S_OF_FLOOR, SUN
from dataset_builder.studies.stress.scenes import floor, light, lit_by


def seeded(size: Size, seed: int) -> CaseMeasured:
    """S under a ball light against its formula; repeated, the same bits; with the next seed, others."""
    shots = [Shot(camera=DOWN, max_depth=2, seed=each) for each in (seed, seed, (seed + 1) % 2**64)]
    lamp = lit_by(light("sphere", 4.0, position=(0, 1, 1), size=0.5))
    first, again, other = (render(floor(), lamp, shot, size) for shot in shots)
    truth = on_floor(DOWN, at(shots[0], size), lambda p: 1 / np.linalg.norm(p - np.array([0, 1, 1]), axis=-1) ** 3)
    also = [] if np.array_equal(first.shading, again.shading) else ["expected the same bits again"]
    also += [] if not np.array_equal(first.shading, other.shading) else ["expected other bits for another seed"]
    apart = [replica for replica in first.shading[1:] if np.array_equal(replica, first.shading[0])]
    also += [] if not apart else ["expected replicas with random numbers of their own"]
    return judged(first, sigmas(first.shading, truth), also=tuple(also))


seed_zero = Case(
    name="number/seed-0", bound=SIGMAS, figure="worst |z| of pixels and picture", measure=lambda size: seeded(size, 0),
    expectation="seed 0 is a valid seed: right on average, repeatable, unlike its neighbour",
    failure="a generator that is stuck, so that all pixels have the same error")

seed_largest = Case(
    name="number/seed-2^64-1", bound=SIGMAS, figure="worst |z| of pixels and picture",
    measure=lambda size: seeded(size, 2**64 - 1),
    expectation="the largest seed is a valid seed",
    failure="an overflow, or the same picture as for another seed: only half of the bits are used")


DRIFT = 5e-6
"""What float32 sums of a thousand terms are off by, several times over; a million terms in a row lose a hundredth."""

AGAINST_DOUBLE = "deviation from the sum in double, relative"


def long_mean(function: Callable[[Any], Any], size: Size) -> float:
    """Mean over one pixel of a function of the place across it, as passes average their channels, against the double
    sum of the same samples."""
    samples: list[np.ndarray] = []

    def integrand(samplers: Any, position: Any) -> list[Any]:
        values = function(position.x)
        samples.append(np.array(values, dtype=np.float64))
        return [values]
    found = estimate(integrand, np.zeros(1, int), width=1, height=1, spp=size.long, batches=4, seed=1)
    values = np.concatenate(samples)
    if len(values) < size.long:
        return math.inf
    return abs(float(found.mean[0, 0]) / float(values.mean()) - 1)


long_sum = Case(
    name="number/long-sum", bound=DRIFT, figure=AGAINST_DOUBLE,
    measure=lambda size: CaseMeasured(figure=long_mean(lambda x: 0.1 + (x - x), size)),
    expectation="the mean of a million equal samples (65 thousand in a small run) is that of a sum in double",
    failure="drift: a float32 sum grows by rounded steps, all in the same direction")

long_sum_of_unlike = Case(
    name="number/long-sum-of-unlike", bound=DRIFT, figure=AGAINST_DOUBLE,
    measure=lambda size: CaseMeasured(figure=long_mean(lambda x: 2000 * x**9, size)),
    expectation="the same holds for samples between 0 and 2000, most of them small",
    failure="small samples that are lost beside a large sum")


@hard_case(name="number/long-render", bound=DRIFT, figure="deviation of S from E cos / pi, relative",
           expectation="a pixel in the sun keeps its value after a million samples (65 thousand in a small run)",
           failure="drift of the sums in a pass")
def long_render(size: Size) -> CaseMeasured:
    """All samples are equal, so the sum is known."""
    shot = Shot(camera=DOWN, size=(2, 1), max_depth=2, replicas=1, spp=size.long, batches=64)
    picture = render(floor(), SUN, shot, size)
    return judged(picture, off_by(picture.shading, S_OF_FLOOR))
