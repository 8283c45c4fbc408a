"""Digests of content: what a cache or a manifest keys on."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

CHUNK_BYTES = 1 << 20


def sha256_bytes(data: bytes) -> str:
    """Lower-case hexadecimal SHA-256 of `data`."""
    return hashlib.sha256(data).hexdigest()


def sha256_file(path: Path) -> str:
    """Lower-case hexadecimal SHA-256 of a file, read in chunks."""
    hasher = hashlib.sha256()
    with path.open("rb") as stream:
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


def pixel_digest(array: np.ndarray) -> str:
    """SHA-256 of an array's dtype, shape and C-ordered bytes: survives a change of codec, unlike a file's hash."""
    head = f"{array.dtype.str}{array.shape}".encode()
    return sha256_bytes(head + np.ascontiguousarray(array).tobytes())
