"""Readers refuse fewer examples than promised, however a manifest or a folder came to have fewer."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import ShardError
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.shards.folder import MANIFEST, SUMS
from dataset_builder.shards.reader import Verify, open_dataset
from tests.lightnet.synthetic import write_synthetic

STEM = "tiny-v1-train-000001"


def manifest_without_a_shard(content: dict[str, Any]) -> None:
    content["shards"] = [shard for shard in content["shards"] if STEM not in shard["name"]]


def and_without_it_in_the_totals(content: dict[str, Any]) -> None:
    manifest_without_a_shard(content)
    content["totals"]["examples"], content["totals"]["shards"] = 3, 2


def a_shard_of_another_split(content: dict[str, Any]) -> None:
    next(shard for shard in content["shards"] if STEM in shard["name"])["split"] = "test"


def fewer_in_a_split(content: dict[str, Any]) -> None:
    content["splits"][0]["examples"] -= 1


@pytest.mark.parametrize("verify", ["off", "size", "member", "shard"])
@pytest.mark.parametrize(("change", "rule"), [
    (manifest_without_a_shard, "expected 4 examples, the shards in dataset.json hold 3"),
    (and_without_it_in_the_totals, "expected 3 examples in split train, its shards hold 2"),
    (a_shard_of_another_split, "expected the index of 1 examples"),
    (fewer_in_a_split, "expected 2 examples in split train, its shards hold 3"),
])
def test_a_manifest_that_promises_other_than_its_shards_hold(dataset: Path, change: Callable[[dict[str, Any]], None],
                                                             rule: str, verify: Verify) -> None:
    before = (dataset / MANIFEST).read_bytes()
    content = json.loads(before)
    change(content)
    (dataset / MANIFEST).write_text(json.dumps(content))
    # Sums that fit, or they would be the reason
    sums, after = dataset / SUMS, sha256_bytes((dataset / MANIFEST).read_bytes())
    sums.write_text(sums.read_text().replace(sha256_bytes(before), after))
    with pytest.raises(ShardError, match=rule):
        open_dataset(dataset, verify=verify)


@pytest.mark.parametrize("kind", ["shards/*.tar", "index/*.manifest"])
def test_a_trainer_reads_no_subset_of_the_shards(tmp_path: Path, kind: str) -> None:
    """Nor a split whose own shards are all there."""
    write_synthetic(tmp_path / "made", train=2, held_out=1, size=16, levels=1)
    assert len(LightingDataset(tmp_path / "made", "evaluation", DataSpec(verify="off"))) == 1
    next(path for path in (tmp_path / "made").glob(kind) if "-train-" in path.name).unlink()
    for split in ("train", "evaluation"):
        with pytest.raises(ShardError, match="expected a file, found none"):
            LightingDataset(tmp_path / "made", split, DataSpec(verify="off"))
