"""One machine of a build on many: what it is given, what it does with it, and what it sends back. Knows no Ray."""

import os
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from dataset_builder.engine.field_tasks import FieldNews, NeededFields
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.parcel import CACHE, Parcel, build_folder, own_folder
from dataset_builder.engine.rejected_pixels import keep_file, pictures
from dataset_builder.engine.unit import BuildJob, Outcome, planner_of, run_unit
from dataset_builder.errors import SpecError, UserError
from dataset_builder.files import write_atomic
from dataset_builder.planning.catalogue import ViewUnit
from dataset_builder.planning.field_needs import field_needs
from dataset_builder.shards.staging import Staged
from dataset_builder.spec.mesh_source import FIELD_SUFFIX

SPEC, OUT = "spec", "out"
Bytes = Callable[[], bytes]
"""Gives the bytes of a file when they are asked for."""


@dataclass(frozen=True, kw_only=True)
class Shipment:
    """What a machine needs to work for a build; the same for all of its units."""

    build: str
    """A name of its own."""
    job: BuildJob
    """As the machine that hands out has it."""
    made_by: Mapping[str, str]
    """Versions that it has."""
    parcel: Parcel
    contents: tuple[Any, ...]
    """What stands for the bytes of the parcel's files."""
    published: frozenset[str] = frozenset()
    """Digests of examples that the old dataset has."""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """What stands for the bytes of fields that are there, by key."""


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """What comes back of one unit."""

    result: Any = None
    error: BaseException | None = None
    """What its work raised."""
    staged: Mapping[tuple[str, str], Staged] = field(default_factory=dict)
    """Finished examples by key and digest, where they travel."""
    pixels: Mapping[str, bytes] = field(default_factory=dict)
    """Files of rejected examples."""
    fields: Mapping[str, bytes] = field(default_factory=dict)
    """Files of fields, by name."""


@dataclass(frozen=True)
class Hands:
    """A machine that is ready to work for a build."""

    shipment: Shipment
    job: BuildJob
    """As this machine has it."""
    get: Callable[[Any], bytes]

    @classmethod
    def ready(cls, shipment: Shipment, get: Callable[[Any], bytes]) -> "Hands":
        """Find or unpack the spec. get: the bytes of what stands for them. Raises UserError, naming this machine, where
        its versions differ, and where the spec is another one here."""
        job = shipment.job
        folder = build_folder(shipment.build)
        cache = job.cache or own_folder() / CACHE
        job = replace(job, folder=folder / OUT, cache=cache)
        try:
            # A disk that all machines have
            planner = planner_of(job)
        except (UserError, OSError):
            contents = [partial(get, each) for each in shipment.contents]
            job = replace(job, spec_path=shipment.parcel.unpacked(folder / SPEC, contents))
            try:
                planner = planner_of(job)
            except SpecError as error:
                raise UserError(f"machine {socket.gethostname()}: the spec cannot be used there: {error}") from error
        require_same(shipment.made_by, versions(job.backend, planner.loaded.dataset), socket.gethostname())
        return cls(shipment, job, get)

    def work(self, work: Callable[..., Any], unit: Any, there: frozenset[str], told: tuple[Any, ...],
             distrusted: frozenset[str] = frozenset()) -> Delivery:
        """Do one unit. there: digests of its examples that were finished before; distrusted: of examples that turned
        out not to be."""
        self._bring_fields(unit)
        if work is run_unit:
            there = (there | self.shipment.published) - distrusted
            result = run_unit(self.job, unit, there)
            return Delivery(result=result, staged=self._staged(result, there), pixels=self._pixels(result))
        result = work(self.job, unit, *told)
        return Delivery(result=result, fields=self._made(result))

    def _bring_fields(self, unit: Any) -> None:
        """Put the fields that a unit needs where it looks for them."""
        if not self.shipment.fields:
            return
        shelf, planner = self.job.fields, planner_of(self.job)
        refs = unit.examples if isinstance(unit, ViewUnit) else [unit] if unit in planner.examples else []
        needed = NeededFields.of(field_needs(planner, refs), shelf)
        for key, task in needed.tasks.items():
            path = shelf.path(task, planner.loaded.path.parent)
            if key in self.shipment.fields and not path.is_file():
                write_atomic(path, self.get(self.shipment.fields[key]))

    def _staged(self, outcomes: Sequence[Outcome], there: frozenset[str]) -> dict[tuple[str, str], Staged]:
        if self.job.staging_url:
            return {}
        staging, found = self.job.staging, dict[tuple[str, str], Staged]()
        for outcome in outcomes:
            if not outcome.rejected and outcome.digest not in there:
                found[outcome.ref.key, outcome.digest] = staging.get(outcome.ref.key, outcome.digest)
                staging.drop(outcome.ref.key)
        return found

    def _pixels(self, outcomes: Sequence[Outcome]) -> dict[str, bytes]:
        keys = {outcome.ref.key for outcome in outcomes if outcome.rejected}
        found = dict[str, bytes]()
        for path in pictures(self.job.folder) if keys else ():
            if path.name.partition(".")[0] in keys:
                found[path.name] = path.read_bytes()
                path.unlink()
        return found

    def _made(self, result: Any) -> dict[str, bytes]:
        if not isinstance(result, FieldNews) or result.record is None or self.job.fields.folder is None:
            return {}
        name = f"{result.key}{FIELD_SUFFIX}"
        return {name: (self.job.fields.folder / name).read_bytes()}


def require_same(expected: Mapping[str, str], got: Mapping[str, str], machine: str) -> None:
    """Raise UserError, with all that differs, where a machine would make other bytes."""
    different = [f"{name} {got.get(name) or 'none'} instead of {expected.get(name) or 'none'}"
                 for name in sorted({*expected, *got}) if expected.get(name) != got.get(name)]
    if different:
        said = ", ".join(text if len(text) < 60 else f"{text.split()[0]} another one" for text in different)
        raise UserError(f"machine {machine}: expected the versions that the build began with, got {said} (install the "
                        "same there, or leave the machine out; two kinds never make one dataset)")


def keep(delivery: Delivery, job: BuildJob) -> None:
    """Put what came back where a build on this machine would have put it. Raises OutputError."""
    for (key, digest), staged in delivery.staged.items():
        job.staging.put(key, digest, staged.segment, staged.entry)
    for name, data in delivery.pixels.items():
        keep_file(job.folder, name, data)
    for name, data in delivery.fields.items():
        if job.fields.folder is not None:
            write_atomic(job.fields.folder / name, data)


def lost(outcomes: Sequence[Outcome], job: BuildJob) -> frozenset[str]:
    """Digests of examples that were kept since they were thought to be there, and are not any more."""
    return frozenset(outcome.digest for outcome in outcomes if outcome.kept and not outcome.rejected
                     and not job.takes_over(outcome.ref.key, outcome.digest))


def here(path: Path) -> Path:
    """A path that does not depend on the folder that a process works in."""
    return Path(os.path.abspath(path))
