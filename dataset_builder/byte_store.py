"""Bytes kept by the key of what made them: whole or not at all, and no more of them than was allowed.

What was not used for longest goes first. Several processes may share a store: files appear by a rename, and one that
has gone is simply not there.
"""

import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryFile

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import commit, output_errors, write_partial

PASSES = "passes"
"""Folder below `.build` where a build keeps what passes found, unless it is told another."""

GB = 10**9
CACHE_SIZE = 4 * GB
"""Bytes that a build keeps of it, unless it is told another number."""

DIGEST_SIZE = hashlib.sha256().digest_size
ROOM = 16
"""A store is looked over whenever one process has written this fraction of its limit, and then left as much free."""


OWN = re.compile(r"[0-9a-f]{64}(\.[0-9a-f]{16})?(\.partial)?")
"""Names of a store's files."""


def require_store(store: Path, folder: Path) -> None:
    """Make a store's folder where it is missing. Raises OutputError where that fails, and where the store would lie
    among the files of the dataset in `folder`."""
    inside = Path(os.path.abspath(store)), Path(os.path.abspath(folder))
    if inside[0] == inside[1] or inside[1] in inside[0].parents:
        rule = f"expected a folder outside of the dataset {folder}, got {store}"
        raise OutputError([Problem(where="--cache", path="", rule=rule, hint="leave it out to keep results there")])
    try:
        store.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=store):
            pass
    except OSError as error:
        rule = f"expected a folder that can be written, got {store} ({error.strerror or error})"
        raise OutputError([Problem(where="--cache", path="", rule=rule, hint="name another folder")]) from error


def user_cache(name: str) -> Path:
    """Folder `name` of what this user's caches keep. https://specifications.freedesktop.org/basedir"""
    asked = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(asked) if os.path.isabs(asked) else Path.home() / ".cache") / "3df-lighting" / name


class ByteStore:
    """Values by key in a folder of at most about `limit` bytes; a limit of 0 keeps nothing.

    durable: whether values outlive a power cut. Others are soon written, and a torn one counts as none.
    """

    def __init__(self, folder: Path, limit: int, *, durable: bool = True):
        self._folder, self._limit, self._durable, self._written = folder, limit, durable, 0

    def get(self, key: str) -> bytes | None:
        """The value of `key`; None where there is none, or it is damaged. It counts as used now."""
        path = self._path(key)
        try:
            # Anything else may be waited for without an end
            content = path.read_bytes() if path.is_file() else b""
        except OSError:
            return None
        seal, value = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
        if _seal(key, value) != seal:
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
        # Under a name of its own: others may be writing the same
        aside = self._path(f"{key}.{token_hex(8)}")
        write_partial(aside, [_seal(key, value), value], flush=self._durable)
        commit(aside, self._path(key), flush=self._durable)
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
            # Nothing that a store did not write, wherever somebody put it
            if not OWN.fullmatch(path.name) or not path.name.startswith(path.parent.name):
                continue
            with suppress(OSError):
                status = path.lstat()
                yield status.st_mtime_ns, status.st_size, path

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / key


def _seal(key: str, value: bytes) -> bytes:
    """Digest of a value under its key, so that none is taken for another's."""
    return hashlib.sha256(key.encode() + value).digest()
