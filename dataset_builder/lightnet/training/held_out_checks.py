"""Checks on held-out examples while a training runs: mean figures, and what the noise of the truth does to them."""

from collections.abc import Sequence
from dataclasses import asdict

import torch

from dataset_builder.lightnet.data import loader
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.measures.metrics import Metrics, mean_metrics, measure
from dataset_builder.lightnet.measures.truth_noise import noise_of
from dataset_builder.lightnet.methods.method import Method, Precision, predict
from dataset_builder.spread import spread_indices

Figures = dict[str, float]
"""Means by the names of `METRICS`."""


class HeldOutChecks:
    """The same examples at every check; what a perfect prediction would get is found once."""

    def __init__(self, dataset: LightingDataset, examples: int):
        """examples: how many, spread evenly; 0 is all."""
        self._dataset, self._indices = dataset, spread_indices(len(dataset), examples)
        self._ceilings: dict[int, Metrics] = {}

    def __len__(self) -> int:
        return len(self._indices)

    def measure(self, method: Method, precision: Precision, device: torch.device) -> dict[str, Figures]:
        """Mean `metrics`; `corrected`, estimated against truth without noise, and the `ceiling`, both empty where
        nobody knows the noise. Raises ShardError as reading does."""
        metrics, corrected = list[Metrics](), list[Metrics]()
        for index, whole in zip(self._indices, loader.whole_images(self._dataset, self._indices), strict=True):
            batch = whole.to(device)
            found = predict(method, batch.inputs, precision).i_t
            metrics += measure(found, batch.truth.i_t, batch.inputs.inside)
            if (noise := noise_of(batch)) is not None:
                corrected.append(noise.corrected(found))
                if index not in self._ceilings:
                    self._ceilings[index] = noise.ceiling
        return {"metrics": _means(metrics), "corrected": _means(corrected),
                "ceiling": _means(list(self._ceilings.values()))}


def _means(found: Sequence[Metrics]) -> Figures:
    return asdict(mean_metrics(found)) if found else {}
