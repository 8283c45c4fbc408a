"""A dataset, or chosen examples of one, from wherever it lies to a folder: checked, resumed, and whole or not there."""

import shutil
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from dataset_builder.digest import sha256_file
from dataset_builder.errors import OutputError, Problem, ShardError, UserError
from dataset_builder.files import output_errors, require_space, size_text, write_atomic
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.place import FolderPlace, Place
from dataset_builder.shards.folder import MANIFEST, NEXT, SUMS, WORK, Claim, next_of, require_ours
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.one_writer import build_lock, swap
from dataset_builder.shards.publish import listed_files, publish_dataset, published, sums_in
from dataset_builder.shards.shard_index import ShardRecord
from dataset_builder.shards.structure import read_small
from dataset_builder.shards.writer import index_path, shard_path
from dataset_builder.transfer.choice import ChosenShard, ExampleChoice, choose, layers_chosen
from dataset_builder.transfer.chunked_file import CHUNK_SIZE
from dataset_builder.transfer.fetching import PULL, Fetching, TransferProgress
from dataset_builder.transfer.origin import TEXTS, Origin, open_origin
from dataset_builder.transfer.outgoing import require_outside
from dataset_builder.transfer.subset_manifest import subset_manifest, subset_record
from dataset_builder.transfer.subset_shards import Assembly, batches

EVERYTHING = ExampleChoice()


@dataclass(frozen=True, kw_only=True)
class Pulled:
    """What became of a pull."""

    manifest: Manifest
    """Of the dataset that is there now."""
    wanted: int
    """Bytes of shards, or of files of chosen examples, that were asked for."""
    moved: int
    """Bytes of shards and indexes that came over the wire."""


def pull(address: str | Path | Place, folder: Path, *, choice: ExampleChoice = EVERYTHING, sha256: str = "",
         most: int | None = None, replace: bool = False,
         told: Callable[[TransferProgress], None] = lambda progress: None, chunk_size: int = CHUNK_SIZE) -> Pulled:
    """Bring the dataset at `address`, or what `choice` wants of it, to `folder`.

    A whole dataset is equal byte by byte. A choice becomes a dataset of its own, of which nothing else is fetched.
    sha256: what `dataset.json` at the address must have. most: bytes that may be fetched. replace: another dataset,
    major version or choice in `folder` may go. Until all is there the folder holds what it held before.

    Raises ShardError where what lies at the address does not agree with itself; then the folder is as it was. Raises
    OutputError where the folder or the disk refuses, and UserError where the choice or the address is wrong, or bytes
    cannot be had; in these cases the next run goes on from what was fetched.
    """
    place = place_of(address) if isinstance(address, str | Path) else address
    _require_elsewhere(place, folder)
    origin = open_origin(place, sha256=sha256)
    layers = layers_chosen(origin.manifest, choice)
    claim = Claim(name=origin.manifest.name, version=origin.manifest.version)
    require_ours(folder, claim, replace=replace)
    if not replace:
        _require_same_choice(folder, choice)
    fetching = Fetching(origin, folder, told=told, chunk_size=chunk_size)
    with _as_it_was(folder) as begin, build_lock(folder, claim, replace=replace):
        if done := _finished(origin, choice, folder):
            return Pulled(manifest=done, wanted=0, moved=0)
        chosen = _choose(origin, choice, fetching)
        _require_room(folder, chosen, most)
        begin()
        manifest = _fetch(fetching, chosen, layers, choice)
        shutil.rmtree(folder / WORK / PULL, ignore_errors=True)
    return Pulled(manifest=manifest, wanted=sum(part.bytes for part in chosen), moved=fetching.moved)


def _require_same_choice(folder: Path, choice: ExampleChoice) -> None:
    """Raise OutputError where `folder` holds a dataset of which something else was asked for."""
    before = _manifest_of(folder)
    if before and (before.subset and before.subset.asked) != (None if choice.whole else choice.asked()):
        said = f"what {before.subset.choice} chose" if before.subset else "the whole"
        raise OutputError([Problem(where=str(folder), path=MANIFEST, rule="expected a new or empty folder, or one with "
                                   f"what the same choice chose, got {said} of {before.name} {before.version}",
                                   hint="choose another folder, or say --replace; no file was changed")])


def _choose(origin: Origin, choice: ExampleChoice, fetching: Fetching) -> list[ChosenShard]:
    if choice.by_index and choice.count is None:
        fetching.indexes(shard for shard in origin.manifest.shards if choice.wants_split(shard.split))
    return choose(origin.manifest, choice, fetching.index)


