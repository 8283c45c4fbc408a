"""The bytes of files of examples: from a folder, or from an address by way of a cache that processes share."""

import fcntl
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from itertools import count
from pathlib import Path
from typing import NamedTuple, Protocol

from dataset_builder.byte_store import ByteStore, user_cache
from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import OutputError, Problem, ShardError
from dataset_builder.files import require_writable
from dataset_builder.remote.coalesce import pieces
from dataset_builder.remote.place import ByteRange, EndedError, FolderPlace, Place
from dataset_builder.shards.shard_index import MemberRecord, ShardRecord

AGAIN = 2
"""How often bytes of another digest are fetched again."""
TOGETHER = 256
"""Members that are fetched side by side, and held at a time."""
CACHE = "members"
"""Folder of what was fetched, among the user's caches."""
LOCK = ".lock"
SHA256 = re.compile("[0-9a-f]{64}")


class MemberSpan(NamedTuple):
    """Where a member lies in its shard. A plain tuple, so that a dataset of many examples is soon handed to another
    process."""

    name: str
    offset: int
    size: int
    sha256: str


Wanted = Sequence[tuple[ShardRecord, MemberSpan]]


class MemberBytes(Protocol):
    """What members are asked for."""

    def read(self, wanted: Wanted) -> list[bytes]:
        """Payloads of members, in order. Raises ShardError where they cannot be had, or are not what they were."""


def span_of(member: MemberRecord) -> MemberSpan:
    """That of a member."""
    return MemberSpan(name=member.name, offset=member.offset, size=member.size, sha256=member.sha256)


class FolderMembers:
    """Members of shards on this machine; see `Dataset` for what `verify` means."""

    def __init__(self, place: Place, verify: str):
        self._place, self._verify, self._checked = place, verify, set[str]()

    def read(self, wanted: Wanted) -> list[bytes]:
        """See `MemberBytes.read`."""
        if self._verify == "shard":
            for shard, _ in wanted:
                self._check_shard(shard)
        with _told(wanted):
            payloads = self._place.ranges([_range(*one) for one in wanted])
        if self._verify == "member":
            for (shard, span), data in zip(wanted, payloads, strict=True):
                if span.name not in self._checked and sha256_bytes(data) != span.sha256:
                    raise _wrong(shard, "", f"expected SHA-256 {span.sha256} of {span.name}, its bytes differ")
                self._checked.add(span.name)
        return payloads

    def _check_shard(self, shard: ShardRecord) -> None:
        if shard.name not in self._checked:
            hasher = sha256()
            with _told([], shard):
                for chunk in self._place.stream(shard.tar_file):
                    hasher.update(chunk)
            if hasher.hexdigest() != shard.sha256:
                raise _wrong(shard, "", f"expected SHA-256 {shard.sha256}, its bytes differ")
            self._checked.add(shard.name)


class FetchedMembers:
    """Members of shards at an address. All are hashed before anybody sees them, and kept in `store` in `folder`."""

    def __init__(self, place: Place, folder: Path, limit: int):
        self._place, self._folder, self._limit = place, folder, limit
        self._store = ByteStore(folder, limit, durable=False)

    def read(self, wanted: Wanted) -> list[bytes]:
        """See `MemberBytes.read`. Neighbours are asked for at once."""
        found = self._kept({span.sha256 for _, span in wanted})
        if missing := [one for one in wanted if one[1].sha256 not in found]:
            # Another process that wants the same waits, and then finds it here
            with self._alone(missing[0][1].sha256):
                found |= self._kept({span.sha256 for _, span in missing})
                found |= self._fetched([one for one in missing if one[1].sha256 not in found])
        return [found[span.sha256] for _, span in wanted]

    def fetch(self, wanted: Wanted) -> None:
        """Bring members into the cache, unless it keeps nothing."""
        if self._limit:
            missing = [one for one in wanted if not self._store.has(one[1].sha256)]
            for start in range(0, len(missing), TOGETHER):
                self.read(missing[start:start + TOGETHER])

    def _kept(self, keys: set[str]) -> dict[str, bytes]:
        if not self._limit:
            return {}
        return {key: value for key in keys if (value := self._store.get(key)) is not None}

    def _fetched(self, wanted: Wanted) -> dict[str, bytes]:
        found = dict[str, bytes]()
        for attempt in count():
            left = [one for one in wanted if one[1].sha256 not in found]
            if not left:
                return found
            if attempt > AGAIN:
                (shard, span), *_ = left
                rule = f"expected SHA-256 {span.sha256}, its bytes at {self._place.title} differ"
                raise _wrong(shard, span.name, f"{rule}; fetched {attempt} times")
            with _told(left):
                payloads = pieces(self._place, [_range(*one) for one in left])
            for (_, span), data in zip(left, payloads, strict=True):
                if sha256_bytes(data) == span.sha256:
                    found[span.sha256] = data
                    # A disk that is full costs time, later on
                    with suppress(OutputError):
                        self._store.put(span.sha256, data)
        return found

    @contextmanager
    def _alone(self, key: str) -> Iterator[None]:
        """While no other process fetches the same; where the folder knows no locks, some is fetched twice."""
        # One file for many keys, which stays: to make and remove one each time costs more than the rest
        path, descriptor = self._folder / key[:2] / LOCK, -1
        if self._limit:
            with suppress(OSError):
                path.parent.mkdir(parents=True, exist_ok=True)
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
                fcntl.flock(descriptor, fcntl.LOCK_EX)
        try:
            yield
        finally:
            if descriptor >= 0:
                os.close(descriptor)


def members_at(place: Place, verify: str, cache: Path | str | None, limit: int) -> MemberBytes:
    """The members of shards at a place. Raises OutputError where `cache` is needed and cannot be written."""
    if isinstance(place, FolderPlace):
        return FolderMembers(place, verify)
    folder = Path(cache) if cache else user_cache(CACHE)
    if limit:
        try:
            require_writable(folder)
        except OutputError as error:
            hint = "it is to keep what is fetched: name another by cache, data.cache or XDG_CACHE_HOME, or keep " \
                   "nothing by a cache_size or data.cache_gb of 0"
            raise OutputError(replace(problem, hint=hint) for problem in error.problems) from error
    return FetchedMembers(place, folder, limit)


def _range(shard: ShardRecord, span: MemberSpan) -> ByteRange:
    return ByteRange(shard.tar_file, span.offset, span.size)


@contextmanager
def _told(wanted: Wanted, shard: ShardRecord | None = None) -> Iterator[None]:
    """Turn what a place says into a ShardError that names the shard, and the member where one is cut."""
    try:
        yield
    except EndedError as error:
        end = error.piece.start + error.there
        of, span = next((shard, span) for shard, span in wanted
                        if error.piece.name.endswith(shard.name) and span.offset + span.size > end)
        rule = f"expected {span.size} bytes, the file ends after {max(end - span.offset, 0)}"
        raise _wrong(of, span.name, rule) from error
    except OSError as error:
        raise _wrong(shard or wanted[0][0], "", f"cannot be read ({error.strerror or error})") from error


def _wrong(shard: ShardRecord, member: str, rule: str) -> ShardError:
    return ShardError([Problem(where=shard.name, path=member, rule=rule)])
