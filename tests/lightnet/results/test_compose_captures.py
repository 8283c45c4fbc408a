"""What of a capture is put into a frame: no more than shows of it."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dataset_builder.lightnet.results import compose_input
from dataset_builder.lightnet.results.compose_input import input_from_dataset


def test_a_field_is_not_drawn_over_what_stands_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """`mask_field` is that of the field alone; the rough mesh is hidden where furniture stands before it."""
    alone, rough = np.ones((12, 12, 1), np.float32), np.ones((12, 12, 1), np.float32)
    alone[:, 0], rough[-4:] = 0.5, 0
    grey = np.full((12, 12, 3), 0.5, np.float32)
    layers = {"i_s": grey, "s_prime": grey, "mask_field": alone, "mask_rough": rough, "i_t_empty": grey}

    class Stored:
        """A dataset of one example of a capture."""

        keys, splits = ("0",), {"train": ("0",)}

        def __getitem__(self, key: str) -> dict[str, np.ndarray]:
            return layers

        def label(self, key: str) -> dict:
            return {}

    extents = tuple(SimpleNamespace(name=name, extent="frame") for name in layers)
    monkeypatch.setattr(compose_input, "load_manifest", lambda folder: SimpleNamespace(layers=extents))
    monkeypatch.setattr(compose_input, "open_dataset", lambda folder, layers: Stored())
    monkeypatch.setattr(compose_input, "lighting_of", lambda label: None)
    found = input_from_dataset(Path("a"), key="0")
    assert not found.mask[-4:].any() and (found.mask[:-4, 0] == 0.5).all() and (found.mask[:-4, 1:] == 1).all()
