"""Finished examples that wait for their shard. An interrupted build finds them again; nothing stale is ever taken.

Each is two files below `.build/staging/`, or at an address that all machines of a build can write:
`<key>.<digest>.segment` and, written after it, `<key>.<digest>.json` with its hash and its index entry, sealed.
`digest` covers the example's plan and every version that pixels depend on.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dataset_builder.digest import sealed, sha256_bytes, unsealed
from dataset_builder.errors import Problem, ShardError
from dataset_builder.files import PARTIAL
from dataset_builder.remote.file_box import box_at
from dataset_builder.shards.folder import STAGING, WORK


@dataclass(frozen=True, kw_only=True)
class Staged:
    """A finished example."""

    segment: bytes
    """Its bytes in a shard."""
    entry: dict[str, Any]
    """`key`, `view` and `members` (as `Member.record`)."""


class Staging:
    """The finished examples of one output folder; url: where they wait, if not there."""

    def __init__(self, folder: Path, url: str = ""):
        self._box, self.here = box_at(folder / WORK / STAGING, url), not url
        """here: whether they are in the output folder."""

    def put(self, key: str, digest: str, segment: bytes, entry: Mapping[str, Any]) -> None:
        """Keep a finished example; whatever was kept under the same key before is dropped. Raises OutputError."""
        segment_name, entry_name = _names(key, digest)
        self._box.write(segment_name, segment)
        seal = {"sha256": sha256_bytes(segment), "entry": dict(entry)}
        self._box.write(entry_name, sealed(seal))
        self._drop(key, but=digest)

    def has(self, key: str, digest: str, sha256: str = "") -> bool:
        """True where the example was finished from exactly this plan and these versions, and is undamaged. sha256: of
        its segment, where that is known."""
        return self._load(key, digest, sha256) is not None

    def there(self, key: str, digest: str) -> bool:
        """Whether its files are there, which may turn out damaged."""
        return all(self._box.sizes(name) for name in _names(key, digest))

    def sha256_of(self, key: str, digest: str) -> str:
        """Digest of an example's segment as it was written. Raises ShardError where there is none."""
        try:
            seal = unsealed(self._box.read(_names(key, digest)[1]))
        except OSError:
            seal = None
        if seal is None:
            raise self._missing(key, digest)
        return str(seal["sha256"])

    def get(self, key: str, digest: str, sha256: str = "") -> Staged:
        """The example kept under `key` and `digest`. Raises ShardError where there is none, or it is damaged."""
        staged = self._load(key, digest, sha256)
        if staged is None:
            raise self._missing(key, digest)
        return staged

    def known(self) -> dict[str, str]:
        """Digest of every example that is kept, by key, from names alone."""
        return dict(name.split(".")[:2] for name in self._box.sizes("*.json"))  # type: ignore[misc]

    def _missing(self, key: str, digest: str) -> ShardError:
        rule = f"expected example {key} made from {digest[:12]}, found none that is undamaged"
        return ShardError([Problem(where=self._box.title, path="", rule=rule, hint="run the build again")])

    def size(self) -> int:
        """Bytes of everything that is kept."""
        return sum(self._box.sizes("*").values())

    def drop(self, key: str) -> None:
        """Forget an example, whatever it was made from."""
        self._drop(key, but=None)

    def clear(self) -> None:
        """Forget everything, unfinished files included."""
        for name in self._box.sizes("*"):
            self._box.remove(name)

    def _drop(self, key: str, but: str | None) -> None:
        for name in self._box.sizes(f"{key}.*"):
            if but is None or not name.startswith(f"{key}.{but}.") or name.endswith(PARTIAL):
                self._box.remove(name)

    def _load(self, key: str, digest: str, sha256: str = "") -> Staged | None:
        segment_name, entry_name = _names(key, digest)
        try:
            seal, segment = unsealed(self._box.read(entry_name)), self._box.read(segment_name)
        except OSError:
            return None
        if seal is None or seal["sha256"] != sha256_bytes(segment) or sha256 not in ("", seal["sha256"]):
            return None
        # Files of another example were given this one's names
        if seal["entry"]["key"] != key:
            return None
        return Staged(segment=segment, entry=seal["entry"])


def _names(key: str, digest: str) -> tuple[str, str]:
    """Of the bytes of an example, and of what is said of them."""
    return f"{key}.{digest}.segment", f"{key}.{digest}.json"
