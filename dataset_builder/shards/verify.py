"""Whether a dataset agrees, file by file, with its manifest. Every problem is listed, not only the first."""

import json
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from dataset_builder.digest import open_regular, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.croissant import split_rows
from dataset_builder.shards.folder import CROISSANT, MANIFEST, PREVIEWS, SECONDS, SUMS, WORK, left_over, placed
from dataset_builder.shards.identities import identity_table
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.publish import listed_files, sums_in
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import MOST_BYTES, read_small, tar_problems
from dataset_builder.shards.verify_examples import ExampleChecks
from dataset_builder.shards.writer import index_path, shard_path

IGNORED = (WORK, PREVIEWS, SECONDS)
"""Folders that hold nothing a reader relies on."""


def verify(folder: Path) -> list[Problem]:
    """Everything wrong with the dataset in `folder`; empty where nothing is.

    Checked: the manifest's schema and sums; missing, extra and duplicate files and keys; SHA256SUMS; size, SHA-256 and
    tar structure of every shard against its index; and of every example: names, decoding, ranges, pixel digests, label,
    and the identities of `identities.py`.
    """
    try:
        manifest = load_manifest(folder)
    except ShardError as error:
        return list(error.problems)
    hashes = _Hashes(folder, manifest)
    problems = [*_manifest(manifest), *_files(folder, manifest), *_sums(folder, manifest, hashes),
                *_croissant(folder, manifest)]
    checks = ExampleChecks(manifest)
    for shard, times in _different(manifest.shards):
        problems += _shard(folder, shard, times, hashes, checks)
    return [*problems, *checks.summary()]


class _Hashes:
    """SHA-256 of a dataset's files, each read once; None for those that are not there or larger than may be."""

    def __init__(self, folder: Path, manifest: Manifest):
        self._folder = folder
        self._most = {shard_path(Path(), shard.stem).as_posix(): shard.bytes for shard in manifest.shards}
        self._known: dict[str, str | None] = {}

    def __getitem__(self, name: str) -> str | None:
        if name not in self._known:
            path = placed(self._folder, name)
            try:
                self._known[name] = sha256_file(path, most=self._most.get(name, MOST_BYTES))
            except OSError:
                self._known[name] = None
        return self._known[name]


def _manifest(manifest: Manifest) -> Iterator[Problem]:
    shards, totals = manifest.shards, manifest.totals
    for split in manifest.splits:
        own = [shard for shard in shards if shard.split == split.name]
        listed = tuple(shard.name for shard in own), sum(shard.examples for shard in own)
        if listed != (split.shards, split.examples):
            yield _problem(MANIFEST, f"splits.{split.name}", "expected the shards and examples of the shard list")
    examples, size = sum(shard.examples for shard in shards), sum(shard.bytes for shard in shards)
    sums = (examples, len(shards), size, len(manifest.rejected))
    if sums != (totals.examples, totals.shards, totals.bytes, totals.rejected):
        yield _problem(MANIFEST, "totals", f"expected (examples, shards, bytes, rejected) {sums}, got {totals}")
    for what, values in (("name", [shard.name for shard in shards]), ("content", [shard.sha256 for shard in shards])):
        for value, count in Counter(values).items():
            if count > 1:
                yield _problem(MANIFEST, "shards", f"expected different shards, got {count} of {what} {value}")
    table = identity_table(manifest.layers[0].dtype, manifest.through_fields)
    if tuple((identity.name, identity.rule, identity.tolerance) for identity in manifest.identities) != table:
        yield _problem(MANIFEST, "identities", f"expected those of layers stored as {manifest.layers[0].dtype}")
    if unknown := {shard.split for shard in shards} - {split.name for split in manifest.splits}:
        yield _problem(MANIFEST, "shards", f"expected known splits, got {', '.join(sorted(unknown))}")


def _files(folder: Path, manifest: Manifest) -> Iterator[Problem]:
    expected = {*listed_files(manifest), SUMS}
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    for name in sorted(expected):
        try:
            open_regular(placed(folder, name), most=None if name.endswith(".tar") else MOST_BYTES).close()
        except FileNotFoundError:
            yield _problem(name, "", "expected a file, found none")
        except OSError as error:
            yield _problem(name, "", f"expected a file that can be read, got: {error.strerror or error}")
    for name in sorted(found - expected - left_over(folder)):
        if name.split("/")[0] not in IGNORED:
            yield _problem(name, "", f"expected only files that {MANIFEST} accounts for")


