"""One unit of work, in any process: plan the examples of a view, render, gate, encode and stage them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from dataset_builder.assets.texel_memory import TexelMemory, sharing_texels
from dataset_builder.byte_store import CACHE_SIZE, PASSES, ByteStore
from dataset_builder.digest import digest, sha256_file
from dataset_builder.engine.made_by import field_versions, pass_versions, plan_digest, versions
from dataset_builder.engine.rejected_pixels import keep_pixels
from dataset_builder.errors import OutputError, PlanError, Problem, SpecError, UserError
from dataset_builder.label.example_label import Denoised
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef, ViewUnit
from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.field_shelf import FieldShelf
from dataset_builder.rendering.pass_memory import PassMemory
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.folder import MANIFEST, WORK
from dataset_builder.shards.gates import check_gates, means
from dataset_builder.shards.identities import Violation, check_layers, identity_table, storable
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.published_examples import published_in, taken_over
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleFacts
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec

if TYPE_CHECKING:
    from dataset_builder.rendering.examples import Rendered

PLANNING = "planning"
"""Gate that an example fails which cannot be planned."""

TEXTURES_LOCK = "textures.lock"
"""File below `.build` that a process locks while it reads a large texture."""

FIELDS = "fields"
"""Folder of fields, below `.build` or that of the cache."""

RENDERING = "rendering"
"""Gate that an example fails whose plan asks for what cannot be made, such as a mesh beyond all bounds."""


@dataclass(frozen=True, kw_only=True)
class BuildJob:
    """What a worker needs to know to find the spec and the output; the same for every unit of a build."""

    spec_path: Path
    overrides: tuple[str, ...]
    spec_digest: str
    """Of the spec that the build began with; another one found at `spec_path` later is refused."""
    folder: Path
    backend: str
    threads: int
    """Of each process that renders."""
    denoised: tuple[Denoised, ...] = ()
    """Figures of every layer that is denoised, for the record of each example."""
    cache: Path | None = None
    """Folder for results of passes; None is one in the output folder."""
    cache_size: int = 0
    """Most bytes that it may hold."""
    replaces: str = ""
    """Digest of the `dataset.json` that was there before; empty where there was none."""
    staging_url: str = ""
    """Where finished examples wait for their shard; empty is in the output folder."""

    @classmethod
    def of(cls, loaded: LoadedSpec, folder: Path, *, backend: str, threads: int, cache: Path | None = None,
           cache_size: int = CACHE_SIZE, staging_url: str = "") -> "BuildJob":
        """The job that builds `loaded` into `folder`."""
        manifest = folder / MANIFEST
        replaces = sha256_file(manifest) if manifest.is_file() else ""
        return cls(spec_path=loaded.path, overrides=loaded.overrides, spec_digest=loaded.spec_digest, folder=folder,
                   backend=backend, threads=threads, cache=cache, cache_size=cache_size, replaces=replaces,
                   staging_url=staging_url)

    @property
    def staging(self) -> Staging:
        """Where finished examples wait."""
        return Staging(self.folder, self.staging_url)

    def takes_over(self, key: str, key_digest: str) -> bool:
        """Whether an example is staged; one that is published is staged again, for the shard that it lies in now."""
        return taken_over(key, key_digest, self.staging, published_in(self.folder, self.replaces))

    @property
    def store(self) -> ByteStore:
        """Where results of passes are kept: in the output folder unless the job names another one."""
        return ByteStore(self.cache or self.folder / WORK / PASSES, self.cache_size)

    @property
    def fields(self) -> FieldShelf:
        """Where fields are kept: beside results of passes."""
        return FieldShelf(folder=(self.cache or self.folder / WORK) / FIELDS, made_by=field_versions(self.backend))

    @property
    def memory(self) -> PassMemory:
        """Results of passes in the store."""
        return PassMemory(self.store, pass_versions(self.backend), self.fields.made_by)

    @property
    def texels(self) -> TexelMemory:
        """Where the processes of the build share large textures."""
        return TexelMemory(store=self.store, lock=self.folder / WORK / TEXTURES_LOCK,
                           made_by=digest(pass_versions(self.backend)))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one example."""

    ref: ExampleRef
    digest: str = ""
    """What it is staged under; empty where it was not planned."""
    rejected: Rejected | None = None
    """Why it is not staged."""
    kept: bool = False
    """Whether that was known already and nothing was rendered."""
    paths: int = 0
    """Light paths that were traced for it."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By pass and by step (`plan`, `denoise`, `encode`)."""
    recalled: tuple[str, ...] = ()
    """Passes whose results were remembered."""
    noise: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    """Of every layer with light, why sampling ended, and the relative error."""
    unknown: tuple[str, ...] = ()
    """Layers whose means are not known."""


