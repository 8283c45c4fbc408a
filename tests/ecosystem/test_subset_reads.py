"""Chosen examples of a dataset, as Hugging Face datasets, webdataset and mlcroissant read them."""

from pathlib import Path

import pytest

from dataset_builder.transfer.choice import ExampleChoice
from dataset_builder.transfer.pull import pull

hugging_face = pytest.importorskip("datasets", reason="needs datasets, which brings pyarrow")
mlcroissant = pytest.importorskip("mlcroissant", reason="needs mlcroissant, which brings pandas")
webdataset = pytest.importorskip("webdataset", reason="needs webdataset")
FIELDS = {"i_s.exr", "mask.exr", "json", "preview.png"}


@pytest.mark.filterwarnings("ignore")
def test_others_read_a_subset(dataset: Path, tmp_path: Path) -> None:
    choice = ExampleChoice(split=("train",), layers=("i_s", "mask"), count=2)
    here = tmp_path / "here"
    pulled = pull(dataset, here, choice=choice)
    rows = list(hugging_face.load_dataset(str(here), split="train", streaming=True, cache_dir=str(tmp_path / "hf")))
    assert [row["__key__"] for row in rows] == ["00000000", "00000001"]
    assert all(set(row) - {"__key__", "__url__"} == FIELDS for row in rows)
    shard = here / "shards" / pulled.manifest.shards[0].name
    samples = list(webdataset.WebDataset([str(shard)], shardshuffle=False))
    assert [sample["i_s.exr"] for sample in samples] == [row["i_s.exr"] for row in rows]
    described = mlcroissant.Dataset(jsonld=str(here / "croissant.json"))
    assert not described.metadata.issues.errors
    assert [*described.records("splits")] == [{"splits/name": "train", "splits/examples": 2}]
