"""Bytes kept by the key of what made them: whole or not at all, and no more of them than was allowed.

What was not used for longest goes first. Several processes may share a store: files appear by a rename, and one that
has gone is simply not there.
"""

import hashlib
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from dataset_builder.files import output_errors, write_atomic

PASSES = "passes"
"""Folder below `.build` where a build keeps what passes found, unless it is told another."""

GB = 10**9
CACHE_SIZE = 4 * GB
"""Bytes that a build keeps of it, unless it is told another number."""

DIGEST_SIZE = hashlib.sha256().digest_size
ROOM = 16
"""A store is looked over whenever one process has written this fraction of its limit, and then left as much free."""


class ByteStore:
    """Values by key in a folder of at most about `limit` bytes; a limit of 0 keeps nothing."""

    def __init__(self, folder: Path, limit: int):
        self._folder, self._limit, self._written = folder, limit, 0

    def get(self, key: str) -> bytes | None:
        """The value of `key`; None where there is none, or it is damaged. It counts as used now."""
        path = self._path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        seal, value = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if hashlib.sha256(value).digest() != seal:
            return None
        with suppress(OSError):
            os.utime(path)
        return value

    def has(self, key: str) -> bool:
        """Whether there is a value of `key`, which may turn out damaged."""
        return self._path(key).is_file()

    def put(self, key: str, value: bytes) -> None:
        """Keep a value, if there is room for any. Raises OutputError where the disk refuses."""
        size = len(value) + DIGEST_SIZE
        if size > self._limit - self._limit // ROOM:
            return
        write_atomic(self._path(key), hashlib.sha256(value).digest() + value)
        self._written += size
        if self._written > self._limit // ROOM:
            self.trim()

    def trim(self) -> None:
        """Remove what was not used for longest, until a sixteenth of the limit is free; a store that is to keep nothing
        leaves what others kept. Raises OutputError."""
        self._written = 0
        if not self._limit:
            return
        left = self.size() - (self._limit - self._limit // ROOM)
        for _, size, path in sorted(self._entries()) if left > 0 else ():
            if left <= 0:
                break
            with output_errors(path):
                path.unlink(missing_ok=True)
            left -= size

    def size(self) -> int:
        """Bytes of everything that is kept."""
        return sum(size for _, size, _ in self._entries())

    def _entries(self) -> Iterator[tuple[int, int, Path]]:
        """Time of last use in nanoseconds, size, and path of every file; unfinished ones are old by themselves."""
        for path in self._folder.glob("[0-9a-f][0-9a-f]/*"):
            with suppress(OSError):
                status = path.lstat()
                yield status.st_mtime_ns, status.st_size, path

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / key
