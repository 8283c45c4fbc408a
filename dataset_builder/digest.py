"""Digests of content: what a cache or a manifest keys on."""

import errno
import hashlib
import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

CHUNK_BYTES = 1 << 20


def sha256_bytes(data: bytes) -> str:
    """Lower-case hexadecimal SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def open_regular(path: Path, *, most: int | None = None) -> BinaryIO:
    """A file, opened for reading. Raises OSError where it is not a regular file, such as a FIFO (never waited for) or
    a device (never ends), and where it has more than `most` bytes."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    try:
        found = os.fstat(descriptor)
        if stat.S_ISDIR(found.st_mode):
            raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        if most is not None and found.st_size > most:
            raise OSError(errno.EFBIG, f"larger than {most:,} bytes", str(path))
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, *, most: int) -> bytes:
    """The bytes of a file. Raises OSError as `open_regular` does."""
    with open_regular(path, most=most) as stream:
        # A plain read(most) would set that much memory aside first
        return stream.read(min(most, os.fstat(stream.fileno()).st_size))


def sha256_file(path: Path, *, most: int | None = None) -> str:
    """Lower-case hexadecimal SHA-256 of a file, read in chunks. Raises OSError as `open_regular` does."""
    hasher = hashlib.sha256()
    with open_regular(path, most=most) as stream:
        while chunk := stream.read(CHUNK_BYTES):
            hasher.update(chunk)
    return hasher.hexdigest()


def canonical_json(value: Any) -> bytes:
    """UTF-8 JSON with sorted keys and no spaces; refuses NaN, Inf and types without a stable form (TypeError)."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()


def digest(value: Any) -> str:
    """SHA-256 of the canonical JSON of plain data (dict, list, str, int, float, bool, None).

    >>> digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})
    True
    """
    return sha256_bytes(canonical_json(value))


def sealed(content: Mapping[str, Any]) -> bytes:
    """Canonical JSON of a mapping and, under `seal`, its digest."""
    return canonical_json({**content, "seal": digest(content)})


def unsealed(data: bytes) -> dict[str, Any] | None:
    """The mapping that `sealed` made `data` of; None where a single bit of it has changed."""
    try:
        content = json.loads(data)
        del content["seal"]
        return content if sealed(content) == data else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def pixel_digest(array: np.ndarray) -> str:
    """SHA-256 of an array's dtype, shape and C-ordered bytes: survives a change of codec, unlike a file's hash."""
    head = f"{array.dtype.str}{array.shape}".encode()
    return sha256_bytes(head + np.ascontiguousarray(array).tobytes())
