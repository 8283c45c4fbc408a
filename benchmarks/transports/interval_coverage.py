"""How often 95% intervals hold the mean of all other runs; errors are moderated by neighbours, as the product's."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import beta

from benchmarks.transports.lit_pass import OpenPass
from dataset_builder.label.example_plan import Transport
from dataset_builder.rendering.sampling.moments import Estimate
from dataset_builder.rendering.sampling.pixel_noise import moderated
from dataset_builder.seeding import derive_seed

LEAST, MOST = 0.92, 0.98


def coverage(opened: OpenPass, sides: Sequence[Transport], spp: int, runs: int) -> dict[Transport, float]:
    """Share of pixels and channels of each kind of paths, where light arrives. The mean is of the other runs of all
    kinds."""
    found = {transport: [opened.sample(transport, spp, derive_seed(2, "coverage", transport, spp, k))
                         for k in range(runs)] for transport in sides}
    total = np.sum([run.mean for of_side in found.values() for run in of_side], axis=0)
    others = len(found) * runs - 1
    return {transport: float(np.mean([share_inside(run, opened, (total - run.mean) / others) for run in of_side]))
            for transport, of_side in found.items()}


def share_inside(run: Estimate, opened: OpenPass, truth: np.ndarray) -> float:
    """Of the (P, 3) means, those whose interval holds the truth."""
    known = moderated(run, opened.pixels, opened.width)
    lit = truth.mean(axis=1) > 0
    return float((np.abs(known.mean - truth) <= known.interval())[lit].mean())


def confidence(held: Sequence[np.ndarray], failures: float = 0.05) -> tuple[float, float]:
    """Interval of a coverage that misses it in `failures` of all cases. held: for each run (P, C) of truth.

    Channels of a pixel stand or fall together, and pixels of a run share errors: the exact interval of as many
    independent values as have the variance of pixels, or of runs if that is more (Korn and Graubard, Survey Methodology
    24, 1998).
    """
    pixels, runs = np.concatenate([run.mean(axis=1) for run in held]), [run.mean() for run in held if len(run)]
    share, count = float(pixels.mean()), float(len(pixels))
    variance = max(pixels.var() / count, np.var(runs, ddof=1) / len(runs) if len(runs) > 1 else 0)
    if variance > 0:
        count = min(count, share * (1 - share) / variance)
    hits, misses = share * count, (1 - share) * count
    return (float(beta.ppf(failures / 2, hits, misses + 1)) if hits else 0.0,
            float(beta.isf(failures / 2, hits + 1, misses)) if misses else 1.0)


def holds(shares: Mapping[Transport, float]) -> bool:
    """Whether all are as wide as they say."""
    return all(LEAST <= share <= MOST for share in shares.values())