def run_unit(job: BuildJob, unit: ViewUnit, there: frozenset[str] = frozenset()) -> list[Outcome]:
    """Make the examples of one view; those that are staged already are kept. One outcome per example, in order.

    there: digests of examples that whoever asks has; they are kept, too. Raises SpecError where the spec is no longer
    the one that the build began with.
    """
    activate(job.backend, job.threads)
    with sharing_texels(job.texels):
        return _outcomes(job, unit, there)


def _outcomes(job: BuildJob, unit: ViewUnit, there: frozenset[str]) -> list[Outcome]:
    planner = planner_of(job)
    start = perf_counter()
    outcomes: list[Outcome] = []
    planned: list[tuple[ExampleRef, ExamplePlan]] = []
    for ref in unit.examples:
        try:
            planned.append((ref, planner.example(ref)))
        except PlanError as error:
            outcomes.append(Outcome(ref=ref, rejected=_rejected(ref, PLANNING, str(error))))
    planning = perf_counter() - start
    outcomes = sorted([*outcomes, *_make(planned, planner.loaded, job, there)], key=lambda outcome: outcome.ref.index)
    # The first example was the first to need what the view's examples share
    return [replace(outcomes[0], seconds={"plan": planning, **outcomes[0].seconds}), *outcomes[1:]]


def _make(planned: Sequence[tuple[ExampleRef, ExamplePlan]], loaded: LoadedSpec, job: BuildJob,
          there: frozenset[str]) -> Iterator[Outcome]:
    # Verbs that render nothing import this module, too; they need not wait for Mitsuba
    from dataset_builder.rendering.examples import render_view

    made_by = versions(job.backend, loaded.dataset)
    digests = {ref.key: plan_digest(plan, loaded.dataset, made_by, job.denoised) for ref, plan in planned}
    missing = [(ref, plan) for ref, plan in planned
               if digests[ref.key] not in there and not job.takes_over(ref.key, digests[ref.key])]
    kept = {ref.key for ref, _ in planned} - {ref.key for ref, _ in missing}
    yield from (Outcome(ref=ref, digest=digests[ref.key], kept=True) for ref, _ in planned if ref.key in kept)
    if missing:
        rendered = render_view([plan for _, plan in missing], loaded.path.parent, job.memory, job.fields)
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
                yield Outcome(ref=left, rejected=_rejected(left, RENDERING, str(error)))
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
    noise = {entry.name: (entry.stopped, entry.relative_error) for entry in rendered.record.layers}
    unknown = tuple(entry.name for entry in rendered.record.layers if entry.mean_known == "unknown")
    made = Outcome(ref=ref, digest=key_digest, paths=paths, seconds=rendered.seconds, recalled=rendered.recalled,
                   noise=noise, unknown=unknown)
    if violations := _violations(rendered, spec):
        reason = "; ".join(violation.reason for violation in violations)
        keep_pixels(job.folder, ref.key, rendered.layers)
        return replace(made, rejected=_rejected(ref, violations[0].identity, reason))
    members = encode_members(example_of(rendered, job.denoised), dtype=spec.storage.dtype,
                             preview_png=preview(rendered.layers))
    job.staging.put(ref.key, key_digest, segment(members),
                    entry(key=ref.key, view=rendered.plan.view, facts=ExampleFacts.of(rendered.plan), members=members))
    return replace(made, seconds=rendered.seconds | {"encode": perf_counter() - start})


def _violations(rendered: "Rendered", spec: DatasetSpec) -> list[Violation]:
    """What is wrong with the example as it would be stored, and with the evidence."""
    tolerances = {name: tolerance for name, _, tolerance in identity_table(spec.storage.dtype, True)}
    masks = {name: image for name, image in rendered.evidence.items() if name.startswith("mask")}
    if beyond := storable(rendered.layers, spec.storage.dtype):
        return beyond
    stored = {name: image.astype(spec.storage.dtype).astype(np.float32) for name, image in rendered.layers.items()}
    found = check_layers({**masks, **stored}, dict(rendered.plan.render.layers), tolerances,
                         rendered.plan.field.there)
    spp = rendered.plan.render.spp_first_hit, rendered.plan.render.spp_target
    return [*found, *check_gates(rendered.layers, spec.gates, rendered.evidence, spp),
            *means(rendered.record.layers, spec.gates)]


def _rejected(ref: ExampleRef, gate: str, reason: str) -> Rejected:
    return Rejected(key=ref.key, view=ref.view.name, gate=gate, reason=reason)


@lru_cache(maxsize=2)
def planner_of(job: BuildJob) -> Planner:
    """The planner of a job, kept for the life of the process, so that neighbours share what they share."""
    loaded = load_dataset(job.spec_path, job.overrides)
    if loaded.spec_digest != job.spec_digest:
        rule = "expected the spec that the build started with, got a changed one"
        raise SpecError([Problem(where=str(job.spec_path), path="", rule=rule, hint="run the build again")])
    return Planner(loaded)
