"""Mending a damaged dataset from a whole copy: broken files are fetched, of a shard whose index is whole only broken
members. The result has the bytes that were published, or nothing is changed."""

import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import ShardError
from dataset_builder.files import commit, output_errors, partial_of, write_atomic, write_partial
from dataset_builder.remote.place import ByteRange, Place
from dataset_builder.shards.folder import MANIFEST, MENDING, SUMS, WORK
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.one_writer import one_writer, still_writer
from dataset_builder.shards.publish import listed_files, sums_in
from dataset_builder.shards.segment import end_blocks, header, padding
from dataset_builder.shards.shard_index import MemberRecord, ShardIndex, ShardRecord
from dataset_builder.shards.structure import MOST_BYTES, members_of, read_member, starts
from dataset_builder.shards.verify_files import hash_of
from dataset_builder.transfer.anchor import Repaired, anchor_of, refused
from dataset_builder.transfer.aside import set_aside

MEMBERS = 64
"""Members of a shard that are fetched at once."""


def repair_from(folder: Path, place: Place) -> Repaired:
    """Fetch whatever is broken in `folder` from a whole copy of the same dataset.

    Raises ShardError where the folder does not tell what it held, where `place` has another dataset, or where it is
    damaged in the same places; OutputError where the disk refuses or a build is at work. The folder is then as it was.
    """
    with one_writer(folder, "repair"):
        anchor = anchor_of(folder)
        sums_data, data = _fetch(place, SUMS), b""
        sums = dict(filter(None, sums_in(sums_data)))
        if sums.get(MANIFEST) != anchor.sha256:
            raise refused(place.title, f"expected the dataset with SHA-256 {anchor.sha256} of {MANIFEST}, got another "
                                        f"one, with {sums.get(MANIFEST, 'none')}", "name the place it came from")
        manifest = anchor.manifest
        if manifest is None:
            data = _checked(place, MANIFEST, anchor.sha256)
            manifest = from_json(Manifest, data, where=MANIFEST)
        if sorted(sums) != listed_files(manifest):
            raise refused(place.title, f"expected {SUMS} to list the files of {MANIFEST}", "name another place")
        shutil.rmtree(folder / WORK / MENDING, ignore_errors=True)
        try:
            done = _fetched(folder, place, manifest, {**sums, SUMS: sha256_bytes(sums_data)})
            _take_place(folder, done.mended)
        finally:
            shutil.rmtree(folder / WORK / MENDING, ignore_errors=True)
        return replace(done, aside=set_aside(folder, sums))


def _fetched(folder: Path, place: Place, manifest: Manifest, sums: dict[str, str]) -> Repaired:
    """Put whole copies of all broken files below `.build/repair`."""
    mended, members, size = list[str](), list[str](), 0
    shards = {shard.tar_file: shard for shard in manifest.shards}
    # Indexes come before their shards
    for name in sorted(sums):
        most = shards[name].bytes if name in shards else MOST_BYTES
        if hash_of(folder / name, most=most) == sums[name]:
            continue
        target = folder / WORK / MENDING / name
        if name in shards:
            alone, got = _mend_shard(folder, place, shards[name], target)
            members += alone
        else:
            data = _checked(place, name, sums[name])
            write_atomic(target, data)
            got = len(data)
        mended.append(name)
        size += got
    return Repaired(mended=tuple(mended), members=tuple(members), fetched=size)


def _mend_shard(folder: Path, place: Place, shard: ShardRecord, target: Path) -> tuple[list[str], int]:
    """Write the whole shard; which members were fetched alone, none where all of it was, and how many bytes."""
    at = next(path for root in (folder / WORK / MENDING, folder) if (path := root / shard.index_file).is_file())
    index = from_json(ShardIndex, at.read_bytes(), where=at.name)
    name, tar = shard.tar_file, folder / shard.tar_file
    broken = {member.name for member in members_of(index) if _own(tar, member) is None}
    if len(broken) == len(members_of(index)):
        broken.clear()
        chunks = place.stream(name)
    else:
        chunks = _joined(place, tar, name, index, broken)
    size, sha256 = write_partial(target, _readable(place, name, chunks))
    if sha256 != shard.sha256:
        partial_of(target).unlink()
        raise refused(place.title, f"expected SHA-256 {shard.sha256} of {name}, got {sha256}", "name another place")
    commit(target)
    sizes = {member.name: member.size for member in members_of(index)}
    return sorted(broken), sum(sizes[one] for one in broken) if broken else size


def _joined(place: Place, tar: Path, name: str, index: ShardIndex, broken: set[str]) -> Iterator[bytes]:
    """The bytes of a shard: whole members from here, broken ones from there, all else as it must be."""
    members = members_of(index)
    for first in range(0, len(members), MEMBERS):
        part = members[first:first + MEMBERS]
        wanted = [ByteRange(name, member.offset, member.size) for member in part if member.name in broken]
        there = iter(place.ranges(wanted) if wanted else [])
        for member in part:
            yield header(member.name, member.size)
            yield next(there) if member.name in broken else _own(tar, member) or b""
            yield padding(member.size)
    yield end_blocks(starts(index)[-1])


def _readable(place: Place, name: str, chunks: Iterator[bytes]) -> Iterator[bytes]:
    """The same chunks. Raises ShardError where the place does not give them: it is not the disk here that refuses."""
    try:
        yield from chunks
    except (OSError, EOFError) as error:
        raise _unread(place, name, error) from error


def _unread(place: Place, name: str, error: OSError | EOFError) -> ShardError:
    reason = getattr(error, "strerror", None) or error
    return refused(place.title, f"cannot read {name} ({reason})", "name another place")


def _own(tar: Path, member: MemberRecord) -> bytes | None:
    """The payload of a member as it lies here; None where it is damaged."""
    try:
        data = read_member(tar, member)
    except ShardError:
        return None
    return data if sha256_bytes(data) == member.sha256 else None


def _take_place(folder: Path, names: Sequence[str]) -> None:
    """Move mended files to their places, `dataset.json` last."""
    source = folder / WORK / MENDING
    still_writer(folder)
    with output_errors(folder):
        for name in sorted(names, key=lambda name: (name == MANIFEST, name)):
            (folder / name).parent.mkdir(exist_ok=True)
            if (folder / name).is_dir() and not (folder / name).is_symlink():
                raise refused(folder / name, "expected a file, got a folder", "move it away")
            os.replace(source / name, folder / name)


def _checked(place: Place, name: str, sha256: str) -> bytes:
    data = _fetch(place, name)
    if (got := sha256_bytes(data)) != sha256:
        raise refused(place.title, f"expected SHA-256 {sha256} of {name}, got {got}", "name another place")
    return data


def _fetch(place: Place, name: str) -> bytes:
    try:
        return place.read(name, most=MOST_BYTES)
    except (OSError, EOFError) as error:
        raise _unread(place, name, error) from error
