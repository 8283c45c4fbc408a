"""Questions 4 to 6: what short paths, coarse rough meshes and small textures do to a picture, and what is enough.

Of paths, what is missing is a bias, far below the noise of any pixel; so means over all pixels are compared. Runs of
one replicate share their random numbers at every depth, which lets most of the noise cancel in the difference; several
replicates, independent of each other, tell how much is left.

Vertex noise is drawn per vertex, so meshes of different edge lengths carry different noise and cannot be compared pixel
by pixel. With sigma 0 they are the limit surface and nothing else. Samples of both pictures are independent, so that
the noise of both is known and taken out: what is left is the difference of the surfaces.

Pictures of two texture sizes follow the same random numbers, so that their difference is that of the textures; it has
no noise in D. In I_t paths part where roulette asks the albedo, and what their noise may explain is an upper bound.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import sqrt
from time import perf_counter, process_time

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.geometry.rough_steps import base_of
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.rendering.examples import Rendered
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.curves import Advice, Point, curve
from dataset_builder.studies.accuracy.laws import KNOWN
from dataset_builder.studies.accuracy.rows import AccuracyRow, layers_in, of
from dataset_builder.studies.accuracy.workbench import REFERENCE_DEPTH, Bench, compare, kept
from dataset_builder.studies.image_errors import relative_variance
from dataset_builder.studies.renders import reached_by, seconds_of, work_of
from dataset_builder.studies.sampled import reseeded

DEPTH, EDGES, TEXTURES = "depth", "edge-length", "texture-size"
EDGE_LAYER = "s_prime"
TEXTURED = {"d": "object", "i_t": "object"}
NEAR = 0.5
"""Share of a layer's noise that another error may have: both together are then an eighth more than the noise alone."""