def _fetch(fetching: Fetching, chosen: Sequence[ChosenShard], layers: Sequence[str], choice: ExampleChoice) -> Manifest:
    """Fetch what is not there yet, and let it take the place of the old set."""
    origin, folder = fetching.origin, fetching.folder
    files = [part.shard for part in chosen if part.whole]
    missing = [shard for shard in files if not _has(origin, folder, shard)]
    fetching.total = sum(part.bytes for part in chosen)
    fetching.note(done=sum(shard.bytes for shard in files) - sum(shard.bytes for shard in missing))
    texts = {name: origin.text(name) for name in TEXTS} if choice.whole else {}
    fetching.shards(missing)
    if choice.whole:
        for name, data in texts.items():
            write_atomic(next_of(folder) / name, data)
        swap(folder)
        return origin.manifest
    assembly, shards = Assembly(fetching, layers), {shard.slot: shard for shard in files}
    for batch in batches(origin.manifest, chosen):
        if index := assembly.finished(batch):
            fetching.note(done=sum(part.bytes for part in batch.parts))
        shards[batch.slot] = (index or assembly.make(batch)).shard
    order = [shards[shard.slot] for shard in origin.manifest.shards if shard.slot in shards]
    manifest = subset_manifest(origin, choice, layers, order, folder)
    publish_dataset(folder, manifest)
    return manifest


def _has(origin: Origin, folder: Path, shard: ShardRecord) -> bool:
    """Whether a shard waits whole for the next set, or lies whole in its place; what waits damaged goes."""
    for root in (next_of(folder), folder):
        index = published(root, shard.stem)
        path = index_path(root, shard.stem)
        if index and index.shard == shard and sha256_file(path) == origin.sums[shard.index_file]:
            return True
        if root != folder:
            with output_errors(folder):
                for path in (index_path(root, shard.stem), shard_path(root, shard.stem)):
                    path.unlink(missing_ok=True)
    return False


def _finished(origin: Origin, choice: ExampleChoice, folder: Path) -> Manifest | None:
    """The manifest in `folder` where it is of all that is wanted, and every file has its SHA-256; else None."""
    manifest = _manifest_of(folder)
    if not manifest or manifest.subset != (None if choice.whole else subset_record(origin, choice)):
        return None
    try:
        sums = dict(filter(None, sums_in(read_small(folder / SUMS))))
        right = sums == origin.sums if choice.whole else [*sums] == listed_files(manifest)
        right = right and all(sha256_file(folder / name) == sha256 for name, sha256 in sums.items())
        return manifest if right else None
    except (OSError, ShardError):
        return None


def _manifest_of(folder: Path) -> Manifest | None:
    try:
        return from_json(Manifest, read_small(folder / MANIFEST), where=MANIFEST)
    except ShardError:
        return None


def _require_room(folder: Path, chosen: Sequence[ChosenShard], most: int | None) -> None:
    """Raise UserError where more than `most` bytes are wanted, OutputError where the disk will not hold what is
    missing."""
    wanted = sum(part.bytes for part in chosen)
    if most is not None and wanted > most:
        raise UserError(f"expected at most {size_text(most)}, got {size_text(wanted)} that are wanted: choose fewer "
                        "examples or layers, or raise --most; nothing was fetched")
    there = sum(part.bytes for part in chosen if _size(shard_path(folder, part.shard.stem)) == part.bytes)
    begun = sum(_size(path) for name in (PULL, NEXT) for path in (folder / WORK / name).rglob("*"))
    require_space(folder, max(wanted - there - begun, 0))


def _size(path: Path) -> int:
    """Bytes that a file takes on the disk, which of one that is not whole may be fewer than it is long; else 0."""
    try:
        found = path.lstat()
    except OSError:
        return 0
    return min(found.st_size, found.st_blocks * 512) if stat.S_ISREG(found.st_mode) else 0


@contextmanager
def _as_it_was(folder: Path) -> Iterator[Callable[[], None]]:
    """Leave nothing in `folder` of what is refused: what lies at the address is not what it says, or the choice is
    wrong. Yields what is to be called when fetching begins: from then on other errors keep what was fetched."""
    new = [path for path in (folder / WORK / PULL, folder / WORK / NEXT, folder / WORK, folder) if not path.exists()]
    begun = False

    def begin() -> None:
        nonlocal begun
        begun = True

    try:
        yield begin
    except UserError as error:
        if isinstance(error, ShardError) or not begun:
            for path in new:
                shutil.rmtree(path, ignore_errors=True) if path != folder else _remove_empty(path)
        raise


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()


def _require_elsewhere(place: Place, folder: Path) -> None:
    if isinstance(place, FolderPlace):
        require_outside(folder, place.folder, "expected a folder outside of the dataset to pull from")
