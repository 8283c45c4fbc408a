"""Reading a dataset back: any example by key or position, any of its layers, straight from the shard by offset."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from dataset_builder.byte_store import CACHE_SIZE
from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.layers import LAYERS
from dataset_builder.remote.address import title_of
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.place import FolderPlace, Place
from dataset_builder.shards import exr
from dataset_builder.shards.example import LABEL
from dataset_builder.shards.label_text import parse_label, read_label
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.member_bytes import FetchedMembers, MemberBytes, MemberSpan, members_at, span_of
from dataset_builder.shards.open_indexes import load_manifest as load_manifest
from dataset_builder.shards.open_indexes import read_indexes, read_manifest
from dataset_builder.shards.shard_index import ExampleRecord, ShardRecord

Verify = Literal["off", "size", "shard", "member"]
AGAIN = "build or download the dataset again"
LABELS = 64
"""Labels that are fetched side by side."""


class _Home(NamedTuple):
    """Where an example lies. shard: position in the manifest; layers: spans of the chosen ones, in their order."""

    shard: int
    layers: tuple[MemberSpan, ...]
    label: MemberSpan


class Dataset:
    """A finished dataset: `len`, iteration in order, `dataset[key]`, `dataset[split, i]`; no file stays open."""

    def __init__(self, folder: Path | str, place: Place, manifest: Manifest, *, layers: Sequence[str], verify: Verify,
                 manifest_sha256: str, members: MemberBytes, label: bool = True):
        self.folder, self.manifest, self.layers = folder, manifest, tuple(layers)
        self._members, self._with_label = members, label
        indexes = read_indexes(place, manifest, verify=verify, manifest_sha256=manifest_sha256)
        self._homes = {example.key: self._home(number, example) for number, index in indexes
                       for example in index.examples}
        if len(self._homes) != manifest.totals.examples:
            rule = f"expected {manifest.totals.examples} examples, the indexes hold {len(self._homes)}"
            raise _wrong(place.title, rule)
        names = [shard.split for shard in manifest.shards]
        self.splits = {split.name: tuple(key for key, home in self._homes.items() if names[home.shard] == split.name)
                       for split in manifest.splits}
        """Keys of every split, in order."""
        for split in manifest.splits:
            if (got := len(self.splits[split.name])) != split.examples:
                rule = f"expected {split.examples} examples in split {split.name}, its shards hold {got}"
                raise _wrong(place.title, rule)

    def __len__(self) -> int:
        return len(self._homes)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[key] for key in self._homes)

    def __getitem__(self, which: str | tuple[str, int]) -> dict[str, Any]:
        """Chosen layers by name, (H, W, C) float32 each, and the label under `meta`, a dict, unless it was left out.

        Raises KeyError or IndexError where there is no such example, ShardError where its bytes are not what they were,
        a file is of another layer or example, or a pixel is NaN or Inf.
        """
        key = which if isinstance(which, str) else self.splits[which[0]][which[1]]
        home = self._homes[key]
        payloads = self._read(home, [*home.layers, home.label] if self._with_label else home.layers)
        images = self._decoded(home, payloads[:len(home.layers)])
        layers: dict[str, Any] = {name: image.pixels for name, image in images}
        return {**layers, "meta": self._plain(key, payloads[-1])} if self._with_label else layers

    def __contains__(self, key: object) -> bool:
        """Whether there is an example with this key."""
        return key in self._homes

    def images(self, key: str) -> Iterator[tuple[str, exr.ExrImage]]:
        """Chosen layers alone, in their order, as they are stored; each is decoded when its turn comes.

        Raises as `dataset[key]` does.
        """
        home = self._homes[key]
        yield from self._decoded(home, self._read(home, home.layers))

    def _decoded(self, home: _Home, payloads: Sequence[bytes]) -> Iterator[tuple[str, exr.ExrImage]]:
        most = exr.most_side(self.manifest.width, self.manifest.height)
        for name, span, data in zip(self.layers, home.layers, payloads, strict=True):
            image = exr.read(data, where=span.name, most=most)
            self._require_sound(image, name, home, span)
            yield name, image

    def label(self, key: str) -> ExampleLabel:
        """The label alone, typed. Raises KeyError, and ShardError as `dataset[key]` does and where it is damaged."""
        return next(self.labels([key]))

    def labels(self, keys: Iterable[str]) -> Iterator[ExampleLabel]:
        """The labels of some examples, in order, many of them fetched side by side. Raises as `label` does."""
        left = iter(keys)
        while some := list(islice(left, LABELS)):
            homes = [self._homes[key] for key in some]
            payloads = self._members.read([(self._shard(home), home.label) for home in homes])
            for key, home, data in zip(some, homes, payloads, strict=True):
                label = parse_label(data, where=self._shard(home).name, name=home.label.name)
                self._require_own(key, label.key)
                yield label

    def fetch(self, keys: Iterable[str]) -> None:
        """Bring the chosen layers of some examples into the cache, side by side; nothing for a folder. Raises as
        `dataset[key]` does."""
        if isinstance(self._members, FetchedMembers):
            homes = [self._homes[key] for key in keys]
            self._members.fetch([(self._shard(home), span) for home in homes for span in home.layers])

    def _plain(self, key: str, data: bytes) -> dict[str, Any]:
        home = self._homes[key]
        label = read_label(data, where=self._shard(home).name, name=home.label.name)
        self._require_own(key, label["key"])
        return label

    def _read(self, home: _Home, spans: Sequence[MemberSpan]) -> list[bytes]:
        shard = self._shard(home)
        return self._members.read([(shard, span) for span in spans])

    def _require_own(self, key: str, found: object) -> None:
        if found != key:
            home = self._homes[key]
            raise self._spoilt(home, home.label, f"expected the label of example {key}, got {found!r:.60}")

    def _shard(self, home: _Home) -> ShardRecord:
        return self.manifest.shards[home.shard]

    def _require_sound(self, image: exr.ExrImage, layer: str, home: _Home, span: MemberSpan) -> None:
        # The key of another example where the index says that this one shares its file
        key = span.name.partition(".")[0]
        if (image.layer, image.key) != (layer, key):
            rule = f"expected layer {layer} of example {key}, its header says {image.layer!r:.60} of {image.key!r:.60}"
            raise self._spoilt(home, span, rule)
        shape = (LAYERS[layer].channels, self.manifest.height, self.manifest.width)
        if (got := image.planes.shape) != shape:
            raise self._spoilt(home, span, f"expected channels, rows, columns {shape}, got {got}")
        finite = np.isfinite(image.planes)
        if not finite.all():
            bad = int(np.count_nonzero(~finite))
            raise self._spoilt(home, span, f"expected finite values, got {bad} that are NaN or Inf")

    def _spoilt(self, home: _Home, span: MemberSpan, rule: str) -> ShardError:
        return ShardError([Problem(where=self._shard(home).name, path=span.name, rule=rule, hint=AGAIN)])

    def _home(self, number: int, example: ExampleRecord) -> _Home:
        members = {member.suffix: member for member in example.members}
        suffixes = [*(f"{name}.exr" for name in self.layers), LABEL]
        if missing := [suffix for suffix in suffixes if suffix not in members]:
            raise _wrong(self.manifest.shards[number].name, f"expected a member {example.key}.{missing[0]}")
        *layers, label = (span_of(members[suffix]) for suffix in suffixes)
        return _Home(shard=number, layers=tuple(layers), label=label)


def open_dataset(folder: Path | str, *, layers: Sequence[str] | None = None, verify: Verify = "member",
                 label: bool = True, sha256: str = "", cache: Path | str | None = None,
                 cache_size: int = CACHE_SIZE) -> Dataset:
    """Open a finished dataset, in a folder or at an address; only `layers` (default: all) are ever read.

    label: whether an example has its label, under `meta`; arrays alone are what a DataLoader puts into batches.
    verify: `off` trusts the disk; `size` compares sizes of shards, and hashes of manifest and indexes, now; `member`
    also hashes each file of an example when it is first read, `shard` each whole shard. Raises ShardError where
    anything is missing, unfinished or changed: never are there fewer examples than the manifest says.
    sha256: that `dataset.json` must have; any where empty.
    cache, cache_size: for an address, the folder that keeps what was fetched (default: among the user's caches), which
    processes may share, and about how many bytes of it. Raises OutputError where it cannot be written.
    """
    if verify not in get_args(Verify):
        raise _wrong(title_of(folder), f"expected verify to be one of {', '.join(get_args(Verify))}, got {verify!r}")
    place = place_of(folder)
    manifest, found = read_manifest(place, sha256=sha256)
    names = [layer.name for layer in manifest.layers]
    layers = (layers,) if isinstance(layers, str) else names if layers is None else tuple(layers)
    if unknown := [name for name in layers if name not in names]:
        raise _wrong(place.title, f"expected layers among {', '.join(names)}, got {', '.join(unknown)}")
    if not isinstance(place, FolderPlace) and verify != "member":
        rule = f"expected verify to be member, since every file from an address is hashed, got {verify}"
        raise _wrong(place.title, rule)
    folder = place.folder if isinstance(place, FolderPlace) else folder
    members = members_at(place, verify, cache, cache_size)
    return Dataset(folder, place, manifest, layers=layers, verify=verify, label=label, manifest_sha256=found,
                   members=members)


def _wrong(where: str, rule: str) -> ShardError:
    return ShardError([Problem(where=where, path="", rule=rule)])
