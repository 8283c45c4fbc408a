"""Examples of a published dataset by what they were made from, so that a build can take them over without rendering."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import ShardError
from dataset_builder.shards import exr
from dataset_builder.shards.example import Member
from dataset_builder.shards.folder import MANIFEST, read_claim
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleRecord, MemberRecord, ShardIndex, tagged
from dataset_builder.shards.staging import Staged, Staging
from dataset_builder.shards.structure import read_members
from dataset_builder.shards.writer import entry, index_path, shard_path


@dataclass(frozen=True)
class PublishedExamples:
    """The examples of the dataset in a folder; none where there is no dataset that can be read."""

    folder: Path

    @cached_property
    def _places(self) -> dict[str, tuple[str, ExampleRecord]]:
        """Stem of the shard and record of every example, by its digest."""
        found = dict[str, tuple[str, ExampleRecord]]()
        for stem in self._stems():
            try:
                index = from_json(ShardIndex, index_path(self.folder, stem).read_bytes(), where=stem)
            except (ShardError, OSError):
                continue
            # An index that was changed does not fit its name
            if index.shard.stem == stem and tagged(index, index.shard.slot).shard == index.shard:
                found |= {example.digest: (stem, example) for example in index.examples}
        return found

    def _stems(self) -> list[str]:
        """Stems of the shards that `dataset.json` lists, or, where it is damaged, that the folder's claim does."""
        try:
            manifest = from_json(Manifest, (self.folder / MANIFEST).read_bytes(), where=MANIFEST)
            return [shard.stem for shard in manifest.shards]
        except (ShardError, OSError):
            claim = read_claim(self.folder)
            return [Path(name).stem for name in (claim.files if claim else ()) if name.endswith(".manifest")]

    def __contains__(self, digest: str) -> bool:
        return digest in self._places

    @property
    def digests(self) -> frozenset[str]:
        """Of all of them."""
        return frozenset(self._places)

    def get(self, digest: str) -> Staged | None:
        """The example that is known by `digest` as it would be staged; None where there is none, or it is damaged."""
        if digest not in self._places:
            return None
        stem, example = self._places[digest]
        try:
            payloads = read_members(shard_path(self.folder, stem), example.members)
            files = list(zip(example.members, payloads, strict=True))
            if any(sha256_bytes(data) != record.sha256 for record, data in files):
                return None
            members = [Member(name=f"{example.key}.{record.suffix}", data=as_own(record, data, example.key),
                              pixel_digest=record.pixel_digest) for record, data in files]
        except (ShardError, OSError):
            return None
        made = entry(key=example.key, view=example.view, facts=example.facts, members=members)
        return Staged(segment=segment(members), entry=made)


def as_own(record: MemberRecord, data: bytes, key: str) -> bytes:
    """The file as example `key` has it alone: a layer that it shares is encoded again, with its key in the header."""
    if record.key == key or not record.suffix.endswith(".exr"):
        return data
    image = exr.read(data, where=record.name)
    return exr.encode(image.pixels, layer=image.layer, key=key, dtype=image.dtype)


@lru_cache(maxsize=2)
def published_in(folder: Path, replaces: str) -> PublishedExamples:
    """The dataset that a build finds in its folder, whose `dataset.json` has the digest `replaces`, read once by each
    process."""
    return PublishedExamples(folder)


def taken_over(key: str, digest: str, staging: Staging, published: PublishedExamples) -> bool:
    """Whether an example is staged, where it is published and not staged after this has staged it again."""
    if staging.has(key, digest):
        return True
    if (known := published.get(digest)) is None:
        return False
    staging.put(key, digest, known.segment, known.entry)
    return True
