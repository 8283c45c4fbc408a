"""Whether a tar file agrees, byte for byte outside its payloads, with its index.

No reader of the field notices a tar that was cut at a header or whose header lost a bit: it ends there without an
error. So every header, every padding and the end blocks are compared with the bytes that belong there.
"""

import os
from collections.abc import Iterable, Iterator
from itertools import accumulate
from pathlib import Path
from typing import BinaryIO, Protocol

from dataset_builder.digest import open_regular, read_regular, sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.folder import MOST_BYTES
from dataset_builder.shards.segment import BLOCK, end_blocks, header, padding
from dataset_builder.shards.shard_index import MemberRecord, ShardIndex


def tar_problems(path: Path, index: ShardIndex) -> list[Problem]:
    """Every difference between the tar at `path` and `index`: headers, payload hashes, paddings, end blocks, size.

    Raises OSError where it cannot be read.
    """
    with open_regular(path) as stream:
        members, ends = members_of(index), starts(index)
        problems = [_problem(path, member.name, rule) for member, start in zip(members, ends, strict=False)
                    for rule in _member_rules(stream, member, start)]
        stream.seek(min(end := ends[-1], path.stat().st_size))
        if stream.read(len(end_blocks(end)) + 1) != end_blocks(end):
            problems.append(_problem(path, "end", f"expected nothing but end blocks from byte {end}"))
    return problems


def misplaced(index: ShardIndex) -> set[str]:
    """Names of members whose payloads do not follow their headers: those may overlap, or lie beyond the file."""
    return {member.name for member, start in zip(members_of(index), starts(index), strict=False)
            if member.offset != start + BLOCK}


def members_of(index: ShardIndex) -> list[MemberRecord]:
    """Every member of a shard, in file order, each once."""
    return [member for example in index.examples for member in example.own]


def starts(index: ShardIndex) -> list[int]:
    """Where the header of every member of a shard begins, which is where those before it end; last, where all end."""
    ends = (member.offset + member.size + len(padding(member.size)) for member in members_of(index))
    return list(accumulate(ends, max, initial=0))


def read_small(path: Path) -> bytes:
    """The bytes of a manifest, an index, or another file of text of a dataset.

    Raises ShardError where it is not a regular file, cannot be read, or has more than `MOST_BYTES`.
    """
    try:
        return read_regular(path, most=MOST_BYTES)
    except OSError as error:
        raise ShardError([_problem(path, "", f"cannot be read ({error.strerror or error})")]) from error


class Span(Protocol):
    """Where one member's payload lies in its shard; `MemberRecord` is one."""

    @property
    def name(self) -> str: ...
    @property
    def offset(self) -> int: ...
    @property
    def size(self) -> int: ...


def read_member(path: Path, member: Span) -> bytes:
    """The payload of one member; see `read_members`."""
    return read_members(path, [member])[0]


def read_members(path: Path, members: Iterable[Span]) -> list[bytes]:
    """The payloads of some members, unchecked but for their lengths; the file is opened once.

    Raises ShardError where it cannot be read, or ends before one of them.
    """
    try:
        with open_regular(path) as stream:
            return [_payload(stream.fileno(), path, member) for member in members]
    except OSError as error:
        raise ShardError([_problem(path, "", f"cannot be read ({error.strerror or error})")]) from error


def _payload(descriptor: int, path: Path, member: Span) -> bytes:
    # An index may ask for more than there is memory
    there = max(os.fstat(descriptor).st_size - member.offset, 0)
    data = os.pread(descriptor, min(member.size, there), member.offset)
    if len(data) != member.size:
        rule = f"expected {member.size} bytes, the file ends after {len(data)}"
        raise ShardError([_problem(path, member.name, rule)])
    return data


def _member_rules(stream: BinaryIO, member: MemberRecord, start: int) -> Iterator[str]:
    if member.offset != start + BLOCK:
        yield f"expected its payload at byte {start + BLOCK}, the index says {member.offset}"
        return
    try:
        expected = header(member.name, member.size)
    except ShardError as error:
        yield str(error)
        return
    stream.seek(start)
    if stream.read(BLOCK) != expected:
        yield f"expected another tar header at byte {start}"
    payload, fill = stream.read(member.size), stream.read(len(padding(member.size)))
    if len(payload) < member.size:
        yield f"expected {member.size} bytes, the file ends after {len(payload)}"
    elif sha256_bytes(payload) != member.sha256:
        yield f"expected SHA-256 {member.sha256}, its bytes differ"
    if len(payload) == member.size and fill != padding(member.size):
        yield "expected zeros after it"


def _problem(path: Path, member: str, rule: str) -> Problem:
    return Problem(where=path.name, path=member, rule=rule)
