"""The data that training reads: every example of both splits, as tensors, once."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import torch

from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.release.dataset_check import Check, Rule
from dataset_builder.shards.reader import load_manifest

LIGHTING = (3, 9)
"""Shape of an example's light: channels, spherical harmonics up to degree 2."""

COUNTED = Rule(name="counted", high=0, why="every example that the manifest lists must be there",
               statement="examples of both splits in the manifest that the loader neither loads nor lists as left out")
LEFT_OUT = Rule(name="left_out", high=0.05, why="such an object is too thin to learn from; a few are allowed",
                statement="share of examples without a pixel inside")
FINITE = Rule(name="finite", high=0, why="one NaN ends a training",
              statement="examples with a tensor that is not finite or light below 0")
INSIDE = Rule(name="inside", low=1, why="losses and metrics are means over these",
              statement="pixels inside, minimum over examples")
LIGHTED = Rule(name="lighting", high=0, why="it is the only target light that two baselines see",
               statement="examples whose light is not 3 x 9 finite numbers, or has no light on average")
RULES = (COUNTED, LEFT_OUT, FINITE, INSIDE, LIGHTED)


@dataclass(frozen=True, kw_only=True)
class Read:
    """What one example is like."""

    key: str
    finite: bool
    inside: int
    lighting: bool


def loader_checks(folder: Path, spec: DataSpec) -> list[Check]:
    """Every rule over both splits of a training. Raises UserError as `LightingDataset` and reading an example do."""
    sets = [LightingDataset(folder, split, spec) for split in (spec.train, spec.held_out)]
    start = perf_counter()
    found = [read(one[index]) for one in sets for index in range(len(one))]
    rate = len(found) / max(perf_counter() - start, 1e-9)
    left_out = [key for one in sets for key in one.left_out]
    thinnest = min(found, key=lambda one: one.inside)
    return [COUNTED.judge(listed(folder, (spec.train, spec.held_out)) - len(found) - len(left_out),
                          ", ".join(f"{one.split} {len(one)}" for one in sets) + f"; {rate:.0f} examples/s"),
            LEFT_OUT.judge(len(left_out) / (len(found) + len(left_out)), _named(left_out)),
            _count(FINITE, [one.key for one in found if not one.finite]),
            INSIDE.judge(thinnest.inside, f"example {thinnest.key}"),
            _count(LIGHTED, [one.key for one in found if not one.lighting])]


def listed(folder: Path, splits: Sequence[str]) -> int:
    """Examples that the manifest lists in some splits."""
    return sum(split.examples for split in load_manifest(folder).splits if split.name in splits)


def read(batch: Batch) -> Read:
    """What a batch of one is like."""
    inputs, truth = batch.inputs, batch.truth
    images = (inputs.i_s, inputs.s_prime, truth.i_t, truth.d, truth.r)
    lighting = tuple(inputs.sh.shape[1:]) == LIGHTING and bool(torch.isfinite(inputs.sh).all())
    return Read(key=batch.keys[0], inside=int(inputs.inside.sum()),
                finite=all(bool(torch.isfinite(image).all()) and bool((image >= 0).all()) for image in images),
                lighting=lighting and bool((inputs.sh[..., 0] > 0).all()))


def _count(rule: Rule, keys: Sequence[str]) -> Check:
    return rule.judge(len(keys), _named(keys))


def _named(keys: Sequence[str], most: int = 5) -> str:
    return ", ".join(keys[:most]) + (", ..." if len(keys) > most else "")
