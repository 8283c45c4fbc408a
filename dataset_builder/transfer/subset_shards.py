"""Shards of chosen examples: their files are fetched by range, and put together as a build would have written them.

A shard that is wanted with all that it holds stays as it is, name included. Of all others, neighbours are put together
into shards of no more examples than the largest of their split has; each has the slot of the first that it is made of.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

from dataset_builder.digest import digest, sha256_bytes
from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.remote.place import ByteRange
from dataset_builder.shards.folder import INDEX, next_of
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.publish import published
from dataset_builder.shards.published_examples import as_own
from dataset_builder.shards.segment import BLOCK, end_blocks, header, padding, segment_size
from dataset_builder.shards.shard_index import ExampleRecord, MemberRecord, ShardIndex, ShardRecord
from dataset_builder.shards.writer import write_shard
from dataset_builder.transfer.choice import ChosenShard, members_wanted
from dataset_builder.transfer.fetching import Fetching
from dataset_builder.transfer.origin import TRIES

GAP = 4 * 2**10
"""Bytes between two wanted files that are fetched with them: headers and paddings, or a file that is smaller than what
a request costs."""

WINDOW = 64 * 2**20
"""Bytes of files that are in memory at a time, unless a single example has more."""

_Known = tuple[str, str, tuple[tuple[str, str], ...]]
"""Key, digest, and suffix and digest of the pixels of every file of an example."""


@dataclass(frozen=True, kw_only=True)
class ShardBatch:
    """Chosen examples that come into one shard."""

    slot: str
    split: str
    parts: tuple[ChosenShard, ...]

    @property
    def examples(self) -> int:
        """How many."""
        return sum(len(part.keys) for part in self.parts)


def batches(manifest: Manifest, chosen: Sequence[ChosenShard]) -> list[ShardBatch]:
    """Chosen examples of shards that are not wanted as they are, in the order of their shards."""
    found = list[ShardBatch]()
    for part in (part for part in chosen if not part.whole):
        split = part.shard.split
        most = max(shard.examples for shard in manifest.shards if shard.split == split)
        last = found[-1] if found and found[-1].split == split else None
        if last and last.examples + len(part.keys) <= most:
            found[-1] = ShardBatch(slot=last.slot, split=split, parts=(*last.parts, part))
        else:
            found.append(ShardBatch(slot=part.shard.slot, split=split, parts=(part,)))
    return found


class Assembly:
    """Makes the shard of a batch below `.build/next`."""

    def __init__(self, fetching: Fetching, layers: Sequence[str]):
        self._fetching, self._layers = fetching, tuple(layers)
        manifest = fetching.origin.manifest
        self._share = manifest.shared == "once"
        self._all = len(self._layers) == len(manifest.layers)

    def finished(self, batch: ShardBatch) -> ShardIndex | None:
        """The shard of an earlier run, where it waits or lies in its place; None where there is none that is whole."""
        folder, wanted = self._fetching.folder, list[object]()
        like = self._fetching.index(batch.parts[0].shard)
        for root in (next_of(folder), folder):
            for path in sorted((root / INDEX).glob(f"{batch.slot}-*.manifest")):
                wanted = wanted or list(self._wanted(batch))
                if (index := published(root, path.stem)) and _same(index, batch, wanted, like):
                    return index
        return None

    def make(self, batch: ShardBatch) -> ShardIndex:
        """The shard. Raises UserError where a file's bytes are again and again not those that its index states."""
        first = self._fetching.index(batch.parts[0].shard)
        records = list[ExampleRecord]()
        return write_shard(self._fetching.folder, slot=batch.slot, split=batch.split,
                           chunks=self._chunks(batch, records), records=records, spec_digest=first.spec_digest,
                           versions=first.versions)

    def _wanted(self, batch: ShardBatch) -> Iterator[_Known]:
        """Key, digest, and suffixes and digests of the pixels of every example, by which a finished shard is known."""
        return (_known(record.key, self._digest(record), self._members(record)) for _, record in self._records(batch))

    def _records(self, batch: ShardBatch) -> Iterator[tuple[ShardRecord, ExampleRecord]]:
        first = None
        for part in batch.parts:
            wanted, index = set(part.keys), self._fetching.index(part.shard)
            first = first or index
            if (index.spec_digest, index.versions) != (first.spec_digest, first.versions):
                rule = f"expected the spec and versions of {first.shard.name}, since both are of one split"
                raise ShardError([Problem(where=self._fetching.origin.place.title, path=part.shard.name, rule=rule)])
            yield from ((part.shard, example) for example in index.examples if example.key in wanted)

    def _members(self, example: ExampleRecord) -> list[MemberRecord]:
        return [example.members[number] for number in members_wanted(example, self._layers)]

    def _digest(self, example: ExampleRecord) -> str:
        """Of what the example was made from; another where layers are missing, so that no build takes it for whole."""
        return example.digest if self._all else digest([example.digest, list(self._layers)])

    def _chunks(self, batch: ShardBatch, records: list[ExampleRecord]) -> Iterator[bytes]:
        """The bytes of the shard; `records` fill with what its index says of each example."""
        end, known = 0, dict[tuple[str, str, str], MemberRecord]()
        for shard, examples in _windows(self._records(batch), self._members):
            payloads = self._payloads(shard, self._needed(examples, known))
            for example in examples:
                listed = list[MemberRecord]()
                for member in self._members(example):
                    same = known.get(_pixels(example, member)) if self._share and member.pixel_digest else None
                    if same is None:
                        data = as_own(member, payloads[member.name], example.key)
                        name = f"{example.key}.{member.suffix}"
                        same = MemberRecord(name=name, offset=end + BLOCK, size=len(data), sha256=sha256_bytes(data),
                                            pixel_digest=member.pixel_digest)
                        yield header(name, len(data)) + data + padding(len(data))
                        end += segment_size([len(data)])
                        known[_pixels(example, member)] = same
                    listed.append(same)
                records.append(example.model_copy(update={"digest": self._digest(example), "members": tuple(listed)}))
        yield end_blocks(end)

    def _needed(self, examples: Sequence[ExampleRecord],
                known: dict[tuple[str, str, str], MemberRecord]) -> list[MemberRecord]:
        """Files that must be fetched for some examples, in the order of their shard, each once."""
        found, coming = dict[str, MemberRecord](), set[tuple[str, str, str]]()
        for example in examples:
            for member in self._members(example):
                same = _pixels(example, member)
                if not (self._share and member.pixel_digest and (same in known or same in coming)):
                    found[member.name] = member
                    coming.add(same)
        return sorted(found.values(), key=lambda member: member.offset)

    def _payloads(self, shard: ShardRecord, members: Sequence[MemberRecord]) -> dict[str, bytes]:
        """Files by name, as their index has them; those that are wrong are fetched again, alone."""
        found, wrong = dict[str, bytes](), list(members)
        for _ in range(TRIES):
            found |= self._fetch(shard, wrong)
            wrong = [member for member in wrong if sha256_bytes(found[member.name]) != member.sha256]
            if not wrong:
                self._fetching.note(done=sum(member.size for member in members))
                return found
        raise UserError([Problem(where=self._fetching.origin.place.title, path=f"{shard.tar_file}: {member.name}",
                                 rule=f"expected SHA-256 {member.sha256}, its bytes differed {TRIES} times",
                                 hint="pull again, or tell whoever publishes it") for member in wrong])

    def _fetch(self, shard: ShardRecord, members: Sequence[MemberRecord]) -> dict[str, bytes]:
        spans = [ByteRange(shard.tar_file, member.offset, member.size) for member in members]
        return {member.name: data for member, data in zip(members, self._fetching.pieces(spans, GAP), strict=True)}


