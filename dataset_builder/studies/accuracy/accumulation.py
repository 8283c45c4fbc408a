"""Question 8: what float32 sums lose, on the very samples of a picture.

A picture of many pixels with one sample each is, read as a list in random order, what one large pixel would sum. The
sum in float32, one after the other, is compared with the one in float64, and with what the renderer does: float32
within a batch, float64 from there on.
"""

from collections.abc import Iterator
from math import isqrt

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.sampling.adaptive import BATCH_SIZES
from dataset_builder.seeding import rng
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench
from dataset_builder.studies.timing import render

ACCUMULATION, LAYER = "accumulation", "i_t"
RUNNING, BATCHED, NOISE = "float32 throughout", "float32 in batches, float64 across", "standard error of the mean"


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """Relative drift of both kinds of sum, and the noise that the mean has anyway, at every length."""
    plan = one_sample_each(bench.plan(ref, layers={LAYER: "frame"}), max(bench.budget.counts))
    # One sample has no error that could be known, and the record's figures are not wanted here
    with np.errstate(invalid="ignore"):
        pixels = render(plan, bench.spec.mesh_root).layers[LAYER].mean(axis=2).ravel()
    samples = rng(int(plan.render.seed), "order").permutation(pixels)
    for count in bench.budget.counts:
        part = samples[:count]
        for name, value in zip((RUNNING, BATCHED, NOISE), drifts(part, max(BATCH_SIZES)), strict=True):
            yield AccuracyRow(question=ACCUMULATION, setting=name, value=count, example=plan.key, layer=LAYER,
                              drift=value)


def one_sample_each(plan: ExamplePlan, count: int) -> ExamplePlan:
    """The same picture with at least `count` pixels and one sample in each."""
    side = isqrt(count - 1) + 1
    changed = {"width": side, "height": side, "batches": 1} | dict.fromkeys(
        ("spp_first_hit", "spp_source", "spp_target", "spp_rough"), 1)
    return plan.model_copy(update={"render": plan.render.model_copy(update=changed)})


def drifts(samples: np.ndarray, batch: int) -> tuple[float, float, float]:
    """For (N,) float32 samples >= 0: relative difference from the float64 sum of the float32 one, one after the other,
    and of one that is float32 within batches and float64 across; and the relative standard error of their mean."""
    exact = float(np.sum(samples, dtype=np.float64))
    if not exact:
        return 0.0, 0.0, 0.0
    # cumsum adds one after the other, where sum would add pairs
    running = float(np.cumsum(samples, dtype=np.float32)[-1])
    whole = len(samples) // batch * batch
    parts = np.cumsum(samples[:whole].reshape(-1, batch), axis=1, dtype=np.float32)[:, -1]
    rest = np.cumsum(samples[whole:], dtype=np.float32)[-1:]
    batched = float(np.sum(parts, dtype=np.float64) + np.sum(rest, dtype=np.float64))
    noise = float(np.std(samples, dtype=np.float64)) / len(samples) ** 0.5 / (exact / len(samples))
    return abs(running / exact - 1), abs(batched / exact - 1), noise
