"""How examples of a dataset differ: many of them, each rendered once at few spp, without a reference.

What noise the renderer claims for them is put to scale by the examples that have references; the time they take tells
how fast passes run beyond the few examples of the other questions, and what an example costs besides its passes.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from time import perf_counter, process_time

import numpy as np
from scipy.special import nctdtrinc, ndtr, stdtrit

from dataset_builder.layers import LAYERS
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.studies.accuracy.laws import Law, interval, of_layer
from dataset_builder.studies.accuracy.rows import OTHERS, UNIFORM, WHOLE, AccuracyRow, of
from dataset_builder.studies.accuracy.workbench import Bench
from dataset_builder.studies.renders import reached_by, render, seconds_of, unknown_in, work_of

SURE = 0.9
"""Confidence with which a share of the dataset is said to lie below a limit."""


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """One example: a row for each layer, and one for the rest: planning, meshes, and passes of no layer under study."""
    start, worked = perf_counter(), process_time()
    plan = bench.plan(ref, bench.spp(bench.budget.others_spp))
    planned = perf_counter() - start, process_time() - worked
    bench.warm.up("others", plan, bench.spec.mesh_root)
    start, worked = perf_counter(), process_time()
    found = render(plan, bench.spec.mesh_root)
    whole = perf_counter() - start + planned[0], process_time() - worked + planned[1]
    passes = {LAYERS[layer].render_pass for layer in bench.extents}
    row = AccuracyRow(question=OTHERS, setting=f"{bench.budget.others_spp} spp", value=bench.budget.others_spp,
                      example=plan.key, layer=WHOLE,
                      seconds=whole[0] - sum(found.seconds.get(name, 0.0) for name in passes),
                      cpu_seconds=whole[1] - sum(found.cpu_seconds.get(name, 0.0) for name in passes))
    yield row
    for layer in bench.extents:
        work = work_of(layer, found.record)
        yield replace(row, layer=layer, seconds=seconds_of(layer, found), reached=reached_by(layer, found.record),
                      cpu_seconds=seconds_of(layer, found, found.cpu_seconds), spp=work["spp"], paths=work["paths"],
                      unknown=float(unknown_in(layer, found.record)))


@dataclass(frozen=True, kw_only=True)
class NoiseSpread:
    """How the noise of a layer is spread over a dataset: relMSE at one sample per pixel is log-normal."""

    median: float
    within: tuple[float, float]
    """95% interval of the median."""
    limit: float
    """95% of the examples are expected below this, what is not known of median and spread included, and of those
    measured."""
    deviation: float
    """Of the logarithm."""
    values: tuple[float, ...]
    """Of the examples that were measured, rising; without those of unknown mean, unless there are no others."""
    unknown: int = 0
    """Examples whose mean is not known: what rare bright paths bring follows no law of samples."""
    measured: int = 0
    """All examples that were looked at."""

    @property
    def mean(self) -> float:
        """Over the examples that were measured."""
        return float(np.mean(self.values))


def sure_share(count: int) -> float:
    """The share p of a normal population that lies below the limit of its next value, from `count` values of it, with a
    confidence of `SURE`: mean + k s is above the quantile z_p where a noncentral t of count - 1 degrees of freedom and
    noncentrality z_p sqrt(count) is below k sqrt(count) (G. Hahn and W. Meeker, Statistical Intervals, 1991, section
    4.6). 0 from fewer than two."""
    if count < 2:
        return 0.0
    root = math.sqrt(count)
    return float(ndtr(nctdtrinc(count - 1, SURE, _factor(count) * root) / root))


def _factor(count: int) -> float:
    """Deviations above the mean of `count` normal values, 2 at least, up to which the next is with 95% probability."""
    return float(stdtrit(count - 1, 0.95)) * math.sqrt(1 + 1 / count)


def spread_of(rows: Sequence[AccuracyRow], laws: Sequence[Law], layer: str) -> NoiseSpread:
    """The spread of a layer's noise over examples, from claims of the renderer that are put to scale by references.

    The limit is that of the next example of a normal sample: mean + t(0.95, K - 1) s sqrt(1 + 1/K) in logarithms
    (G. Hahn and W. Meeker, Statistical Intervals, 1991, section 4.7), from the K examples, or their 95% quantile where
    tails are longer than that; from one, its own value. Examples whose mean is not known are counted alone, unless
    there are no others.
    """
    scale = interval(_claims(rows, laws, layer))[0]
    others = of(rows, OTHERS, layer)
    known = [row for row in others if row.unknown != 1] or others
    seen = [row.reached**2 * row.spp * scale for row in known if row.reached > 0]
    values = np.sort([value for value in seen if math.isfinite(value)] or
                     [law.error.slope for law in of_layer(laws, UNIFORM, layer)])
    middle, low, high = interval(values.tolist())
    count, deviation = len(values), float(np.log(values).std(ddof=1)) if len(values) > 1 else 0.0
    wide = _factor(count) * deviation if count > 1 else 0.0
    limit = max(middle * math.exp(wide), float(np.quantile(values, 0.95)))
    return NoiseSpread(median=middle, within=(low, high), limit=limit, deviation=deviation,
                       values=tuple(values.tolist()), measured=len(others),
                       unknown=sum(row.unknown == 1 for row in others))


def _claims(rows: Sequence[AccuracyRow], laws: Sequence[Law], layer: str) -> list[float]:
    """Of every example with a law, relMSE over what the renderer claims at the samples nearest to the others'."""
    found, wanted = [], next((row.spp for row in of(rows, OTHERS, layer)), 1.0)
    for law in of_layer(laws, UNIFORM, layer):
        own = [row for row in of(rows, UNIFORM, layer) if row.example == law.example and row.reached > 0]
        if own:
            near = min(own, key=lambda row: abs(math.log(row.spp / wanted))).spp
            claimed = float(np.mean([row.reached**2 for row in own if row.spp == near]))
            found.append(law.error.at(1 / near) / claimed)
    return found


def pace_of(rows: Sequence[AccuracyRow], laws: Sequence[Law], layer: str, clock: str) -> tuple[float, float]:
    """Seconds per path of a layer's pass and their standard error, over all examples that were measured.

    A ratio of sums, Cochran, Sampling Techniques, 3rd ed., eq. 6.13: long examples count for more.
    """
    fixed = fixed_of(laws, layer)
    own = [row for row in of(rows, OTHERS, layer) if row.paths > 0] or of(rows, UNIFORM, layer)
    seconds = np.maximum([getattr(row, clock) - fixed for row in own], 0.0)
    paths = np.array([row.paths for row in own])
    pace = float(seconds.sum() / paths.sum())
    left, count = seconds - pace * paths, len(own)
    error = math.sqrt(float(np.sum(left**2)) / max(count - 1, 1) / count) / float(paths.mean())
    return pace, error


def fixed_of(laws: Sequence[Law], layer: str) -> float:
    """Seconds of a layer's pass whatever its samples, the mean over examples."""
    return float(np.mean([law.time.rest for law in of_layer(laws, UNIFORM, layer)] or [0.0]))


def rest_of(rows: Sequence[AccuracyRow], clock: str) -> float:
    """Seconds of an example besides the passes under study, the median over examples; NaN where none was measured."""
    times = [getattr(row, clock) for row in of(rows, OTHERS, WHOLE)]
    return float(np.median(times)) if times else math.nan