def _known(key: str, digest_: str, members: Iterable[MemberRecord]) -> _Known:
    return key, digest_, tuple((member.suffix, member.pixel_digest) for member in members)


def _same(index: ShardIndex, batch: ShardBatch, wanted: Sequence[object], like: ShardIndex) -> bool:
    """Whether a finished shard is what `Assembly.make` would make of a batch. like: the index of its first part."""
    found = [_known(example.key, example.digest, example.members) for example in index.examples]
    return (index.shard.slot, index.shard.split, index.spec_digest, index.versions) == (
        batch.slot, batch.split, like.spec_digest, like.versions) and found == wanted


def _pixels(example: ExampleRecord, member: MemberRecord) -> tuple[str, str, str]:
    return example.view, member.suffix, member.pixel_digest or member.name


def _windows(records: Iterable[tuple[ShardRecord, ExampleRecord]],
             members: Callable[[ExampleRecord], list[MemberRecord]],
             ) -> Iterator[tuple[ShardRecord, list[ExampleRecord]]]:
    """Neighbours of one shard that together have no more than `WINDOW` bytes."""
    for shard, group in groupby(records, key=itemgetter(0)):
        window, size = list[ExampleRecord](), 0
        for _, example in group:
            more = sum(member.size for member in members(example))
            if window and size + more > WINDOW:
                yield shard, window
                window, size = [], 0
            window.append(example)
            size += more
        yield shard, window
