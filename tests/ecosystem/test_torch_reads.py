"""PyTorch's DataLoader over our reader, and over tars as the dataset's card has it, with more workers than shards."""

import re
from pathlib import Path
from typing import Any

import pytest

from dataset_builder.shards.reader import open_dataset
from tests.ecosystem.pages import Truth, equal, of_split, shards_of

torch_data = pytest.importorskip("torch.utils.data", reason="needs PyTorch")
pytestmark = pytest.mark.filterwarnings("ignore:This DataLoader will create:UserWarning")


@pytest.mark.parametrize("extra", [0, 2])
def test_our_reader_gives_every_example_once(dataset: Path, truth: Truth, extra: int) -> None:
    """Single examples are dealt out, so that no worker idles for want of a shard."""
    ours, wanted = open_dataset(dataset, label=False), of_split(truth, "train")
    workers = len(shards_of(dataset, "train")) + extra if extra else 0
    loader = torch_data.DataLoader(ours, sampler=ours.splits["train"], batch_size=1, num_workers=workers)
    batches = [*loader]
    assert len(batches) == len(wanted)
    for key, batch in zip(ours.splits["train"], batches, strict=True):
        assert all(batch[name].numpy()[0].tobytes() == wanted[key][name].tobytes() for name in ours.layers)


def test_the_recipe_of_the_card(dataset: Path, truth: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole shards by worker: those without one give nothing, the others every example once."""
    monkeypatch.chdir(dataset.parent)
    # The card names the dataset's own folder
    (dataset.parent / "tiny").exists() or (dataset.parent / "tiny").symlink_to(dataset)
    card = re.findall(r"^```python\n(.*?)^```$", (dataset / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    for block in card[1:3]:
        exec(compile(block, "card", "exec"), names)
    wanted = of_split(truth, "train")
    loader = torch_data.DataLoader(names["Layers"](), batch_size=None, num_workers=len(names["shards"]) + 1)
    found = [(key, pixels.numpy()) for key, pixels in loader]
    assert sorted(key for key, _ in found) == sorted(wanted)
    layer = open_dataset(dataset).layers[0]
    assert all(equal(pixels, wanted[key][layer]) for key, pixels in found)
