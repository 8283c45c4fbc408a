"""What the pages tell users of other readers to type, and whether it gives the pixels that our reader gives."""

import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.layers import LAYERS
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.reader import Dataset

Truth = dict[str, dict[str, Any]]
PAGE = Path(__file__).parents[2] / "docs" / "reading.md"


def recipe_pixels() -> Callable[[bytes], np.ndarray]:
    """`pixels` of the page on reading, which needs nothing but OpenEXR."""
    names: dict[str, Any] = {}
    block = next(block for block in re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
                 if "def pixels(" in block)
    exec(compile(block.partition("\nshards = ")[0], str(PAGE), "exec"), names)
    return names["pixels"]  # type: ignore[no-any-return]


pixels = recipe_pixels()


def truth_of(dataset: Dataset) -> Truth:
    """Every example of a dataset by key."""
    return {key: dataset[key] for keys in dataset.splits.values() for key in keys}


def equal(got: np.ndarray, true: np.ndarray) -> bool:
    """Whether decoded pixels are, bit by bit, those of (H, W, C) float32; one channel may come as (H, W)."""
    return got.shape == (true.shape if true.shape[2] == 3 else true.shape[:2]) and bool(
        got.astype(np.float32).tobytes() == true.tobytes())


def assert_same(found: Mapping[str, Mapping[str, Any]], truth: Truth, suffix: str = ".exr") -> None:
    """Encoded layers, by key and name with `suffix`, are those of a dataset: the same keys, layers and pixels."""
    assert set(found) == set(truth)
    for key, layers in found.items():
        wanted = {name: layer for name, layer in truth[key].items() if name != "meta"}
        assert {name.removesuffix(suffix) for name in layers if name.endswith(suffix)} & set(LAYERS) == set(wanted)
        for name, layer in wanted.items():
            assert equal(pixels(layers[f"{name}{suffix}"]), layer), (key, name)


def of_split(truth: Truth, split: str) -> Truth:
    """Examples of one split."""
    return {key: example for key, example in truth.items() if example["meta"]["split"] == split}


def shards_of(folder: Path, split: str) -> list[str]:
    """Names of the shards of a split, as the manifest lists them."""
    manifest = Manifest.model_validate(json.loads((folder / "dataset.json").read_text()))
    return next(list(one.shards) for one in manifest.splits if one.name == split)
