"""What is found out about one shard, and what all shards must agree on: facts of each, and their merge."""

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from dataset_builder.byte_store import ByteStore
from dataset_builder.digest import digest, sealed, sha256_bytes, unsealed
from dataset_builder.errors import OutputError, Problem, ShardError
from dataset_builder.shards.folder import MANIFEST
from dataset_builder.shards.identities import SHARED, SHARED_LAYERS
from dataset_builder.shards.label_text import differences
from dataset_builder.shards.manifest import Manifest, from_json, to_json
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import read_small, tar_problems
from dataset_builder.shards.verify_examples import ExampleChecks
from dataset_builder.shards.verify_files import hash_of
from dataset_builder.shards.writer import index_path, shard_path

Depth = Literal["size", "shard", "member", "pixels"]
HALF = 32
"""Hexadecimal digits of a digest that are kept for each view: enough that two never agree by chance."""
_VIEW = np.dtype([("view", f"S{HALF}"), ("digests", f"S{HALF}"), ("key", "u4"), ("shard", "u4")])


@dataclass(frozen=True, kw_only=True)
class ShardFacts:
    """What is known of a shard that was looked at, and of its index."""

    tar: str | None = None
    """SHA-256 of the file; None where it was not asked for, or cannot be read."""
    index: str | None = None
    """Of the index."""
    problems: tuple[Problem, ...] = ()
    """In the order of the file."""
    keys: tuple[int, ...] = ()
    """Of its examples."""
    views: tuple[tuple[str, str, int], ...] = ()
    """Of every view a digest of its name, a digest of the layers that its examples share, and its first example."""
    label: tuple[str, dict[str, str]] | None = None
    """Key of the first example that has a readable label, and the structure of that label."""


@dataclass(frozen=True, kw_only=True)
class Known:
    """Facts that an earlier run found out. store: where; code: digest of the code that looks."""

    store: ByteStore
    code: str


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a dataset's shards are looked at; the same for all of them."""

    folder: Path
    manifest: Manifest
    depth: Depth
    known: Known | None = None

    def facts(self, shard: ShardRecord) -> ShardFacts:
        """Of one shard; those of an interrupted run where its files hold the same bytes as then."""
        tar, index = shard_path(self.folder, shard.stem), index_path(self.folder, shard.stem)
        problems = list(_size(tar, shard))
        if self.depth == "size":
            return ShardFacts(problems=tuple(problems))
        found = ShardFacts(tar=hash_of(tar, most=shard.bytes), index=hash_of(index))
        if tar.is_file() and found.tar not in (None, shard.sha256):
            problems.append(_problem(shard.name, "", f"expected SHA-256 {shard.sha256}, got {found.tar}"))
        if self.depth == "shard" or not index.is_file():
            return replace(found, problems=tuple(problems))
        key = self._key(shard, found) if self.known and found.tar and found.index else None
        if self.known and key and (kept := _kept(self.known.store.get(key))):
            return kept
        found = self._inside(shard, found, problems)
        if self.known and key:
            # Where the disk is full an interrupted run looks again
            with suppress(OutputError):
                self.known.store.put(key, sealed(asdict(found)))
        return found

    def _key(self, shard: ShardRecord, found: ShardFacts) -> str:
        assert self.known is not None
        rules = to_json(self.manifest.model_copy(update={"shards": ()}))
        return digest([self.depth, self.known.code, sha256_bytes(rules), shard.model_dump(mode="json"), found.tar,
                       found.index])

    def _inside(self, shard: ShardRecord, found: ShardFacts, problems: list[Problem]) -> ShardFacts:
        tar, index_file = shard_path(self.folder, shard.stem), index_path(self.folder, shard.stem)
        try:
            index = from_json(ShardIndex, read_small(index_file), where=index_file.name)
        except ShardError as error:
            return replace(found, problems=(*problems, *error.problems))
        problems += _index(index_file.name, index, shard)
        if not (tar.is_file() and os.access(tar, os.R_OK)):
            return replace(found, problems=tuple(problems))
        checks = ExampleChecks(self.manifest, tar, index)
        problems += [*tar_problems(tar, index), *checks.listed()]
        if self.depth == "pixels":
            problems += checks.contents()
        views = tuple((_half(view), _half("".join(digests.get(name, "-") for name in SHARED_LAYERS)), int(key))
                      for view, (key, digests) in checks.views.items())
        return replace(found, problems=tuple(problems), keys=tuple(int(example.key) for example in index.examples),
                       views=views, label=checks.label)


