"""Whether a dataset agrees, file by file, with its manifest. Every problem is listed, not only the first."""

import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.folder import MANIFEST, SECONDS, WORK
from dataset_builder.shards.manifest import Manifest, ShardIndex, ShardRecord, from_json
from dataset_builder.shards.publish import CROISSANT, SUMS, listed_files
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.structure import tar_problems
from dataset_builder.shards.verify_examples import ExampleChecks
from dataset_builder.shards.writer import index_path, shard_path

IGNORED = (WORK, "previews", SECONDS)
"""Folders that hold nothing a reader relies on."""
_SUM = re.compile(r"([0-9a-f]{64})  (\S.*)")


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
    hashes = _Hashes(folder)
    problems = [*_manifest(manifest), *_files(folder, manifest), *_sums(folder, manifest, hashes),
                *_croissant(folder, manifest)]
    checks = ExampleChecks(manifest)
    for shard in manifest.shards:
        problems += _shard(folder, shard, hashes, checks)
    return [*problems, *checks.summary()]


class _Hashes:
    """SHA-256 of files below a folder, each read once; None for files that are not there."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._known: dict[str, str | None] = {}

    def __getitem__(self, name: str) -> str | None:
        if name not in self._known:
            path = self._folder / name
            self._known[name] = sha256_file(path) if path.is_file() else None
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
    if unknown := {shard.split for shard in shards} - {split.name for split in manifest.splits}:
        yield _problem(MANIFEST, "shards", f"expected known splits, got {', '.join(sorted(unknown))}")


def _files(folder: Path, manifest: Manifest) -> Iterator[Problem]:
    expected = {*listed_files(manifest), SUMS}
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    for name in sorted(expected - found):
        yield _problem(name, "", "expected a file, found none")
    for name in sorted(found - expected):
        if name.split("/")[0] not in IGNORED:
            yield _problem(name, "", f"expected only files that {MANIFEST} accounts for")


def _sums(folder: Path, manifest: Manifest, hashes: _Hashes) -> Iterator[Problem]:
    path = folder / SUMS
    lines = path.read_text(errors="replace").splitlines() if path.is_file() else []
    listed = []
    for number, line in enumerate(lines, start=1):
        if (match := _SUM.fullmatch(line)) is None:
            yield _problem(f"{SUMS}:{number}", "", "expected a SHA-256, two spaces and a file name")
            continue
        listed.append(match[2])
        if hashes[match[2]] not in (None, match[1]):
            yield _problem(match[2], "", f"expected SHA-256 {match[1]} ({SUMS}), got {hashes[match[2]]}")
    if lines and sorted(listed) != listed_files(manifest):
        yield _problem(SUMS, "", "expected every file of the dataset once, and no other")


def _croissant(folder: Path, manifest: Manifest) -> Iterator[Problem]:
    path = folder / CROISSANT
    if not path.is_file():
        return
    try:
        items = json.loads(path.read_bytes())["distribution"]
        listed = {item["@id"]: item["sha256"] for item in items if item["@type"] == "cr:FileObject"}
    except (ValueError, KeyError, TypeError) as error:
        yield _problem(CROISSANT, "", f"expected Croissant's JSON ({error!r})")
        return
    if listed != {shard.name: shard.sha256 for shard in manifest.shards}:
        yield _problem(CROISSANT, "distribution", f"expected the shards and SHA-256 of {MANIFEST}")


def _shard(folder: Path, shard: ShardRecord, hashes: _Hashes, checks: ExampleChecks) -> Iterator[Problem]:
    tar, index_file = shard_path(folder, shard.stem), index_path(folder, shard.stem)
    if tar.is_file():
        if (size := tar.stat().st_size) != shard.bytes:
            yield _problem(shard.name, "", f"expected {shard.bytes} bytes, got {size}")
        if (sha256 := hashes[tar.relative_to(folder).as_posix()]) != shard.sha256:
            yield _problem(shard.name, "", f"expected SHA-256 {shard.sha256}, got {sha256}")
    if not index_file.is_file():
        return
    try:
        index = from_json(ShardIndex, index_file.read_bytes(), where=index_file.name)
    except ShardError as error:
        yield from error.problems
        return
    yield from _index(index_file.name, index, shard)
    if tar.is_file():
        yield from tar_problems(tar, index)
        yield from checks.shard(tar, index)


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
