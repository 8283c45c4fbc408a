"""Examples as pieces of a tar: headers and payloads of one example, without the blocks that end an archive.

A shard is the segments of its examples in key order, then the end blocks, so that its bytes depend on its examples
alone. USTAR, never PAX (which broke readers of the field); every header field that could vary is fixed.
"""

import re
import tarfile
from collections.abc import Iterable

from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.example import Member

BLOCK = tarfile.BLOCKSIZE
RECORD = tarfile.RECORDSIZE
MODE = 0o444
MAX_MEMBER = 8**11 - 1
LONGEST_NAME = tarfile.LENGTH_NAME
NAME = re.compile(r"[0-9]{8}(\.[a-z0-9_]+)+")
"""Key, then suffixes: no folders, nothing upper-case, and the key is all up to the first dot (webdataset's rule)."""


def header(name: str, size: int) -> bytes:
    """The 512 bytes before a member of `size` bytes: USTAR, time 0, owner 0, mode 0444.

    Raises ShardError where the name is longer than 100 characters or not `<8 digits>.<suffix>`, or the size over 8 GiB.
    """
    if not NAME.fullmatch(name) or len(name) > LONGEST_NAME:
        raise _wrong(name, f"expected a name of at most {LONGEST_NAME} characters like 00000042.i_s.exr, got {name!r}")
    if not 0 <= size <= MAX_MEMBER:
        raise _wrong(name, f"expected at most {MAX_MEMBER} bytes, got {size}")
    info = tarfile.TarInfo(name)
    info.size, info.mode = size, MODE
    return info.tobuf(tarfile.USTAR_FORMAT)


def padding(size: int) -> bytes:
    """Zeros that fill `size` bytes up to whole blocks."""
    return bytes(-size % BLOCK)


def end_blocks(size: int) -> bytes:
    """Zeros that end an archive of `size` bytes: two blocks, then up to a whole record."""
    return bytes(2 * BLOCK + -(size + 2 * BLOCK) % RECORD)


def segment(members: Iterable[Member]) -> bytes:
    """Headers and padded payloads of one example's members, in the given order. Raises ShardError as `header` does."""
    return b"".join(part for member in members
                    for part in (header(member.name, len(member.data)), member.data, padding(len(member.data))))


def segment_size(sizes: Iterable[int]) -> int:
    """Bytes of a segment whose members have these sizes."""
    return sum(BLOCK + size + len(padding(size)) for size in sizes)


def _wrong(name: str, rule: str) -> ShardError:
    return ShardError([Problem(where=name, path="", rule=rule)])
