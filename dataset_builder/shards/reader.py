"""Reading a dataset back: any example by key or position, any of its layers, straight from the shard by offset."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypedDict, get_args

import numpy as np

from dataset_builder.digest import sha256_bytes, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.layers import LAYERS
from dataset_builder.shards import exr
from dataset_builder.shards.example import LABEL
from dataset_builder.shards.folder import MANIFEST, SUMS, placed
from dataset_builder.shards.label_text import parse_label, read_label
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.shards.publish import sums_in
from dataset_builder.shards.shard_index import ExampleRecord, MemberRecord, ShardIndex, ShardRecord
from dataset_builder.shards.structure import read_members, read_small
from dataset_builder.shards.writer import index_path, shard_path

Verify = Literal["off", "size", "shard", "member"]
AGAIN = "build or download the dataset again"


class _Place(NamedTuple):
    """Where an example lies. shard: position in the manifest; layers: spans of the chosen ones, in their order.

    Spans are plain tuples, so that a dataset of many examples is soon handed to another process.
    """

    shard: int
    layers: tuple["_Span", ...]
    label: "_Span"


class _Span(NamedTuple):
    name: str
    offset: int
    size: int
    sha256: str


class _LabelFile(TypedDict):
    """Bytes of a label, and the shard and file that they are from."""

    data: bytes
    where: str
    name: str


class Dataset:
    """A dataset on disk: `len`, iteration in order, `dataset[key]`, `dataset[split, i]`; no file stays open."""

    def __init__(self, folder: Path, manifest: Manifest, *, layers: Sequence[str], verify: Verify,
                 label: bool = True):
        self.folder, self.manifest, self.layers = folder, manifest, tuple(layers)
        self._verify, self._with_label = verify, label
        self._checked: set[str] = set()
        if len({shard.name for shard in manifest.shards}) < len(manifest.shards):
            raise _wrong(folder, f"expected different shards in {MANIFEST}, got one twice")
        found = {example.key: (number, example) for number, shard in enumerate(manifest.shards)
                 for example in self._index(shard).examples}
        if len(found) != manifest.totals.examples:
            raise _wrong(folder, f"expected {manifest.totals.examples} examples, the indexes hold {len(found)}")
        self._places = {key: self._place(number, example) for key, (number, example) in found.items()}
        names = [shard.split for shard in manifest.shards]
        self.splits = {split.name: tuple(key for key, place in self._places.items() if names[place.shard] == split.name)
                       for split in manifest.splits}
        """Keys of every split, in order."""
        for split in manifest.splits:
            if (got := len(self.splits[split.name])) != split.examples:
                raise _wrong(folder, f"expected {split.examples} examples in split {split.name}, its shards hold {got}")
        if verify != "off":
            self._require_sums()

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[key] for key in self._places)

    def __getitem__(self, which: str | tuple[str, int]) -> dict[str, Any]:
        """Chosen layers by name, (H, W, C) float32 each, and the label under `meta`, a dict, unless it was left out.

        Raises KeyError or IndexError where there is no such example, ShardError where its bytes are not what they were,
        a file is of another layer or example, or a pixel is NaN or Inf.
        """
        key = which if isinstance(which, str) else self.splits[which[0]][which[1]]
        layers = {name: image.pixels for name, image in self.images(key)}
        return {**layers, "meta": self._plain(key)} if self._with_label else layers

    def __contains__(self, key: object) -> bool:
        """Whether there is an example with this key."""
        return key in self._places

    def images(self, key: str) -> Iterator[tuple[str, exr.ExrImage]]:
        """Chosen layers alone, in their order, as they are stored; each is decoded when its turn comes.

        Raises as `dataset[key]` does.
        """
        place, most = self._places[key], exr.most_side(self.manifest.width, self.manifest.height)
        for name, span, data in zip(self.layers, place.layers, self._read(place, place.layers), strict=True):
            image = exr.read(data, where=span.name, most=most)
            self._require_sound(image, name, place, span)
            yield name, image

    def label(self, key: str) -> ExampleLabel:
        """The label alone, typed. Raises KeyError, and ShardError as `dataset[key]` does and where it is damaged."""
        label = parse_label(**self._label_file(key))
        self._require_own(key, label.key)
        return label

    def _plain(self, key: str) -> dict[str, Any]:
        label = read_label(**self._label_file(key))
        self._require_own(key, label["key"])
        return label

    def _label_file(self, key: str) -> _LabelFile:
        place = self._places[key]
        return {"data": self._read(place, [place.label])[0], "where": self._shard(place).name, "name": place.label.name}

    def _require_own(self, key: str, found: object) -> None:
        if found != key:
            place = self._places[key]
            raise self._spoilt(place, place.label, f"expected the label of example {key}, got {found!r:.60}")

    def _shard(self, place: _Place) -> ShardRecord:
        return self.manifest.shards[place.shard]

    def _read(self, place: _Place, spans: Sequence[_Span]) -> list[bytes]:
        shard = self._shard(place)
        if self._verify == "shard":
            self._check_shard(shard)
        payloads = read_members(shard_path(self.folder, shard.stem), spans)
        if self._verify == "member":
            for span, data in zip(spans, payloads, strict=True):
                if span.name not in self._checked and sha256_bytes(data) != span.sha256:
                    raise _wrong(shard.name, f"expected SHA-256 {span.sha256} of {span.name}, its bytes differ")
                self._checked.add(span.name)
        return payloads

    def _require_sums(self) -> None:
        """`dataset.json` and the indexes, which say where everything is, are those that were published."""
        listed = dict(filter(None, sums_in(read_small(placed(self.folder, SUMS)))))
        indexes = [index_path(Path(), shard.stem).as_posix() for shard in self.manifest.shards]
        for name in (MANIFEST, *indexes):
            if (got := sha256_file(self.folder / name)) != listed.get(name):
                raise _wrong(self.folder / name, f"expected SHA-256 {listed.get(name)} ({SUMS}), got {got}")

    def _require_sound(self, image: exr.ExrImage, layer: str, place: _Place, span: _Span) -> None:
        # The key of another example where the index says that this one shares its file
        key = span.name.partition(".")[0]
        if (image.layer, image.key) != (layer, key):
            rule = f"expected layer {layer} of example {key}, its header says {image.layer!r:.60} of {image.key!r:.60}"
            raise self._spoilt(place, span, rule)
        shape = (LAYERS[layer].channels, self.manifest.height, self.manifest.width)
        if (got := image.planes.shape) != shape:
            raise self._spoilt(place, span, f"expected channels, rows, columns {shape}, got {got}")
        finite = np.isfinite(image.planes)
        if not finite.all():
            bad = int(np.count_nonzero(~finite))
            raise self._spoilt(place, span, f"expected finite values, got {bad} that are NaN or Inf")

    def _spoilt(self, place: _Place, span: _Span, rule: str) -> ShardError:
        return ShardError([Problem(where=self._shard(place).name, path=span.name, rule=rule, hint=AGAIN)])

    def _place(self, number: int, example: ExampleRecord) -> _Place:
        members = {member.suffix: member for member in example.members}
        suffixes = [*(f"{name}.exr" for name in self.layers), LABEL]
        if missing := [suffix for suffix in suffixes if suffix not in members]:
            raise _wrong(self.manifest.shards[number].name, f"expected a member {example.key}.{missing[0]}")
        *layers, label = (_span(members[suffix]) for suffix in suffixes)
        return _Place(shard=number, layers=tuple(layers), label=label)

    def _index(self, shard: ShardRecord) -> ShardIndex:
        path, tar = index_path(self.folder, shard.stem), shard_path(self.folder, shard.stem)
        if not path.is_file() or not tar.is_file():
            raise _wrong(path if tar.is_file() else tar, "expected a file, found none")
        index = from_json(ShardIndex, read_small(path), where=str(path))
        if index.shard != shard or len(index.examples) != shard.examples:
            raise _wrong(path, f"expected the index of {shard.examples} examples that {MANIFEST} names")
        if self._verify != "off" and tar.stat().st_size != shard.bytes:
            raise _wrong(tar, f"expected {shard.bytes} bytes, got {tar.stat().st_size}")
        return index

    def _check_shard(self, shard: ShardRecord) -> None:
        if shard.name not in self._checked:
            if sha256_file(shard_path(self.folder, shard.stem)) != shard.sha256:
                raise _wrong(shard.name, f"expected SHA-256 {shard.sha256}, its bytes differ")
            self._checked.add(shard.name)


def open_dataset(folder: Path | str, *, layers: Sequence[str] | None = None, verify: Verify = "member",
                 label: bool = True) -> Dataset:
    """Open a finished dataset; only `layers` (default: all) are ever read.

    label: whether an example has its label, under `meta`; arrays alone are what a DataLoader puts into batches.
    verify: `off` trusts the disk; `size` compares sizes of shards, and hashes of manifest and indexes, now; `member`
    also hashes each file of an example when it is first read, `shard` each whole shard. Raises ShardError where
    anything is missing, unfinished or changed: never are there fewer examples than the manifest says.
    """
    folder = Path(folder)
    if verify not in get_args(Verify):
        raise _wrong(folder, f"expected verify to be one of {', '.join(get_args(Verify))}, got {verify!r}")
    manifest = load_manifest(folder)
    names = [layer.name for layer in manifest.layers]
    layers = (layers,) if isinstance(layers, str) else names if layers is None else tuple(layers)
    if unknown := [name for name in layers if name not in names]:
        raise _wrong(folder, f"expected layers among {', '.join(names)}, got {', '.join(unknown)}")
    return Dataset(folder, manifest, layers=layers, verify=verify, label=label)


def load_manifest(folder: Path) -> Manifest:
    """The manifest of a finished dataset. Raises ShardError where there is none, or it breaks its schema."""
    path = folder / MANIFEST
    if not path.is_file():
        problem = Problem(where=str(folder), path=MANIFEST, rule="expected a finished dataset, found no such file",
                          hint="a build writes it last: let the build finish")
        raise ShardError([problem])
    return from_json(Manifest, read_small(path), where=str(path))


def _span(member: MemberRecord) -> _Span:
    return _Span(name=member.name, offset=member.offset, size=member.size, sha256=member.sha256)


def _wrong(where: Path | str, rule: str) -> ShardError:
    return ShardError([Problem(where=str(where), path="", rule=rule)])
