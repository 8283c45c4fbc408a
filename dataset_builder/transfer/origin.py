"""A dataset to take files from: what it says of itself, checked against its own sums before anything large is fetched.

Nothing of it is trusted. Names cannot lead out of a folder (`ShardRecord`), and what a manifest and an index say of
offsets, sizes and counts must agree before a byte of a shard is asked for.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.remote.place import Place
from dataset_builder.shards.example import LABEL, PREVIEW
from dataset_builder.shards.folder import CARD, CROISSANT, MANIFEST, MOST_BYTES, SUMS
from dataset_builder.shards.manifest import Manifest, from_json, with_shards
from dataset_builder.shards.publish import listed_files, sums_in
from dataset_builder.shards.segment import end_blocks, header
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord, tagged
from dataset_builder.shards.structure import members_of, misplaced, starts

TEXTS = (CARD, CROISSANT, SUMS, MANIFEST)
"""Files of a dataset beside shards and indexes; `dataset.json` last, as they are written."""

LINE = 64 + 3
"""Bytes of a line of SHA256SUMS beside the name in it."""

TRIES = 3
"""How often bytes are fetched that turn out not to be those that were stated."""


@dataclass(frozen=True, kw_only=True)
class Origin:
    """A finished dataset somewhere. Every method raises ShardError where what is there is not what is stated, and
    UserError where it cannot be read."""

    place: Place
    manifest: Manifest
    sums: Mapping[str, str]
    """SHA-256 of every file but SHA256SUMS, by name."""
    texts: Mapping[str, bytes]
    """`dataset.json` and `SHA256SUMS` as they are there."""

    @property
    def sha256(self) -> str:
        """Of `dataset.json`: which dataset it is, to the last byte."""
        return self.sums[MANIFEST]

    def text(self, name: str) -> bytes:
        """A small file, as SHA256SUMS has it."""
        for _ in range(TRIES):
            data = self.texts[name] if name in self.texts else _read(self.place, name)
            if name == SUMS or (got := sha256_bytes(data)) == self.sums[name]:
                return data
        raise self._wrong(name, f"expected SHA-256 {self.sums[name]} ({SUMS}), got {got}")

    def index(self, shard: ShardRecord, data: bytes) -> ShardIndex:
        """The index of a shard from the bytes of its file. Every member must lie where the shard's bytes say."""
        name = shard.index_file
        index = from_json(ShardIndex, data, where=f"{self.place.title}: {name}")
        keys = [example.key for example in index.examples]
        if index.shard != shard or tagged(index, shard.slot) != index:
            raise self._wrong(name, f"expected the index of {shard.name}, as {MANIFEST} lists it")
        if len(keys) != shard.examples or keys != sorted(set(keys)) or [shard.first_key, shard.last_key] != [
                *keys[:1], *keys[-1:]]:
            raise self._wrong(name, f"expected {shard.examples} keys in order, {shard.first_key} to {shard.last_key}")
        end = starts(index)[-1]
        if misplaced(index) or end + len(end_blocks(end)) != shard.bytes:
            raise self._wrong(name, f"expected members one after the other in {shard.bytes} bytes")
        suffixes = sorted([*(f"{layer.name}.exr" for layer in self.manifest.layers), LABEL, PREVIEW])
        for example in index.examples:
            if [member.suffix for member in example.members] != suffixes:
                raise self._wrong(name, f"expected members {', '.join(suffixes)} of example {example.key}")
        for member in members_of(index):
            header(member.name, member.size)
        return index

    def _wrong(self, name: str, rule: str) -> ShardError:
        return _wrong(self.place, name, rule)


def open_origin(place: Place, *, sha256: str = "") -> Origin:
    """What lies at `place`; sha256: what its `dataset.json` must have, in hexadecimal.

    Raises ShardError where there is no finished dataset, or one that does not agree with itself or `sha256`; UserError
    where it cannot be read. What does not agree is read again, since it may have been replaced meanwhile.
    """
    for _ in range(TRIES - 1):
        with suppress(ShardError):
            return _opened(place, sha256)
    return _opened(place, sha256)


def _opened(place: Place, sha256: str) -> Origin:
    data = _read(place, MANIFEST)
    got = sha256_bytes(data)
    if sha256 and got != sha256.lower():
        raise _wrong(place, MANIFEST, f"expected SHA-256 {sha256.lower()}, got {got}",
                     "it is another dataset or version than the one that was asked for")
    manifest = from_json(Manifest, data, where=f"{place.title}: {MANIFEST}")
    count = len(manifest.shards)
    if min(len({shard.name for shard in manifest.shards}), len({shard.sha256 for shard in manifest.shards})) < count:
        raise _wrong(place, MANIFEST, "expected shards of different names and content")
    if not count:
        raise _wrong(place, MANIFEST, "expected one shard or more")
    if with_shards(manifest, manifest.shards) != manifest or manifest.totals.rejected != len(manifest.rejected) \
            or {shard.split for shard in manifest.shards} != {split.name for split in manifest.splits}:
        raise _wrong(place, MANIFEST, "expected splits and totals that are those of the shards listed")
    files = listed_files(manifest)
    texts = {MANIFEST: data, SUMS: _read(place, SUMS, most=sum(LINE + len(name) for name in files))}
    lines = sums_in(texts[SUMS])
    if None in lines or [line[0] for line in lines if line] != files:
        raise _wrong(place, SUMS, "expected every file of the dataset once, in order, and no other")
    sums = dict(filter(None, lines))
    if wrong := [shard.name for shard in manifest.shards if sums[shard.tar_file] != shard.sha256]:
        raise _wrong(place, SUMS, f"expected the SHA-256 of {MANIFEST}, got another of {wrong[0]}")
    origin = Origin(place=place, manifest=manifest, sums=sums, texts=texts)
    origin.text(MANIFEST)
    return origin


def unreadable(place: Place, name: str, error: Exception) -> UserError:
    """That a file could not be fetched: what was finished is kept."""
    reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return UserError([Problem(where=place.title, path=name, rule=f"cannot be read ({reason})",
                              hint="what was fetched is kept; run the same command again to go on")])


def _read(place: Place, name: str, *, most: int = MOST_BYTES) -> bytes:
    try:
        return place.read(name, most=most)
    except FileNotFoundError as error:
        hint = "a build and a push write it last: let them finish, or give another address" * (name == MANIFEST)
        raise _wrong(place, name, "expected a finished dataset, found no such file", hint) from error
    except (OSError, EOFError) as error:
        raise unreadable(place, name, error) from error


def _wrong(place: Place, name: str, rule: str, hint: str = "") -> ShardError:
    return ShardError([Problem(where=place.title, path=name, rule=rule, hint=hint)])
