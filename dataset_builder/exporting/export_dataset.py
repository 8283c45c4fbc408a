"""A dataset, or some of its splits and layers, in a format of others: shard by shard, checked on both sides."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import digest, sha256_file
from dataset_builder.errors import Problem, UserError
from dataset_builder.exporting.export_record import (
    ExportFolder,
    ExportFormat,
    ExportRecord,
    ExportUnit,
    export_folder,
)
from dataset_builder.exporting.formats import dali_index, layered_exr, mds_shards, parquet_rows
from dataset_builder.exporting.formats.source_shard import ExportFile, SourceShard
from dataset_builder.files import require_space
from dataset_builder.shards.folder import MANIFEST
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.reader import open_dataset
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.structure import read_small
from dataset_builder.shards.writer import index_path
from dataset_builder.spec.problems import nearest

WRITERS: dict[ExportFormat, Callable[[SourceShard, Path], Iterator[ExportFile]]] = {
    "mds": mds_shards.write_shard, "parquet": parquet_rows.write_shard, "exr": layered_exr.write_shard,
    "dali": dali_index.write_shard}
LAYOUT = 1
"""Of all formats; another number gives up what an earlier version began."""


@dataclass(frozen=True, kw_only=True)
class DatasetExport:
    """What to export, and whereto."""

    dataset: Path
    """Folder of a finished dataset."""
    out: Path
    """Folder that is made."""
    kind: ExportFormat
    splits: Sequence[str] = ()
    """Names; all without."""
    layers: Sequence[str] = ()
    """Names; all without."""


@dataclass(frozen=True, kw_only=True)
class ExportDone:
    """What was written. kept: shards whose files were there already."""

    examples: int
    files: int
    bytes: int
    shards: int
    kept: int


def export_dataset(job: DatasetExport) -> ExportDone:
    """Write the dataset, or go on where the same export was stopped; `export.json` comes last.

    Raises UserError for splits and layers that there are not; ShardError where the dataset is damaged, with nothing
    written of the shard in question; OutputError where the folder holds something else or cannot be written.
    """
    manifest = open_dataset(job.dataset).manifest
    splits = _chosen(job, "split", job.splits, [split.name for split in manifest.splits])
    layers = _chosen(job, "layer", job.layers, [layer.name for layer in manifest.layers])
    if job.kind == "dali" and job.layers:
        raise UserError("expected no layers for an index, which lists every file; name them as `ext` to DALI's reader")
    if job.kind == "parquet":
        parquet_rows.require_pyarrow()
    name = digest([LAYOUT, job.kind, splits, layers, sha256_file(job.dataset / MANIFEST)])
    shards = [*_shards(job.dataset, manifest, splits, layers)]
    with export_folder(job.out, name) as folder:
        kept = len(folder.done)
        missing = [shard for shard in shards if shard.index.shard.stem not in folder.done]
        require_space(job.out, sum(one.size for shard in missing for example in shard.index.examples
                                   for one in shard.members(example).values()) if job.kind != "dali" else 0)
        for shard in missing:
            written = tuple(WRITERS[job.kind](shard, job.out))
            folder.keep(ExportUnit(shard=shard.index.shard.stem, split=shard.split, files=written))
        if not folder.finished:
            folder.finish(_record(job, folder, manifest, shards))
    files = [file for unit in folder.done.values() for file in unit.files]
    return ExportDone(examples=sum(file.examples for file in files), files=len(files), shards=len(shards), kept=kept,
                      bytes=sum(file.bytes for file in files))


def _chosen(job: DatasetExport, what: str, wanted: Sequence[str], there: Sequence[str]) -> list[str]:
    """Those that are wanted, in the dataset's order; all where none is named."""
    if unknown := [name for name in wanted if name not in there]:
        raise UserError([Problem(where=str(job.dataset), path="", hint=nearest(unknown[0], there, what),
                                 rule=f"expected {what}s among {', '.join(there)}, got {unknown[0]!r:.60}")])
    return [name for name in there if name in wanted or not wanted]


def _shards(folder: Path, manifest: Manifest, splits: list[str], layers: list[str]) -> Iterator[SourceShard]:
    for split in splits:
        own = [shard for shard in manifest.shards if shard.split == split]
        for number, shard in enumerate(own):
            path = index_path(folder, shard.stem)
            index = from_json(ShardIndex, read_small(path), where=str(path))
            yield SourceShard(folder=folder, index=index, layers=tuple(layers), number=number, count=len(own))


def _record(job: DatasetExport, folder: ExportFolder, manifest: Manifest, shards: list[SourceShard]) -> ExportRecord:
    """All that was written; a shard that holds other examples than its index says is a bug of ours."""
    units = tuple(folder.done[shard.index.shard.stem] for shard in shards)
    counts = [sum(file.examples for file in unit.files) for unit in units]
    if counts != (wanted := [len(shard.index.examples) for shard in shards]):
        raise AssertionError(f"wrote {counts} examples of {wanted}")
    layers = tuple(layer for layer in manifest.layers if layer.name in shards[0].layers)
    return ExportRecord(kind=job.kind, job=folder.job, examples=sum(counts), units=units, layers=layers,
                        heads=tuple(_heads(job, manifest, units, shards[0].layers)),
                        source=manifest.model_copy(update={"shards": (), "rejected": ()}))


def _heads(job: DatasetExport, manifest: Manifest, units: Sequence[ExportUnit],
           layers: Sequence[str]) -> Iterator[ExportFile]:
    """Write what a format says of all its files."""
    splits = dict[str, list[ExportFile]]()
    for unit in units:
        splits.setdefault(unit.split, []).extend(unit.files)
    if job.kind == "parquet":
        yield parquet_rows.write_card(job.out, manifest, list(splits))
    if job.kind == "mds":
        for split, files in splits.items():
            yield mds_shards.write_index(job.out, split, files, layers)
