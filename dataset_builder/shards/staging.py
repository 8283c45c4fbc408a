"""Finished examples that wait for their shard. An interrupted build finds them again; nothing stale is ever taken.

Each is two files below `.build/staging/`: `<key>.<digest>.segment` and, written after it, `<key>.<digest>.json` with
its hash and its index entry, sealed. `digest` covers the example's plan and every version that pixels depend on.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dataset_builder.digest import sealed, sha256_bytes, unsealed
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import PARTIAL, output_errors, write_atomic
from dataset_builder.shards.folder import STAGING, WORK


@dataclass(frozen=True, kw_only=True)
class Staged:
    """A finished example."""

    segment: bytes
    """Its bytes in a shard."""
    entry: dict[str, Any]
    """`key`, `view` and `members` (as `Member.record`)."""


class Staging:
    """The finished examples of one output folder."""

    def __init__(self, folder: Path):
        self._folder = folder / WORK / STAGING

    def put(self, key: str, digest: str, segment: bytes, entry: Mapping[str, Any]) -> None:
        """Keep a finished example; whatever was kept under the same key before is dropped. Raises OutputError."""
        segment_path, entry_path = self._paths(key, digest)
        write_atomic(segment_path, segment)
        seal = {"sha256": sha256_bytes(segment), "entry": dict(entry)}
        write_atomic(entry_path, sealed(seal))
        self._drop(key, but=digest)

    def has(self, key: str, digest: str) -> bool:
        """True where the example was finished from exactly this plan and these versions, and is undamaged."""
        return self._load(key, digest) is not None

    def get(self, key: str, digest: str) -> Staged:
        """The example kept under `key` and `digest`. Raises ShardError where there is none, or it is damaged."""
        staged = self._load(key, digest)
        if staged is None:
            rule = f"expected example {key} made from {digest[:12]}, found none that is undamaged"
            raise ShardError([Problem(where=str(self._folder), path="", rule=rule, hint="run the build again")])
        return staged

    def size(self) -> int:
        """Bytes of everything that is kept."""
        return sum(map(_size, self._files("*")))

    def count(self) -> int:
        """How many examples are kept, damaged ones among them."""
        return len(self._files("*.json"))

    def drop(self, key: str) -> None:
        """Forget an example, whatever it was made from."""
        self._drop(key, but=None)

    def clear(self) -> None:
        """Forget everything, unfinished files included."""
        self._remove(self._files("*"))

    def _drop(self, key: str, but: str | None) -> None:
        self._remove(path for path in self._files(f"{key}.*")
                     if but is None or not path.name.startswith(f"{key}.{but}.") or path.name.endswith(PARTIAL))

    def _remove(self, paths: Iterable[Path]) -> None:
        with output_errors(self._folder):
            for path in paths:
                path.unlink()

    def _files(self, pattern: str) -> list[Path]:
        with output_errors(self._folder):
            return sorted(self._folder.glob(pattern)) if self._folder.is_dir() else []

    def _load(self, key: str, digest: str) -> Staged | None:
        segment_path, entry_path = self._paths(key, digest)
        try:
            seal, segment = unsealed(entry_path.read_bytes()), segment_path.read_bytes()
        except OSError:
            return None
        if seal is None or seal["sha256"] != sha256_bytes(segment):
            return None
        return Staged(segment=segment, entry=seal["entry"])

    def _paths(self, key: str, digest: str) -> tuple[Path, Path]:
        stem = f"{key}.{digest}"
        return self._folder / f"{stem}.segment", self._folder / f"{stem}.json"


def _size(path: Path) -> int:
    """Bytes of a file; 0 where it has gone, as files do while others build."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0