class AcrossShards:
    """What examples of different shards must agree on. A few dozen bytes are kept for each."""

    def __init__(self, manifest: Manifest):
        self._manifest = manifest
        self._keys: list[np.ndarray] = []
        self._views: list[np.ndarray] = []
        self._label: tuple[str, dict[str, str]] | None = None

    def add(self, number: int, facts: ShardFacts, times: int) -> Iterator[Problem]:
        """Take the facts of shard `number`, which the manifest lists `times` times; problems of its labels."""
        self._keys += [np.array(facts.keys, "u4")] * times
        rows = [(view.encode(), digests.encode(), key, number) for view, digests, key in facts.views]
        self._views.append(np.array(rows, _VIEW))
        if facts.label is None:
            return
        key, found = facts.label
        first, pattern = self._label = self._label or facts.label
        for difference in differences(pattern, found):
            yield _problem(self._manifest.shards[number].name, f"{key}.json", f"{difference}, unlike example {first}")

    def summary(self) -> Iterator[Problem]:
        """Problems that only all examples together have: keys used twice, rejected examples that are shipped, views
        whose layers differ from shard to shard."""
        keys, counts = np.unique(np.concatenate([np.zeros(0, "u4"), *self._keys]), return_counts=True)
        for key, count in zip(keys[counts > 1], counts[counts > 1], strict=True):
            yield _problem(MANIFEST, f"{key:08d}", f"expected each key once, got {count} examples")
        for item in self._manifest.rejected:
            if item.key.isdecimal() and np.isin(np.uint64(item.key), keys):
                yield _problem(MANIFEST, item.key, f"expected it to be left out, since it failed {item.gate}")
        yield from self._unshared()

    def _unshared(self) -> Iterator[Problem]:
        rows = np.concatenate([np.zeros(0, _VIEW), *self._views])
        if not len(rows):
            return
        rows = rows[np.argsort(rows["view"], kind="stable")]
        # Of every row the first one of its view
        starts = np.flatnonzero(np.concatenate([[True], rows["view"][1:] != rows["view"][:-1]]))
        first = np.repeat(starts, np.diff(np.append(starts, len(rows))))
        other = np.flatnonzero(rows["digests"] != rows["digests"][first])
        for at in other[np.lexsort((rows["key"][other], rows["shard"][other]))]:
            row = rows[at]
            yield _problem(self._manifest.shards[row["shard"]].name,
                           f"{row['key']:08d} and {rows['key'][first[at]]:08d}: {SHARED}",
                           f"expected the same pixels of {', '.join(SHARED_LAYERS)} in every example of the view")


def _kept(data: bytes | None) -> ShardFacts | None:
    content: dict[str, Any] | None = unsealed(data) if data else None
    if content is None:
        return None
    label = content["label"]
    return ShardFacts(tar=content["tar"], index=content["index"], keys=tuple(content["keys"]),
                      problems=tuple(Problem(**problem) for problem in content["problems"]),
                      views=tuple((view, digests, key) for view, digests, key in content["views"]),
                      label=(label[0], label[1]) if label else None)


def _half(text: str) -> str:
    return sha256_bytes(text.encode())[:HALF]


def _size(tar: Path, shard: ShardRecord) -> Iterator[Problem]:
    if tar.is_file() and (size := tar.stat().st_size) != shard.bytes:
        yield _problem(shard.name, "", f"expected {shard.bytes} bytes, got {size}")


def _index(name: str, index: ShardIndex, shard: ShardRecord) -> Iterator[Problem]:
    keys: Sequence[str] = [example.key for example in index.examples]
    if index.shard != shard:
        yield _problem(name, "shard", f"expected what {MANIFEST} says of {shard.name}")
    if len(keys) != shard.examples:
        yield _problem(name, "examples", f"expected {shard.examples}, got {len(keys)}")
    if keys != sorted(set(keys)):
        yield _problem(name, "examples", "expected keys in order, each once")
    ends = f"{shard.first_key} to {shard.last_key}"
    if keys and ends != (got := f"{keys[0]} to {keys[-1]}"):
        yield _problem(name, "examples", f"expected keys {ends}, got {got}")


def _problem(where: str, path: str, rule: str) -> Problem:
    return Problem(where=where, path=path, rule=rule)
