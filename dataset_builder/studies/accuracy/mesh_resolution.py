"""Question 5: how fine the rough mesh must be for S'.

Vertex noise is drawn per vertex, so meshes of different edge lengths carry different noise and cannot be compared pixel
by pixel. With sigma 0 they are the limit surface and nothing else. Samples of both pictures are independent, so that
the noise of both is known and taken out: what is left is the difference of the surfaces.
"""

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

from dataset_builder.errors import UserError
from dataset_builder.geometry.rough_base import rough_base
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.studies.accuracy.depth import relative_difference
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.accuracy.workbench import Bench, compare, kept
from dataset_builder.studies.image_errors import relative_variance
from dataset_builder.studies.sampled import reseeded

EDGES, LAYER = "edge-length", "s_prime"
ROUGH = {LAYER: "object"}
KNOWN = 0.2
"""Share of the noise of both pictures that taking it out may leave: it is known from a few batches per pixel."""


def measure(bench: Bench, ref: ExampleRef) -> Iterator[AccuracyRow]:
    """S' of every edge length against the finest, with the triangles and the seconds of mesh and pass."""
    own = bench.spec.plan(ref).rough.edge_length
    *factors, last = bench.budget.edges
    finest = own * last
    fine = _plan(bench, ref, finest)
    try:
        reference = bench.timed(EDGES, reseeded(fine, "finest"), repeats=1).layers
    except UserError as error:
        # A finest mesh beyond all bounds is no reason to go without the other questions
        yield _refused(fine, finest, str(error))
        return
    for factor in factors:
        plan = _plan(bench, ref, length := own * factor)
        seconds, triangles = mesh_cost(plan, bench)
        found = bench.timed(EDGES, plan)
        row = compare(EDGES, named(factor), length, found, reference, LAYER)
        keep = kept(found, reference, LAYER)
        own_noise = relative_variance(found.layers[f"{LAYER}_se"], reference[LAYER], keep)
        noise = row.relmse_reference + own_noise
        yield replace(row, relmse=max(row.relmse_measured - noise, 0.0), relmse_reference=noise,
                      floor=KNOWN * noise, triangles=triangles, seconds=row.seconds + seconds, reached=float("nan"),
                      bias=relative_difference(found.layers[LAYER], reference[LAYER], keep))


def named(factor: float) -> str:
    """The setting of an edge length, as a factor on the example's own."""
    return f"{factor:g} x"


def _plan(bench: Bench, ref: ExampleRef, length: float) -> ExamplePlan:
    levels = ", ".join("0" for _ in bench.spec.dataset.rough.levels)
    return bench.plan(ref, bench.spp(bench.budget.passes), f"rough.sigma=[{levels}]", f"rough.edge_length={length!r}",
                      "storage.standard_errors=true", layers=ROUGH)


def mesh_cost(plan: ExamplePlan, bench: Bench) -> tuple[float, int]:
    """Seconds to make the subdivided mesh of a plan, and its triangles."""
    asset, rough = asset_of(plan.target.object, bench.spec.mesh_root), plan.rough
    start = perf_counter()
    base = rough_base(asset.mesh, edge_length=rough.edge_length, rounds=rough.rounds, crease_angle=rough.crease_angle)
    return perf_counter() - start, len(base.mesh.faces)


def _refused(plan: ExamplePlan, length: float, reason: str) -> AccuracyRow:
    return AccuracyRow(question=EDGES, setting=f"{length:g} m: {reason}", value=length, example=plan.key, layer=LAYER)
