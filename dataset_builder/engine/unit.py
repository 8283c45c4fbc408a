"""One unit of work, in any process: plan the examples of a view, render, gate, encode and stage them."""

import importlib.metadata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.digest import digest
from dataset_builder.engine import source
from dataset_builder.engine.rejections import keep_pixels
from dataset_builder.errors import OutputError, PlanError, Problem, SpecError, UserError
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef, ViewUnit
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import oidn
from dataset_builder.rendering.backend import activate, renderer_versions
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.gates import check_gates
from dataset_builder.shards.identities import Violation, check_layers, identity_table, storable
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.segment import segment
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry, writer_versions
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec

if TYPE_CHECKING:
    from dataset_builder.rendering.examples import Rendered

PLANNING = "planning"
"""Gate that an example fails which cannot be planned."""

RENDERING = "rendering"
"""Gate that an example fails whose plan asks for what cannot be made, such as a mesh beyond all bounds."""


@dataclass(frozen=True, kw_only=True)
class BuildJob:
    """What a worker needs to know to find the spec and the output; the same for every unit of a build.

    spec_digest: of the spec that the build began with; another one found at `spec_path` later is refused. denoised:
    figures of every layer that is denoised, for the record of each example.
    """

    spec_path: Path
    overrides: tuple[str, ...]
    spec_digest: str
    folder: Path
    backend: str
    threads: int
    denoised: tuple[Denoised, ...] = ()

    @classmethod
    def of(cls, loaded: LoadedSpec, folder: Path, *, backend: str, threads: int) -> "BuildJob":
        """The job that builds `loaded` into `folder`; threads: of each process that renders."""
        return cls(spec_path=loaded.path, overrides=loaded.overrides, spec_digest=loaded.spec_digest, folder=folder,
                   backend=backend, threads=threads)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one example: digest it is staged under (empty where it was not planned), or why it is rejected.

    seconds: by pass and by step (`plan`, `encode`); kept: True where that was known already and nothing was rendered.
    """

    ref: ExampleRef
    digest: str
    rejected: Rejected | None
    kept: bool
    paths: int
    seconds: dict[str, float]


def versions(backend: str, denoise: bool = False) -> dict[str, str]:
    """Versions of whatever turns a plan into bytes: a change of any makes an example another one.

    denoise: whether layers are denoised; the denoiser must be installed then.
    """
    names = ("open3d", "scipy", "trimesh", *((oidn.PACKAGE,) if denoise else ()))
    libraries = {name: importlib.metadata.version(name) for name in names}
    code = source.source_digest(source.UNIT, *((source.CALIBRATION,) if denoise else ()))
    return {**writer_versions(), **renderer_versions(backend), **libraries, "source": code}


def plan_digest(plan: ExamplePlan, spec: DatasetSpec, made_by: dict[str, str],
                denoised: Sequence[Denoised] = ()) -> str:
    """Key of a finished example: its plan, how it is stored and gated, what made it, and the figures it carries."""
    stored = {"dtype": spec.storage.dtype, "gates": spec.gates.model_dump(mode="json")}
    return digest({"plan": plan.model_dump(mode="json"), "storage": stored, "versions": made_by,
                   "denoised": [figures.model_dump(mode="json") for figures in denoised]})


def run_unit(job: BuildJob, unit: ViewUnit) -> list[Outcome]:
    """Make the examples of one view; those that are staged already are kept. One outcome per example, in order.

    Raises SpecError where the spec is no longer the one that the build began with.
    """
    activate(job.backend, job.threads)
    planner = planner_of(job)
    start = perf_counter()
    outcomes: list[Outcome] = []
    planned: list[tuple[ExampleRef, ExamplePlan]] = []
    for ref in unit.examples:
        try:
            planned.append((ref, planner.example(ref)))
        except PlanError as error:
            outcomes.append(_outcome(ref, rejected=_rejected(ref, PLANNING, str(error))))
    planning = perf_counter() - start
    outcomes = sorted([*outcomes, *_make(planned, planner.loaded, job)], key=lambda outcome: outcome.ref.index)
    # The first example was the first to need what the view's examples share
    return [replace(outcomes[0], seconds={"plan": planning, **outcomes[0].seconds}), *outcomes[1:]]


def remembered(ref: ExampleRef, rejected: Rejected) -> Outcome:
    """The outcome of an example that an earlier run of the same build rejected."""
    return _outcome(ref, rejected=rejected, kept=True)


def _make(planned: Sequence[tuple[ExampleRef, ExamplePlan]], loaded: LoadedSpec, job: BuildJob) -> Iterator[Outcome]:
    # Verbs that render nothing import this module, too; they need not wait for Mitsuba
    from dataset_builder.rendering.examples import render_view

    made_by = versions(job.backend, bool(loaded.dataset.render.denoise.layers))
    staging = Staging(job.folder)
    digests = {ref.key: plan_digest(plan, loaded.dataset, made_by, job.denoised) for ref, plan in planned}
    missing = [(ref, plan) for ref, plan in planned if not staging.has(ref.key, digests[ref.key])]
    there = {ref.key for ref, _ in planned} - {ref.key for ref, _ in missing}
    yield from (_outcome(ref, digest=digests[ref.key], kept=True) for ref, _ in planned if ref.key in there)
    if missing:
        rendered = render_view([plan for _, plan in missing], loaded.path.parent)
        yield from _finished(missing, rendered, digests, loaded.dataset, job)


def _finished(missing: Sequence[tuple[ExampleRef, ExamplePlan]], rendered: Iterator["Rendered"],
              digests: Mapping[str, str], spec: DatasetSpec, job: BuildJob) -> Iterator[Outcome]:
    """Outcomes of the examples of one view as they are rendered; where a plan cannot be made, of all that are left."""
    for position, (ref, _) in enumerate(missing):
        try:
            example = next(rendered)
        except UserError as error:
            if isinstance(error, OutputError):
                raise
            for left, _ in missing[position:]:
                yield _outcome(left, rejected=_rejected(left, RENDERING, str(error)))
            return
        yield _finish(ref, example, digests[ref.key], spec, job)


def example_of(rendered: "Rendered", denoised: Sequence[Denoised] = ()) -> Example:
    """A rendered example as it is stored; denoised: figures of its denoised layers, for the record."""
    return Example(plan=rendered.plan, layers=rendered.layers,
                   record=rendered.record.model_copy(update={"denoised": tuple(denoised)}))


def _finish(ref: ExampleRef, rendered: "Rendered", key_digest: str, spec: DatasetSpec, job: BuildJob) -> Outcome:
    """Gate, encode and stage one rendered example."""
    start = perf_counter()
    paths = sum(entry.paths for entry in rendered.record.passes if entry.name in rendered.seconds)
    if violations := _violations(rendered, spec):
        reason = "; ".join(violation.reason for violation in violations)
        keep_pixels(job.folder, ref.key, rendered.layers)
        return _outcome(ref, rejected=_rejected(ref, violations[0].identity, reason), digest=key_digest, paths=paths,
                        seconds=rendered.seconds)
    members = encode_members(example_of(rendered, job.denoised), dtype=spec.storage.dtype,
                             preview_png=preview(rendered.layers))
    Staging(job.folder).put(ref.key, key_digest, segment(members),
                            entry(key=ref.key, view=rendered.plan.view, members=members))
    return _outcome(ref, digest=key_digest, paths=paths, seconds=rendered.seconds | {"encode": perf_counter() - start})


def _violations(rendered: "Rendered", spec: DatasetSpec) -> list[Violation]:
    """What is wrong with the example as it would be stored, and with the evidence."""
    tolerances = {name: tolerance for name, _, tolerance in identity_table(spec.storage.dtype)}
    masks = {name: image for name, image in rendered.evidence.items() if name.startswith("mask")}
    if beyond := storable(rendered.layers, spec.storage.dtype):
        return beyond
    stored = {name: image.astype(spec.storage.dtype).astype(np.float32) for name, image in rendered.layers.items()}
    found = check_layers({**masks, **stored}, dict(rendered.plan.render.layers), tolerances)
    spp = rendered.plan.render.spp_first_hit, rendered.plan.render.spp_target
    return [*found, *check_gates(rendered.layers, spec.gates, rendered.evidence, spp)]


def _rejected(ref: ExampleRef, gate: str, reason: str) -> Rejected:
    return Rejected(key=ref.key, view=ref.view.name, gate=gate, reason=reason)


def _outcome(ref: ExampleRef, *, digest: str = "", rejected: Rejected | None = None, kept: bool = False, paths: int = 0,
             seconds: dict[str, float] | None = None) -> Outcome:
    return Outcome(ref=ref, digest=digest, rejected=rejected, kept=kept, paths=paths, seconds=seconds or {})


@lru_cache(maxsize=2)
def planner_of(job: BuildJob) -> Planner:
    """The planner of a job, kept for the life of the process, so that neighbours share what they share."""
    loaded = load_dataset(job.spec_path, job.overrides)
    if loaded.spec_digest != job.spec_digest:
        rule = "expected the spec that the build started with, got a changed one"
        raise SpecError([Problem(where=str(job.spec_path), path="", rule=rule, hint="run the build again")])
    return Planner(loaded)
