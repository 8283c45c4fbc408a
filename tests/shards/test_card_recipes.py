"""The recipes of every card run on a built dataset, beside whose folder they are typed."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dataset_builder.layers import LAYERS
from dataset_builder.shards.card import card
from dataset_builder.shards.card_text import PLAIN, plain
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.reader import load_manifest
from tests.shards.tiny_dataset import default_examples

NEEDED = {1: "OpenEXR", 2: "torch", 3: "webdataset", 4: "datasets.arrow_dataset"}
"""The last is in no extra: with pyarrow and pandas it takes some 250 MB."""
PAGE = Path(__file__).parents[2] / "docs" / "layers.md"


def recipes(folder: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```$", (folder / "README.md").read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("number", range(5))
@pytest.mark.filterwarnings("ignore")
def test_recipes_run(dataset: Path, number: int, monkeypatch: pytest.MonkeyPatch,
                     capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Each after those that it builds on: `pixels`, and the list of shards."""
    blocks = recipes(dataset)
    assert len(blocks) == 5
    pytest.importorskip(NEEDED.get(number, "dataset_builder"), reason=f"needs {NEEDED.get(number)}")
    monkeypatch.chdir(dataset.parent)
    monkeypatch.setenv("HF_HOME", str(tmp_path / "hf"))
    names: dict[str, Any] = {}
    before = {0: (), 1: (), 2: (1,), 3: (1, 2), 4: (1,)}[number]
    for block in [*(blocks[one] for one in before), blocks[number]]:
        said = exec(compile(block, "card", "exec"), names) or capsys.readouterr().out
    truth = default_examples()[0].layers["i_s"]
    if number == 0:
        assert np.array_equal(names["example"]["i_s"], truth)
    elif number == 1:
        assert np.array_equal(names["image"], truth) and names["label"]["key"] == "00000000"
    else:
        shape = {2: "torch.Size([3, 6, 8, 3])", 3: "(6, 8, 3) 00000002", 4: "(6, 8, 3) 00000002"}[number]
        assert shape in said and said.count("00000003") == 0
    if number == 2:
        shares = []
        for worker, count in ((0, 3), (1, 3), (2, 3), (0, 1)):
            names["get_worker_info"] = lambda share=worker, all=count: SimpleNamespace(id=share, num_workers=all)
            shares.append(list(names["Layers"]()))
        keys = [[int(key) for key, _ in share] for share in shares]
        assert keys == [[0, 1], [2], [], [0, 1, 2]] and all(len(key) == 8 for key, _ in shares[3])
        assert np.array_equal(shares[1][0][1], default_examples()[2].layers["i_s"])


def test_every_layer_has_plain_words_and_the_page_has_the_same() -> None:
    bare = [name for name, layer in LAYERS.items() if not layer.of]
    assert list(PLAIN) == bare and all(plain(name) for name in LAYERS)
    section = PAGE.read_text().partition("## In plain words")[2].partition("## ")[0]
    assert dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \| [^|]+ \|$", section, re.MULTILINE)) == PLAIN


def changed(manifest: Manifest, **layer: str) -> Manifest:
    return manifest.model_copy(update={"layers": tuple(one.model_copy(update=layer) for one in manifest.layers)})


def test_pitfalls_are_those_of_this_dataset(dataset: Path) -> None:
    manifest = load_manifest(dataset)
    text = card(manifest)
    assert "`s_prime` is not `i_t / d`" in text and "No layer is denoised" in text and "float32, seven digits" in text
    assert "`d`, `r`, `s_prime`, `mask` hold the object's pixels alone" in text
    assert "| `i_t` | the object under the lamps of the scene: what is to be predicted | grainy: light was" in text
    assert "| `mask` | how much of each pixel the object covers | at outlines and textures alone |" in text
    half = card(changed(manifest, dtype="float16", extent="frame"))
    assert "Half precision" in half and "hold the object's pixels alone" not in half
    bare = card(manifest.model_copy(update={"layers": manifest.layers[1:2]}))
    assert "is not `i_t / d`" not in bare and "denoised" not in bare
