"""Staged examples to shards of the next set: assemble, flush, hash, read back, rename, then the index the same way."""

import importlib.metadata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from dataset_builder import __version__
from dataset_builder.digest import sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import commit, output_errors, partial_of, write_atomic, write_partial
from dataset_builder.shards import exr
from dataset_builder.shards.example import Member
from dataset_builder.shards.folder import INDEX, SHARDS, next_of
from dataset_builder.shards.manifest import to_json
from dataset_builder.shards.one_writer import still_writer
from dataset_builder.shards.segment import BLOCK, end_blocks, segment_size
from dataset_builder.shards.shard_index import (
    ExampleFacts,
    ExampleRecord,
    MemberRecord,
    ShardIndex,
    ShardRecord,
    tagged,
)
from dataset_builder.shards.staging import Staged, Staging
from dataset_builder.shards.structure import tar_problems


class Source(Protocol):
    """What has staged examples, as `Staging` has."""

    def get(self, key: str, digest: str, /) -> Staged:
        """One of them. Raises ShardError where there is none, or it is damaged."""


def writer_versions() -> dict[str, str]:
    """Versions of whatever turns layers into bytes; the renderer's are for the caller to add."""
    return {"dataset_builder": __version__, "openexr": exr.VERSION, "numpy": np.__version__,
            "pillow": importlib.metadata.version("pillow")}


def shard_path(folder: Path, stem: str) -> Path:
    """Where a shard lies."""
    return folder / SHARDS / f"{stem}.tar"


def index_path(folder: Path, stem: str) -> Path:
    """Where a shard's index lies."""
    return folder / INDEX / f"{stem}.manifest"


def entry(*, key: str, view: str, facts: ExampleFacts, members: Sequence[Member]) -> dict[str, Any]:
    """What `Staging.put` keeps beside a segment: key, view, what the example is chosen by, and the members in file
    order."""
    return {"key": key, "view": view, "facts": facts.model_dump(mode="json"),
            "members": [member.record() for member in members]}


def publish_shard(folder: Path, *, slot: str, split: str, examples: Sequence[tuple[str, str]], spec_digest: str,
                  versions: Mapping[str, str], share: bool = False, source: Source | None = None) -> ShardIndex:
    """Make the shard in `slot` of staged `examples` ((key, digest) pairs, written in key order) and its index.

    share: whether a member is left out whose pixels an earlier example of its view has; the index points there. source:
    where the examples are staged, the folder itself unless given.
    Both wait below `.build/next` for `publish.publish_dataset`; whatever waited for the same slot is dropped. Raises
    OutputError where the disk refuses, and ShardError where an example is not staged, two share a key, or the file does
    not read back as written.
    """
    chosen = sorted(examples)
    if not chosen or len({key for key, _ in chosen}) < len(chosen):
        rule = f"expected one or more examples with different keys, got {[key for key, _ in chosen]}"
        raise _wrong(shard_path(next_of(folder), slot), rule)
    records: list[ExampleRecord] = []
    return write_shard(folder, slot=slot, split=split, records=records, spec_digest=spec_digest,
                       chunks=_chunks(source or Staging(folder), chosen, records, share),
                       versions={**writer_versions(), **versions})


def write_shard(folder: Path, *, slot: str, split: str, chunks: Iterable[bytes], records: Sequence[ExampleRecord],
                spec_digest: str, versions: Mapping[str, str]) -> ShardIndex:
    """Make the shard in `slot` of its bytes, and its index; `records`, one at least, fill while `chunks` come.

    Raises as `publish_shard` does.
    """
    folder_next = next_of(folder)
    path = shard_path(folder_next, slot)
    size, sha256 = write_partial(path, chunks)
    index = tagged(ShardIndex(
        shard=ShardRecord(name=path.name, split=split, bytes=size, sha256=sha256, examples=len(records),
                          first_key=records[0].key, last_key=records[-1].key),
        spec_digest=spec_digest, versions=dict(versions), examples=tuple(records),
    ), slot)
    _check(partial_of(path), index)
    still_writer(folder)
    with output_errors(path):
        # An index never stands without its shard
        for other in [*(folder_next / INDEX).glob(f"{slot}-*"), *(folder_next / SHARDS).glob(f"{slot}-*")]:
            other.unlink()
    commit(path, shard_path(folder_next, index.shard.stem))
    write_atomic(index_path(folder_next, index.shard.stem), to_json(index))
    return index


def _chunks(staging: Source, examples: Sequence[tuple[str, str]], records: list[ExampleRecord],
            share: bool) -> Iterator[bytes]:
    """Yield the shard's bytes, one example in memory at a time, and append each example's record to `records`."""
    end, known = 0, dict[tuple[str, str, str], MemberRecord]()
    for key, digest in examples:
        staged = staging.get(key, digest)
        members = staged.entry["members"]
        sizes = [member["size"] for member in members]
        if len(staged.segment) != segment_size(sizes) or staged.entry["key"] != key:
            raise _wrong(key, f"expected a segment of {segment_size(sizes)} bytes, got {len(staged.segment)}")
        start, listed = 0, list[MemberRecord]()
        for member in members:
            own, size = MemberRecord(offset=end + BLOCK, **member), segment_size([member["size"]])
            record = known.setdefault((staged.entry["view"], own.suffix, own.pixel_digest), own) \
                if share and own.pixel_digest else own
            if record is own:
                yield staged.segment[start:start + size]
                end += size
            start += size
            listed.append(record)
        records.append(ExampleRecord(key=key, view=staged.entry["view"], facts=staged.entry["facts"], digest=digest,
                                     members=tuple(listed)))
    yield end_blocks(end)


def _check(partial: Path, index: ShardIndex) -> None:
    problems = tar_problems(partial, index)
    if partial.stat().st_size != index.shard.bytes or sha256_file(partial) != index.shard.sha256:
        problems.append(Problem(where=partial.name, path="", rule="expected to read back the bytes that were written"))
    if problems:
        raise ShardError(problems)


def _wrong(where: Path | str, rule: str) -> ShardError:
    return ShardError([Problem(where=str(where), path="", rule=rule)])
