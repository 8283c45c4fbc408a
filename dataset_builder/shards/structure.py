"""Whether a tar file agrees, byte for byte outside its payloads, with its index.

No reader of the field notices a tar that was cut at a header or whose header lost a bit: it ends there without an
error. So every header, every padding and the end blocks are compared with the bytes that belong there.
"""

import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, Protocol

from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.manifest import MemberRecord, ShardIndex
from dataset_builder.shards.segment import BLOCK, end_blocks, header, padding


def tar_problems(path: Path, index: ShardIndex) -> list[Problem]:
    """Every difference between the tar at `path` and `index`: headers, payload hashes, paddings, end blocks, size."""
    with path.open("rb") as stream:
        problems, end = [], 0
        for example in index.examples:
            for member in example.members:
                problems += [_problem(path, member.name, rule) for rule in _member_rules(stream, member, end)]
                end = max(end, member.offset + member.size + len(padding(member.size)))
        stream.seek(end)
        if stream.read() != end_blocks(end):
            problems.append(_problem(path, "end", f"expected nothing but end blocks from byte {end}"))
    return problems


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
        descriptor = os.open(path, os.O_RDONLY)
        try:
            return [_payload(descriptor, path, member) for member in members]
        finally:
            os.close(descriptor)
    except OSError as error:
        raise ShardError([_problem(path, "", f"cannot be read ({error.strerror or error})")]) from error


def _payload(descriptor: int, path: Path, member: Span) -> bytes:
    data = os.pread(descriptor, member.size, member.offset)
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
    elif hashlib.sha256(payload).hexdigest() != member.sha256:
        yield f"expected SHA-256 {member.sha256}, its bytes differ"
    if len(payload) == member.size and fill != padding(member.size):
        yield "expected zeros after it"


def _problem(path: Path, member: str, rule: str) -> Problem:
    return Problem(where=path.name, path=member, rule=rule)