def measure_depth(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """Bias of every depth against the deepest, in every layer."""
    truth = _depth_runs(bench, ref, REFERENCE_DEPTH)
    for depth in bench.budget.depths:
        runs = _depth_runs(bench, ref, depth)
        for layer in bench.extents:
            yield _depth_row(layer, depth, runs, truth)


def _depth_runs(bench: Bench, ref: ExampleRef, depth: int) -> list[Rendered]:
    plan = bench.plan(ref, bench.spp(bench.budget.depth_spp), f"render.max_depth={depth}")
    return [bench.timed(DEPTH, reseeded(plan, "replicate", k), repeats=1) for k in range(bench.budget.replicates)]


def _depth_row(layer: str, depth: int, runs: list[Rendered], truth: list[Rendered]) -> AccuracyRow:
    bias, error = mean_and_error([_bias(run, deep.layers, layer) for run, deep in zip(runs, truth, strict=True)])
    return AccuracyRow(question=DEPTH, setting=f"depth {depth}", value=depth, example=runs[0].plan.key, layer=layer,
                       seconds=min(seconds_of(layer, run) for run in runs), bias=bias, bias_se=error,
                       cpu_seconds=min(seconds_of(layer, run, run.cpu_seconds) for run in runs),
                       **work_of(layer, runs[0].record))


def _bias(found: Rendered, reference: Mapping[str, np.ndarray], layer: str) -> float:
    return relative_difference(found.layers[layer], reference[layer], kept(found, reference, layer))


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


def measure_edges(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """S' of every edge length against the finest, with the triangles and the seconds of mesh and pass."""
    own = bench.spec.plan(ref).rough.edge_length
    *factors, last = bench.budget.edges
    finest = own * last
    fine = _edge_plan(bench, ref, finest)
    try:
        reference = bench.timed(EDGES, reseeded(fine, "finest"), repeats=1).layers
    except UserError as error:
        # A finest mesh beyond all bounds is no reason to go without the other questions
        yield AccuracyRow(question=EDGES, setting=f"{finest:g} m: {error}", value=finest, example=fine.key,
                          layer=EDGE_LAYER)
        return
    for factor in factors:
        plan = _edge_plan(bench, ref, length := own * factor)
        seconds, worked, triangles = mesh_cost(plan, bench)
        found = bench.timed(EDGES, plan)
        row = compare(EDGES, named(factor), length, found, reference, EDGE_LAYER)
        keep = kept(found, reference, EDGE_LAYER)
        own_noise = relative_variance(found.layers[f"{EDGE_LAYER}_se"], reference[EDGE_LAYER], keep)
        noise = row.relmse_reference + own_noise
        yield replace(row, relmse=max(row.relmse_measured - noise, 0.0), relmse_reference=noise,
                      floor=KNOWN * noise, triangles=triangles, seconds=row.seconds + seconds, reached=float("nan"),
                      cpu_seconds=row.cpu_seconds + worked, bias=_bias(found, reference, EDGE_LAYER))


def named(factor: float) -> str:
    """The setting of an edge length, as a factor on the example's own."""
    return f"{factor:g} x"


def _edge_plan(bench: Bench, ref: ExampleRef, length: float) -> ExamplePlan:
    levels = ", ".join("0" for _ in bench.spec.dataset.rough.levels)
    plain = ("rough.level=null", "rough.steps=null", "rough.fields=[]", "rough.edge=null")
    return bench.plan(ref, bench.spp(bench.budget.passes), *plain, f"rough.sigma=[{levels}]",
                      f"rough.edge_length={length!r}", "storage.standard_errors=true", layers={EDGE_LAYER: "object"})


def mesh_cost(plan: ExamplePlan, bench: Bench) -> tuple[float, float, int]:
    """Wall and CPU seconds to make the subdivided mesh of a plan, and its triangles."""
    asset, rough = asset_of(plan.target.object, bench.spec.mesh_root), plan.rough
    start, worked = perf_counter(), process_time()
    base = base_of(asset.mesh, edge_length=rough.edge_length, rounds=rough.rounds, crease_angle=rough.crease_angle,
                   coarsen=rough.coarsen, triangles=rough.triangles)
    return perf_counter() - start, process_time() - worked, len(base.mesh.faces)


def measure_textures(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """D and I_t of every texture size against the dataset's own."""
    own = bench.spec.dataset.render.texture_size
    full = bench.timed(TEXTURES, bench.plan(ref, bench.spp(bench.budget.passes), layers=TEXTURED))
    for size in [size for size in bench.budget.textures if size < own]:
        plan = bench.plan(ref, bench.spp(bench.budget.passes), f"render.texture_size={size}", layers=TEXTURED)
        found = bench.timed(TEXTURES, plan)
        for row in bench.compared(TEXTURES, f"{size} texels", size, found, full.layers, TEXTURED):
            noise = sum(reached_by(row.layer, one.record) ** 2 for one in (found, full))
            yield replace(row, bias=_bias(found, full.layers, row.layer), relmse=max(row.relmse - noise, 0.0),
                          relmse_reference=noise, floor=min(noise, row.relmse))


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    """Sentences and overrides of all three questions."""
    _depth(advice, rows, spec)
    _edges(advice, rows, spec)
    _textures(advice, rows, spec)


def _depth(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    missing = worst(of(rows, DEPTH))
    if not missing:
        return
    enough = [depth for depth, bias in missing.items() if bias <= spec.render.bias]
    figures = ", ".join(f"{bias:.2%} at {depth:.0f}" for depth, bias in missing.items())
    said = (f"{min(enough):.0f} edges suffice for" if enough else "None of these depths suffices for")
    advice.sentences[DEPTH] = f"{said} a bias of {spec.render.bias:.1%}; the worst of any example and layer, with " \
                              f"two standard errors: {figures}."
    if spec.render.max_depth == "auto":
        advice.sentences[DEPTH] += " The spec leaves the depth to planning, which bounds it for every scene."
        advice.overrides.append("render.max_depth=auto")
    elif enough:
        advice.overrides.append(f"render.max_depth={min(enough):.0f}")


def _edges(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    points = curve(rows, EDGES, EDGE_LAYER)
    if not points:
        return
    bound = NEAR * advice.noise.get(EDGE_LAYER, spec.render.bias)
    # From the coarsest: the first that is good enough, and with it all finer ones
    chosen = _first_below(sorted(points, key=lambda point: -point.value), bound)
    figures = ", ".join(f"{_shown(point)} at {point.setting}" for point in points)
    advice.sentences[EDGES] = (
        f"{chosen.setting + ' its own edge length' if chosen else 'None of these edge lengths'} keeps the surface's "
        f"own error in S' below {bound:.1%}; it is {figures}.")
    if chosen:
        advice.marked[EDGES, EDGE_LAYER] = chosen
        if isinstance(spec.rough.edge_length, float | int) and spec.rough.edge is None:
            factor = float(chosen.setting.split()[0])
            advice.overrides.append(f"rough.edge_length={spec.rough.edge_length * factor:g}")


def _textures(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    wanted = []
    for layer in layers_in(rows, TEXTURES):
        bound = NEAR * advice.noise.get(layer, spec.render.bias)
        points = sorted(curve(rows, TEXTURES, layer), key=lambda point: point.value)
        chosen = _first_below(points, bound)
        wanted.append(chosen.value if chosen else spec.render.texture_size)
        figures = ", ".join(f"{_shown(point)} at {point.value:.0f}" for point in points)
        so_far = advice.sentences.get(TEXTURES, "")
        advice.sentences[TEXTURES] = f"{so_far} In {layer}, {wanted[-1]:.0f} texels per side keep the error below " \
                                     f"{bound:.1%}; it is {figures}.".strip()
        if chosen:
            advice.marked[TEXTURES, layer] = chosen
    if wanted:
        advice.overrides.append(f"render.texture_size={max(wanted):.0f}")


def _first_below(points: Sequence[Point], bound: float) -> Point | None:
    """The first point that is below the bound with all that follow it."""
    below = None
    for point in reversed(points):
        if point.error > bound:
            break
        below = point
    return below


def _shown(point: Point) -> str:
    return f"{'at most ' if point.at_floor else ''}{point.error:.2%}"
