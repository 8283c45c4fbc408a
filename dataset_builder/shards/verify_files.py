"""Whether the files of a dataset are those that its manifest accounts for: names, sizes, sums, catalogue."""

import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from dataset_builder.digest import open_regular, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.croissant import split_rows
from dataset_builder.shards.folder import CROISSANT, MANIFEST, PREVIEWS, SECONDS, SUMS, WORK
from dataset_builder.shards.identities import identity_table
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.one_writer import left_over, placed
from dataset_builder.shards.publish import listed_files, sums_in
from dataset_builder.shards.structure import MOST_BYTES, read_small

IGNORED = (WORK, PREVIEWS, SECONDS)
"""What holds nothing a reader relies on."""


def hash_of(path: Path, *, most: int | None = MOST_BYTES) -> str | None:
    """SHA-256 of a file; None where it is not there, cannot be read, or has more than `most` bytes."""
    try:
        return sha256_file(path, most=most)
    except OSError:
        return None


def manifest_problems(manifest: Manifest) -> Iterator[Problem]:
    """Where a manifest contradicts itself."""
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


def extra_files(folder: Path, listed: Iterable[str]) -> list[str]:
    """Files of a dataset that are neither `listed` nor the builder's own, relative, sorted."""
    paths = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    found = {path.relative_to(folder).as_posix() for path in paths}
    others = found - {*listed, SUMS} - left_over(folder)
    return sorted(name for name in others if name.split("/")[0] not in IGNORED)


def file_problems(folder: Path, manifest: Manifest, looked_at: Collection[str]) -> Iterator[Problem]:
    """Files that are missing, of those looked at, and files that are too many."""
    for name in sorted(looked_at):
        try:
            open_regular(placed(folder, name), most=None if name.endswith(".tar") else MOST_BYTES).close()
        except FileNotFoundError:
            yield _problem(name, "", "expected a file, found none")
        except OSError as error:
            yield _problem(name, "", f"expected a file that can be read, got: {error.strerror or error}")
    for name in extra_files(folder, listed_files(manifest)):
        yield _problem(name, "", f"expected only files that {MANIFEST} accounts for")


def sum_problems(folder: Path, manifest: Manifest, hashes: Mapping[str, str | None]) -> Iterator[Problem]:
    """Where SHA256SUMS lists other files than the manifest, or those with `hashes` differ from what it says."""
    try:
        lines = sums_in(read_small(placed(folder, SUMS)))
    except ShardError:
        return
    files = set(listed_files(manifest))
    for number, line in enumerate(lines, start=1):
        if line is None:
            yield _problem(f"{SUMS}:{number}", "", "expected a SHA-256, two spaces and a file name")
        elif line[0] in files and hashes.get(line[0]) not in (None, line[1]):
            yield _problem(line[0], "", f"expected SHA-256 {line[1]} ({SUMS}), got {hashes[line[0]]}")
    if sorted(line[0] for line in lines if line) != sorted(files):
        yield _problem(SUMS, "", "expected every file of the dataset once, and no other")


def croissant_problems(folder: Path, manifest: Manifest) -> Iterator[Problem]:
    """Where the catalogue says other than the manifest."""
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


def _problem(where: str, path: str, rule: str) -> Problem:
    return Problem(where=where, path=path, rule=rule)
