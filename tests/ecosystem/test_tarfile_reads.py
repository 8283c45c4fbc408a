"""Python's tarfile with OpenEXR, as the first page has it, on every file of every shard; and GNU tar lists the same."""

import json
import subprocess
import tarfile
from pathlib import Path
from shutil import which

import pytest

from tests.ecosystem.pages import Truth, assert_same, of_split, shards_of


@pytest.mark.parametrize("split", ["train", "test"])
def test_every_layer_and_label(dataset: Path, truth: Truth, split: str) -> None:
    found: dict[str, dict[str, bytes]] = {}
    for name in shards_of(dataset, split):
        with tarfile.open(dataset / "shards" / name) as shard:
            for member in shard:
                key, _, suffix = member.name.partition(".")
                stream = shard.extractfile(member)
                assert stream is not None and suffix not in found.setdefault(key, {})
                found[key][suffix] = stream.read()
    assert_same(found, of_split(truth, split))
    assert all(json.loads(files["json"]) == truth[key]["meta"] for key, files in found.items())


@pytest.mark.skipif(which("tar") is None, reason="no tar here")
def test_tar_lists_the_same_files(dataset: Path) -> None:
    for path in (dataset / "shards").iterdir():
        listed = subprocess.run(["tar", "--list", "--file", str(path)], check=True, capture_output=True, text=True)
        with tarfile.open(path) as shard:
            assert listed.stdout.splitlines() == shard.getnames()
