"""webdataset reads shards as they are: locally, in several workers, over http."""

from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any

import pytest

from benchmarks._file_server import Quiet, serving
from tests.ecosystem.pages import Truth, assert_same, of_split, shards_of

webdataset = pytest.importorskip("webdataset", reason="needs webdataset")
pytestmark = [pytest.mark.filterwarnings("ignore:This DataLoader will create:UserWarning"),
              pytest.mark.filterwarnings("ignore:unclosed file.*[.]tar:ResourceWarning")]
"""More workers than processors are meant here; webdataset closes no shard."""


def paths(folder: Path, split: str) -> list[str]:
    return [str(folder / "shards" / name) for name in shards_of(folder, split)]


def samples(rows: Iterator[dict[str, Any]]) -> dict[str, dict[str, bytes]]:
    """Rows by key; a key that comes twice is an error."""
    found: dict[str, dict[str, bytes]] = {}
    for row in rows:
        assert row["__key__"] not in found
        found[row["__key__"]] = row
    return found


@pytest.mark.parametrize("split", ["train", "test"])
def test_one_process_reads_all_in_order(dataset: Path, truth: Truth, split: str) -> None:
    found = samples(webdataset.WebDataset(paths(dataset, split), shardshuffle=False))
    assert list(found) == sorted(of_split(truth, split))
    assert_same(found, of_split(truth, split))


def test_labels_are_ours(dataset: Path, truth: Truth) -> None:
    rows = webdataset.WebDataset(paths(dataset, "train"), shardshuffle=False).decode()
    assert {row["__key__"]: row["json"] for row in rows} == {
        key: example["meta"] for key, example in of_split(truth, "train").items()}


def test_workers_share_the_shards(dataset: Path, truth: Truth) -> None:
    """Two workers, no resampling: every example once."""
    loader = webdataset.WebLoader(webdataset.WebDataset(paths(dataset, "train"), shardshuffle=False, resampled=False),
                                  num_workers=2, batch_size=None)
    assert_same(samples(loader), of_split(truth, "train"))


def test_more_workers_than_shards(dataset: Path, truth: Truth) -> None:
    """An error as it comes, and every example once where idle workers are allowed."""
    urls = paths(dataset, "test")

    def loader(**options: Any) -> Any:
        return webdataset.WebLoader(webdataset.WebDataset(urls, shardshuffle=False, **options),
                                    num_workers=len(urls) + 1, batch_size=None)

    with pytest.raises(ValueError, match="No samples found"):
        list(loader())
    assert_same(samples(loader(empty_check=False)), of_split(truth, "test"))


@pytest.mark.skipif(which("curl") is None, reason="webdataset fetches with curl, which is not here")
def test_over_http(dataset: Path, truth: Truth) -> None:
    """A server without ranges will do: shards are read from end to end."""
    with serving(dataset, Quiet) as address:
        urls = [f"{address}/shards/{name}" for name in shards_of(dataset, "train")]
        assert_same(samples(webdataset.WebDataset(urls, shardshuffle=False)), of_split(truth, "train"))
