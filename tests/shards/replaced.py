"""Datasets with other bytes in some of their files, whole by every size and hash: what a faulty writer would leave."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dataset_builder.shards import exr
from dataset_builder.shards.example import Member
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.manifest import from_json, with_shards
from dataset_builder.shards.one_writer import build_lock
from dataset_builder.shards.publish import publish_dataset
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.structure import read_member
from dataset_builder.shards.writer import entry, index_path, publish_shard, shard_path


def replace_members(folder: Path, files: Mapping[str, bytes]) -> None:
    """Give the members named in `files` other bytes; shards, indexes, sums and manifest are made anew around them."""
    manifest = load_manifest(folder)
    with build_lock(folder, Claim(name=manifest.name, version=manifest.version)):
        publish_dataset(folder, with_shards(manifest, [_remade(folder, shard, files) for shard in manifest.shards]))
        Staging(folder).clear()


def exr_of(pixels: np.ndarray, *, layer: str, key: str) -> bytes:
    """The file of a layer, whatever is in it: NaN is not refused."""
    return exr.compress(pixels.astype(np.float32), layer=layer, key=key, dtype="float32")


def _remade(folder: Path, shard: ShardRecord, files: Mapping[str, bytes]) -> ShardRecord:
    index = from_json(ShardIndex, index_path(folder, shard.stem).read_bytes(), where=shard.stem)
    tar, staging = shard_path(folder, shard.stem), Staging(folder)
    for example in index.examples:
        members = [Member(name=member.name, data=files.get(member.name) or read_member(tar, member),
                          pixel_digest=member.pixel_digest) for member in example.members]
        staging.put(example.key, example.digest, segment(members),
                    entry(key=example.key, view=example.view, facts=example.facts, members=members))
    return publish_shard(folder, slot=shard.slot, split=shard.split, spec_digest=index.spec_digest,
                         examples=[(example.key, example.digest) for example in index.examples],
                         versions=index.versions).shard
