"""Question 4: how much light paths of a given length miss, and the time that longer ones take.

What is missing is a bias, far below the noise of any pixel; so means over all pixels are compared. Runs of one
replicate share their random numbers at every depth, which lets most of the noise cancel in the difference; several
replicates, independent of each other, tell how much is left.
"""

from collections.abc import Iterator, Mapping
from math import sqrt

import numpy as np

from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.examples import Rendered
from dataset_builder.studies.accuracy.budget import REFERENCE_DEPTH
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench, kept
from dataset_builder.studies.sampled import reseeded
from dataset_builder.studies.timing import seconds_of, work_of

DEPTH = "depth"


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """Bias of every depth against the deepest, in every layer."""
    truth = _runs(bench, ref, REFERENCE_DEPTH)
    for depth in bench.budget.depths:
        runs = _runs(bench, ref, depth)
        for layer in bench.extents:
            yield _row(layer, depth, runs, truth)


def _runs(bench: Bench, ref: ExampleRef, depth: int) -> list[Rendered]:
    plan = bench.plan(ref, bench.spp(bench.budget.depth_spp), f"render.max_depth={depth}")
    return [bench.timed(DEPTH, reseeded(plan, "replicate", k), repeats=1) for k in range(bench.budget.replicates)]


def _row(layer: str, depth: int, runs: list[Rendered], truth: list[Rendered]) -> AccuracyRow:
    found = [relative_difference(run.layers[layer], deep.layers[layer], kept(run, deep.layers, layer))
             for run, deep in zip(runs, truth, strict=True)]
    bias, error = mean_and_error(found)
    return AccuracyRow(question=DEPTH, setting=f"depth {depth}", value=depth, example=runs[0].plan.key, layer=layer,
                       seconds=min(seconds_of(layer, run) for run in runs), bias=bias, bias_se=error,
                       **work_of(layer, runs[0].record))


def relative_difference(image: np.ndarray, reference: np.ndarray, keep: np.ndarray) -> float:
    """mean(x - r) / mean(r) over the kept pixels of (H, W, C) images; 0 where the reference is black."""
    mean = float(reference[keep].mean(dtype=np.float64)) if keep.any() else 0.0
    return (float(image[keep].mean(dtype=np.float64)) - mean) / mean if mean else 0.0


def mean_and_error(values: list[float]) -> tuple[float, float]:
    """Mean of independent values and its standard error."""
    return float(np.mean(values)), float(np.std(values, ddof=1)) / sqrt(len(values))


def worst(rows: list[AccuracyRow]) -> Mapping[float, float]:
    """By depth, the largest |bias| that two standard errors allow in any example and layer."""
    found: dict[float, float] = {}
    for row in rows:
        found[row.value] = max(found.get(row.value, 0.0), abs(row.bias) + 2 * row.bias_se)
    return found