def _sums(folder: Path, manifest: Manifest, hashes: _Hashes) -> Iterator[Problem]:
    try:
        lines = sums_in(read_small(placed(folder, SUMS)))
    except ShardError:
        return
    files = listed_files(manifest)
    for number, line in enumerate(lines, start=1):
        if line is None:
            yield _problem(f"{SUMS}:{number}", "", "expected a SHA-256, two spaces and a file name")
        elif line[0] in files and hashes[line[0]] not in (None, line[1]):
            yield _problem(line[0], "", f"expected SHA-256 {line[1]} ({SUMS}), got {hashes[line[0]]}")
    if sorted(line[0] for line in lines if line) != files:
        yield _problem(SUMS, "", "expected every file of the dataset once, and no other")


def _croissant(folder: Path, manifest: Manifest) -> Iterator[Problem]:
    try:
        data = read_small(placed(folder, CROISSANT))
    except ShardError:
        return
    try:
        document = json.loads(data)
        listed = {item["@id"]: item["sha256"] for item in document["distribution"] if item["@type"] == "cr:FileObject"}
        splits = [records["data"] for records in document["recordSet"] if records.get("dataType") == "cr:Split"]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        yield _problem(CROISSANT, "", f"expected Croissant's JSON ({error!r})")
        return
    if listed != {shard.name: shard.sha256 for shard in manifest.shards}:
        yield _problem(CROISSANT, "distribution", f"expected the shards and SHA-256 of {MANIFEST}")
    if splits != [split_rows(manifest)]:
        yield _problem(CROISSANT, "recordSet", f"expected the splits of {MANIFEST}, and how many examples each has")


def _different(shards: Sequence[ShardRecord]) -> Iterator[tuple[ShardRecord, int]]:
    """The first shard of every name, and how often that name is listed: no file is looked into twice."""
    times = Counter(shard.name for shard in shards)
    first = {shard.name: shard for shard in reversed(shards)}
    return ((first[name], count) for name, count in times.items())


def _shard(folder: Path, shard: ShardRecord, times: int, hashes: _Hashes, checks: ExampleChecks) -> Iterator[Problem]:
    tar, index_file = shard_path(folder, shard.stem), index_path(folder, shard.stem)
    if tar.is_file():
        if (size := tar.stat().st_size) != shard.bytes:
            yield _problem(shard.name, "", f"expected {shard.bytes} bytes, got {size}")
        if (sha256 := hashes[tar.relative_to(folder).as_posix()]) not in (None, shard.sha256):
            yield _problem(shard.name, "", f"expected SHA-256 {shard.sha256}, got {sha256}")
    if not index_file.is_file():
        return
    try:
        index = from_json(ShardIndex, read_small(index_file), where=index_file.name)
    except ShardError as error:
        yield from error.problems
        return
    yield from _index(index_file.name, index, shard)
    if tar.is_file() and os.access(tar, os.R_OK):
        yield from tar_problems(tar, index)
        yield from checks.shard(tar, index, times)


def _index(name: str, index: ShardIndex, shard: ShardRecord) -> Iterator[Problem]:
    keys = [example.key for example in index.examples]
    if index.shard != shard:
        yield _problem(name, "shard", f"expected what {MANIFEST} says of {shard.name}")
    if len(keys) != shard.examples:
        yield _problem(name, "examples", f"expected {shard.examples}, got {len(keys)}")
    if keys != sorted(set(keys)):
        yield _problem(name, "examples", "expected keys in order, each once")
    ends = f"{shard.first_key} to {shard.last_key}"
    if keys and ends != (got := f"{keys[0]} to {keys[-1]}"):
        yield _problem(name, "examples", f"expected keys {ends}, got {got}")


def _problem(where: str, path: str, rule: str) -> Problem:
    return Problem(where=where, path=path, rule=rule)
