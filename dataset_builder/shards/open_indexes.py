"""Manifest and indexes of a finished dataset, from wherever it lies: no larger than they may be, and those that were
published."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.place import FolderPlace, Place
from dataset_builder.shards.folder import MANIFEST, MOST_BYTES, SUMS
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.member_bytes import SHA256
from dataset_builder.shards.one_writer import placed
from dataset_builder.shards.publish import sums_in
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import members_of, misplaced, starts

TOGETHER = 16
"""Indexes that are fetched side by side, and held at a time."""
EXAMPLE_BYTES = 1 << 16
"""What an index may say of one example; of forty files it says a fifth of that."""


def load_manifest(folder: Path | str, *, sha256: str = "") -> Manifest:
    """The manifest of a finished dataset in a folder or at an address; sha256: of its file, if it is known.

    Raises ShardError where there is none, it has another SHA-256, or it breaks its schema.
    """
    return read_manifest(place_of(folder), sha256=sha256)[0]


def read_manifest(place: Place, *, sha256: str = "") -> tuple[Manifest, str]:
    """The manifest of the dataset at a place, and the SHA-256 of its file; see `load_manifest`."""
    try:
        data = place.read(MANIFEST, most=MOST_BYTES)
    except (FileNotFoundError, NotADirectoryError) as error:
        problem = Problem(where=place.title, path=MANIFEST, rule="expected a finished dataset, found no such file",
                          hint="a build writes it last: let the build finish")
        raise ShardError([problem]) from error
    except OSError as error:
        raise _unread(place, MANIFEST, error) from error
    got = sha256_bytes(data)
    if sha256 and got != sha256.lower():
        raise _wrong(place, MANIFEST, f"expected SHA-256 {sha256:.80}, got {got}: it is another version or dataset")
    manifest = from_json(Manifest, data, where=f"{place.title}/{MANIFEST}")
    return manifest, got


def read_indexes(place: Place, manifest: Manifest, *, verify: str,
                 manifest_sha256: str) -> Iterator[tuple[int, ShardIndex]]:
    """Number in the manifest, and index, of every shard. Raises ShardError where one is missing, is another's, or is
    not what `SHA256SUMS` says, and where a shard has another size; with verify `off` sums and sizes are not compared.
    """
    _require_counts(place, manifest)
    listed = _sums(place) if verify != "off" else {}
    found = {MANIFEST: manifest_sha256}
    shards = iter(enumerate(manifest.shards))
    while some := list(islice(shards, TOGETHER)):
        sizes, texts = _fetched(place, [shard for _, shard in some])
        for (number, shard), size, text in zip(some, sizes, texts, strict=True):
            name = shard.index_file
            found[name] = sha256_bytes(text)
            if listed and found[name] != listed.get(name) and not isinstance(place, FolderPlace):
                # On its way, perhaps
                text = _fetched(place, [shard])[1][0]
                found[name] = sha256_bytes(text)
            index = from_json(ShardIndex, text, where=f"{place.title}/{name}")
            if index.shard != shard or len(index.examples) != shard.examples:
                raise _wrong(place, name, f"expected the index of {shard.examples} examples that {MANIFEST} names")
            if verify != "off" and size != shard.bytes:
                raise _wrong(place, shard.tar_file, f"expected {shard.bytes} bytes, got {size}")
            if not isinstance(place, FolderPlace):
                _require_possible(place, index)
            yield number, index
    if verify != "off":
        for name, got in found.items():
            if got != listed.get(name):
                raise _wrong(place, name, f"expected SHA-256 {listed.get(name)} ({SUMS}), got {got}")


def _fetched(place: Place, shards: list[ShardRecord]) -> tuple[list[int], list[bytes]]:
    """Sizes of shards, and the bytes of their indexes."""
    try:
        sizes = place.sizes([shard.tar_file for shard in shards])
        return sizes, place.files([(shard.index_file, min(MOST_BYTES, EXAMPLE_BYTES * (shard.examples + 1)))
                                   for shard in shards])
    except FileNotFoundError as error:
        raise ShardError([Problem(where=str(error.filename or place.title), path="",
                                  rule="expected a file, found none")]) from error
    except OSError as error:
        raise _unread(place, "", error) from error


def _sums(place: Place) -> dict[str, str]:
    """What `SHA256SUMS` says, by file."""
    # A swap of this builder that was cut short has not moved it yet
    name = placed(place.folder, SUMS).relative_to(place.folder).as_posix() if isinstance(place, FolderPlace) else SUMS
    try:
        return dict(filter(None, sums_in(place.read(name, most=MOST_BYTES))))
    except OSError as error:
        raise _unread(place, name, error) from error


def _require_counts(place: Place, manifest: Manifest) -> None:
    """Raise ShardError where a manifest lists a shard twice, or more examples or fewer than its shards have."""
    if len({shard.name for shard in manifest.shards}) < len(manifest.shards):
        rule = f"expected different shards in {MANIFEST}, got one twice"
    elif (found := sum(shard.examples for shard in manifest.shards)) != manifest.totals.examples:
        rule = f"expected {manifest.totals.examples} examples, the shards in {MANIFEST} hold {found}"
    else:
        return
    raise ShardError([Problem(where=place.title, path="", rule=rule)])


def _require_possible(place: Place, index: ShardIndex) -> None:
    """Raise ShardError where members overlap or lie beyond their shard, or have no digest to check them by."""
    wrong = misplaced(index)
    for member in members_of(index):
        if not SHA256.fullmatch(member.sha256):
            raise _wrong(place, index.shard.index_file, f"expected the SHA-256 of {member.name!r:.60}")
        if member.name in wrong:
            raise _wrong(place, index.shard.index_file, f"expected files after one another, {member.name!r:.60} is not")
    if (end := starts(index)[-1]) > index.shard.bytes:
        raise _wrong(place, index.shard.index_file, f"expected files within {index.shard.bytes} bytes, got {end}")


def _unread(place: Place, name: str, error: OSError) -> ShardError:
    where = str(error.filename or f"{place.title}/{name}".rstrip("/"))
    return ShardError([Problem(where=where, path="", rule=f"cannot be read ({error.strerror or error})")])


def _wrong(place: Place, name: str, rule: str) -> ShardError:
    return ShardError([Problem(where=f"{place.title}/{name}", path="", rule=rule)])
