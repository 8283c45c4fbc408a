"""What an export wrote: a record of each shard while it runs, `export.json` when it is whole.

`export.json` is written last. Until then `.export/` says which shards are done, so that the same command goes on where
it was stopped.
"""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from dataset_builder.digest import canonical_json, read_regular, sealed, sha256_file, unsealed
from dataset_builder.errors import OutputError, Problem, ShardError
from dataset_builder.exporting.formats.source_shard import ExportFile
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.lock import locked
from dataset_builder.shards.folder import MOST_BYTES
from dataset_builder.shards.manifest import LayerRecord, Manifest, from_json
from dataset_builder.spec.model import Model

RECORD, WORK, JOB = "export.json", ".export", "job"
ExportFormat = Literal["mds", "parquet", "exr", "dali"]


class ExportUnit(Model):
    """The files of one shard of the dataset."""

    shard: str
    split: str
    files: tuple[ExportFile, ...]


class ExportRecord(Model):
    """What `export.json` holds."""

    format: Literal["3df-lighting-export"] = "3df-lighting-export"
    schema_version: Literal["1"] = "1"
    kind: ExportFormat
    job: str
    """Digest of the dataset's manifest and of what was chosen of it."""
    examples: int
    layers: tuple[LayerRecord, ...]
    units: tuple[ExportUnit, ...]
    heads: tuple[ExportFile, ...]
    """What the format says of all files together."""
    source: Manifest
    """The dataset's own, without shards and rejected examples: title, licence, sources, identities."""


@dataclass
class ExportFolder:
    """A folder that an export writes into, and the shards that are there already, by stem."""

    path: Path
    job: str
    done: dict[str, ExportUnit] = field(default_factory=dict)
    finished: bool = False

    def keep(self, unit: ExportUnit) -> None:
        """Record a shard as done."""
        self.done[unit.shard] = unit
        content = {"job": self.job, "unit": unit.model_dump(mode="json")}
        write_atomic(self.path / WORK / f"{unit.shard}.json", sealed(content))

    def finish(self, record: ExportRecord) -> None:
        """Write `export.json`, and remove what was needed until now."""
        write_atomic(self.path / RECORD, canonical_json(record.model_dump(mode="json")) + b"\n")
        self.finished = True


@contextmanager
def export_folder(path: Path, job: str) -> Iterator[ExportFolder]:
    """Hold the folder of an export, new or of the same job, with the shards whose files are all as recorded.

    Raises OutputError where another export runs there, or there is anything else: nothing is overwritten.
    """
    _require_own(path, job)
    with locked(path / WORK / "lock", folder=path, work="export"):
        write_atomic(path / WORK / JOB, sealed({"job": job}))
        folder, finished = ExportFolder(path=path, job=job), _finished(path)
        units = _units(path, job) if finished is None else list(finished.units)
        folder.done = {unit.shard: unit for unit in units if _whole(path, unit.files)}
        folder.finished = finished is not None and len(folder.done) == len(units) and _whole(path, finished.heads)
        if finished is not None and not folder.finished:
            # It would say that all is there while something is written again
            for unit in folder.done.values():
                folder.keep(unit)
            with output_errors(path):
                (path / RECORD).unlink()
        yield folder
        if folder.finished:
            with output_errors(path):
                shutil.rmtree(path / WORK)


def _require_own(path: Path, job: str) -> None:
    if not os.path.lexists(path) or (path.is_dir() and not any(path.iterdir())):
        return
    found = _finished(path) if path.is_dir() else None
    begun = _read(path / WORK / JOB) if found is None else {"job": found.job}
    if begun is None or begun.get("job") != job:
        what = "something else" if begun is None else "an export of another dataset, format, split or layers"
        raise OutputError([Problem(where=str(path), path="", hint="name another folder, or remove it",
                                   rule=f"expected no such folder yet, or this very export, got {what}")])


def _finished(path: Path) -> ExportRecord | None:
    """The record of a whole export; None where there is none, or something else."""
    try:
        return from_json(ExportRecord, read_regular(path / RECORD, most=MOST_BYTES), where=str(path / RECORD))
    except (OSError, ShardError):
        return None


def _units(path: Path, job: str) -> list[ExportUnit]:
    records = map(_read, sorted((path / WORK).glob("*.json")))
    return [ExportUnit.model_validate(record["unit"], strict=False) for record in records
            if record is not None and record.get("job") == job]


def _read(path: Path) -> dict[str, object] | None:
    try:
        return unsealed(read_regular(path, most=MOST_BYTES))
    except OSError:
        return None


def _whole(path: Path, files: Sequence[ExportFile]) -> bool:
    """Whether every file is there with the bytes that were written."""
    try:
        return all(sha256_file(path / file.name, most=file.bytes) == file.sha256 for file in files)
    except OSError:
        return False
