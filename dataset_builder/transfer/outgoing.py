"""What is sent of a dataset, what must not be in its way, and what became of it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, Problem, ShardError
from dataset_builder.remote.place import FolderPlace
from dataset_builder.shards.folder import INDEX, MANIFEST, SHARDS
from dataset_builder.shards.manifest import Manifest
from dataset_builder.transfer.origin import TEXTS, Origin, open_origin


@dataclass(frozen=True, kw_only=True)
class SentFile:
    """One file of a release."""

    name: str
    path: Path
    size: int


@dataclass(frozen=True, kw_only=True)
class Pushed:
    """What became of a push."""

    sha256: str
    """Of `dataset.json`, for those who pull to ask for."""
    files: int
    """How many were sent."""
    sent: int
    """Their bytes."""
    left: tuple[str, ...]
    """Shards and indexes there that nobody lists any more."""


def outgoing(folder: Path) -> tuple[Origin, list[SentFile]]:
    """The dataset in `folder` and all its files, `dataset.json` last. Raises ShardError for every one that is not what
    SHA256SUMS says."""
    origin, problems = open_origin(FolderPlace(folder)), list[Problem]()
    names = [*(name for shard in origin.manifest.shards for name in shard.files), *TEXTS]
    for name in names:
        try:
            got = sha256_file(folder / name)
        except OSError as error:
            problems.append(Problem(where=str(folder), path=name, rule=f"cannot be read ({error.strerror or error})"))
            continue
        if got != origin.sums.get(name, got):
            rule = f"expected SHA-256 {origin.sums[name]}, got {got}"
            problems.append(Problem(where=str(folder), path=name, rule=rule, hint="verify names all that is wrong"))
    if problems:
        raise ShardError(problems)
    for shard in origin.manifest.shards:
        origin.index(shard, (folder / shard.index_file).read_bytes())
    return origin, [SentFile(name=name, path=folder / name, size=(folder / name).stat().st_size) for name in names]


def require_outside(target: Path, dataset: Path, rule: str) -> None:
    """Raise OutputError where a folder is that of a dataset, or inside it, so that it would hold files too many."""
    if dataset.resolve() in (inside := target.resolve(), *inside.parents):
        raise OutputError([Problem(where=str(target), path="", rule=rule, hint="choose another folder")])


def require_room(title: str, before: Manifest | None, origin: Origin, *, replace: bool) -> None:
    """Raise OutputError where another release is there and must not make room."""
    if before and before != origin.manifest and not replace:
        rule = f"expected no dataset, or the same, got {before.name} {before.version}"
        if (before.name, before.version) == (origin.manifest.name, origin.manifest.version):
            rule += " with other content"
        raise OutputError([Problem(where=title, path=MANIFEST, rule=rule,
                                   hint="choose another address, or say --replace; no file was changed")])


def other_content(title: str, name: str) -> OutputError:
    """That a name is taken."""
    return OutputError([Problem(where=title, path=name, rule="expected no file, or the same, got other content under "
                                "this name", hint="remove it there, or choose another address; no file was changed")])


def left_over_there(names: Iterable[str], files: Sequence[SentFile]) -> tuple[str, ...]:
    """Shards and indexes among the names at a place that are not of a release, sorted."""
    own = {file.name for file in files}
    return tuple(sorted(name for name in names if name not in own and (
        (name.startswith(f"{SHARDS}/") and name.endswith(".tar"))
        or (name.startswith(f"{INDEX}/") and name.endswith(".manifest")))))
