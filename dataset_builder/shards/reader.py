"""Reading a dataset back: any example by key or position, any of its layers, straight from the shard by offset."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from dataset_builder.digest import sha256_bytes, sha256_file
from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards import exr
from dataset_builder.shards.folder import MANIFEST
from dataset_builder.shards.manifest import ExampleRecord, Manifest, ShardIndex, ShardRecord, from_json
from dataset_builder.shards.structure import read_member
from dataset_builder.shards.writer import index_path, shard_path

Verify = Literal["off", "size", "shard", "member"]


@dataclass(frozen=True, kw_only=True)
class _Place:
    shard: ShardRecord
    example: ExampleRecord


class Dataset:
    """A dataset on disk: `len`, iteration in order, `dataset[key]`, `dataset[split, i]`; no file stays open."""

    def __init__(self, folder: Path, manifest: Manifest, *, layers: Sequence[str], verify: Verify):
        self.folder, self.manifest, self.layers = folder, manifest, tuple(layers)
        self._verify = verify
        self._checked: set[str] = set()
        self._places = {example.key: _Place(shard=shard, example=example)
                        for shard in manifest.shards for example in self._index(shard).examples}
        if len(self._places) != manifest.totals.examples:
            raise _wrong(folder, f"expected {manifest.totals.examples} examples, the indexes hold {len(self._places)}")
        self.splits = {split.name: tuple(key for key, place in self._places.items() if place.shard.split == split.name)
                       for split in manifest.splits}
        """Keys of every split, in order."""

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[key] for key in self._places)

    def __getitem__(self, which: str | tuple[str, int]) -> dict[str, Any]:
        """Chosen layers by name, (H, W, C) float32 each, and the label under `meta`.

        Raises KeyError or IndexError where there is no such example, ShardError where its bytes are not what they were.
        """
        place = self._places[which if isinstance(which, str) else self.splits[which[0]][which[1]]]
        if self._verify == "shard":
            self._check_shard(place.shard)
        example: dict[str, Any] = {}
        for name in self.layers:
            example[name] = exr.decode(self._bytes(place, f"{name}.exr"), where=f"{place.example.key}.{name}.exr")
        return {**example, "meta": json.loads(self._bytes(place, "json"))}

    def _bytes(self, place: _Place, suffix: str) -> bytes:
        name = f"{place.example.key}.{suffix}"
        member = next((member for member in place.example.members if member.name == name), None)
        if member is None:
            raise _wrong(place.shard.name, f"expected a member {name}")
        data = read_member(shard_path(self.folder, place.shard.stem), member)
        if self._verify == "member" and sha256_bytes(data) != member.sha256:
            raise _wrong(place.shard.name, f"expected SHA-256 {member.sha256} of {name}, its bytes differ")
        return data

    def _index(self, shard: ShardRecord) -> ShardIndex:
        path, tar = index_path(self.folder, shard.stem), shard_path(self.folder, shard.stem)
        if not path.is_file() or not tar.is_file():
            raise _wrong(path if tar.is_file() else tar, "expected a file, found none")
        index = from_json(ShardIndex, path.read_bytes(), where=str(path))
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


def open_dataset(folder: Path | str, *, layers: Sequence[str] | None = None, verify: Verify = "size") -> Dataset:
    """Open a finished dataset; only `layers` (default: all) are ever read.

    verify: `off` trusts the disk; `size` compares file sizes now; `shard` also hashes each shard at its first use;
    `member` also hashes every member that is read. Raises ShardError where anything is missing, unfinished or changed:
    never are there fewer examples than the manifest says.
    """
    folder = Path(folder)
    manifest = load_manifest(folder)
    names = [layer.name for layer in manifest.layers]
    if unknown := [name for name in layers or () if name not in names]:
        raise _wrong(folder, f"expected layers among {', '.join(names)}, got {', '.join(unknown)}")
    return Dataset(folder, manifest, layers=names if layers is None else layers, verify=verify)


def load_manifest(folder: Path) -> Manifest:
    """The manifest of a finished dataset. Raises ShardError where there is none, or it breaks its schema."""
    path = folder / MANIFEST
    if not path.is_file():
        problem = Problem(where=str(folder), path=MANIFEST, rule="expected a finished dataset, found no such file",
                          hint="a build writes it last: run it to its end")
        raise ShardError([problem])
    return from_json(Manifest, path.read_bytes(), where=str(path))


def _wrong(where: Path | str, rule: str) -> ShardError:
    return ShardError([Problem(where=str(where), path="", rule=rule)])
