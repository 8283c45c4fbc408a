"""Which dataset a damaged folder held: the SHA-256 that its `dataset.json` had, and what else can still be told."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import ValidationError

from dataset_builder.digest import read_regular, sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.folder import MANIFEST, MOST_BYTES, SUMS, Claim
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.publish import listed_files, sums_in

ALIKE = 48
"""Of 64 digits, how many must agree for one hash to be a damaged copy of another: two different ones share some 4."""


@dataclass(frozen=True, kw_only=True)
class Anchor:
    """What a folder held."""

    sha256: str
    """Of `dataset.json`."""
    manifest: Manifest | None
    """Where that file is whole."""
    sums: dict[str, str]
    """SHA-256 by name, as SHA256SUMS has them; a line may be damaged."""
    listed: bytes
    """SHA256SUMS as it is."""

    @property
    def files(self) -> list[str]:
        """Names of the dataset's files, but for SHA256SUMS, as far as they are known."""
        return listed_files(self.manifest) if self.manifest else sorted(name for name in self.sums if _ours(name))


@dataclass(frozen=True, kw_only=True)
class Repaired:
    """What was done."""

    mended: tuple[str, ...] = ()
    """Files that are whole again."""
    rendered: tuple[str, ...] = ()
    """Keys of examples that were rendered again."""
    members: tuple[str, ...] = ()
    """Members that were fetched alone; the rest of their shards was whole."""
    fetched: int = 0
    """Bytes of files and members."""
    aside: tuple[str, ...] = ()
    """Files that are not of the dataset, now below `.build/set-aside`."""


def anchor_of(folder: Path) -> Anchor:
    """What the dataset in `folder` was. Raises ShardError where neither `dataset.json` nor SHA256SUMS tells."""
    data, listed = _read(folder / MANIFEST), _read(folder / SUMS) or b""
    sums = dict(filter(None, sums_in(listed)))
    there, stated = sha256_bytes(data) if data is not None else "", sums.get(MANIFEST, "")
    manifest = _manifest(data)
    damaged_line = sum(a == b for a, b in zip(there, stated, strict=False)) >= ALIKE
    if manifest and (not stated or damaged_line):
        return Anchor(sha256=there, manifest=manifest, sums=sums, listed=listed)
    if not stated:
        raise refused(folder, f"expected {MANIFEST} or {SUMS} to say what this dataset was, got neither whole",
                      "build or download it again")
    return Anchor(sha256=stated, manifest=None, sums=sums, listed=listed)


def _manifest(data: bytes | None) -> Manifest | None:
    try:
        return from_json(Manifest, data, where=MANIFEST) if data is not None else None
    except ShardError:
        return None


def _read(path: Path) -> bytes | None:
    try:
        return read_regular(path, most=MOST_BYTES)
    except OSError:
        return None


def _ours(name: str) -> bool:
    """Whether a line of SHA256SUMS, which may be damaged, names a file of a dataset."""
    try:
        return bool(Claim(name="", version="", files=(name,)).files)
    except ValidationError:
        return False


def refused(where: Path | str, rule: str, hint: str) -> ShardError:
    """An error that ends a repair."""
    return ShardError([Problem(where=str(where), path="", rule=rule, hint=f"{hint}; the dataset is as it was")])
