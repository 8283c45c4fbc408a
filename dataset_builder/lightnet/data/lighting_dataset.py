"""The examples of one split, for training and evaluation: chosen layers, checked, and the light as labels tell it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Dataset

from dataset_builder.byte_store import GB
from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.lightnet.data.assemble import ExamplePart, lighting_of, whole
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.ranges import target_exposure
from dataset_builder.lightnet.data.truth import noise_layers, problem_of
from dataset_builder.lightnet.settings import DataSpec
from dataset_builder.remote.address import title_of
from dataset_builder.shards import reader
from dataset_builder.shards.reader import load_manifest

LAYERS = ("mask", "s_prime", "i_s", "d", "r", "i_t")
"""All that is read, in this order: the first two say how the others are seen. A dataset may hold more."""
PARTS = {"i_s_clean": "i_s"}
"""Layers that stand for another one."""
DIGITS = 6
"""Of the exposure, so that it is the same however many threads add up."""
OTHER_SPLIT = "name one of these: `data.train` or `data.held_out` of the training, or --split"
ONE_SPLIT = "to measure on other objects, add a split to the dataset and build it again"
NAMED = 5
"""Keys that a sentence names at most."""


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """What is kept of a label."""

    key: str
    level: int
    """Of noise."""
    cover: float
    """Largest mask."""
    lighting: np.ndarray
    """(3, 9), in the camera's frame."""


class LightingDataset(Dataset[Batch]):
    """Map-style: `len`, `keys` in order, `dataset[i]` a batch of one, whole and as it is, `label(i)`.

    Examples without a pixel whose mask is `spec.inside` or more are left out; `left_out` has their keys, and `notes` a
    sentence on them. Every label is read at once, so that what is wrong is told before a training begins.
    """

    def __init__(self, folder: Path | str, split: str, spec: DataSpec, *, levels: Sequence[int] = (),
                 i_s: str = "i_s", keys: Sequence[str] = (), extra: Sequence[str] = ()):
        """Open a finished dataset, in a folder or at an address. levels: noise levels to keep, all where empty. i_s:
        the layer that is I_s. keys: examples of the split to keep, all where empty. extra: layers among
        `assemble.EXTRA` that batches hold, too.

        Raises UserError where the dataset lacks a layer, the split, a level or every example, and where a label does
        not tell the light; ShardError where files are not what they were.
        """
        self.folder, self.split, self.spec = folder, split, spec
        self.extra = tuple(extra)
        layers = (*layers_with(i_s), *self.extra)
        require(self.folder, split, layers)
        self._data = opened(folder, layers, spec)
        self.name = self._data.manifest.name
        self.size = (self._data.manifest.height, self._data.manifest.width)
        """Height and width of every frame, in pixels."""
        there = self._data.splits[split]
        if keys and (missing := sorted({*keys} - {*there})):
            raise _wrong(self.folder, f"expected keys of examples in split {split}, got {missing[0]}")
        there = tuple(key for key in there if key in {*keys}) if keys else there
        entries = [_entry(label) for label in self._data.labels(there)]
        entries = _at_levels(self.folder, split, entries, levels)
        self._entries = [entry for entry in entries if entry.cover >= spec.inside]
        self.left_out = tuple(entry.key for entry in entries if entry.cover < spec.inside)
        self.keys = tuple(entry.key for entry in self._entries)
        self._exposures: dict[str, float] = {}
        if not self._entries:
            raise _wrong(self.folder, f"expected examples in split {split}, got none" + self._left_out(),
                         "lower `data.inside`" if self.left_out else "build it with more pairs or views")

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know about what is read, one sentence each."""
        left_out = (f"split {self.split}" + self._left_out(),) if self.left_out else ()
        return (*left_out, *self.in_common)

    @property
    def in_common(self) -> tuple[str, ...]:
        """What its split shares with others, one sentence each."""
        return tuple(one.sentence for one in self._data.manifest.in_common if self.split in one.splits)

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, index: int) -> Batch:
        """Example `index` alone, its whole frame, not varied. Raises IndexError, and ShardError as `part` does."""
        return whole(self.part(index))

    def label(self, index: int) -> ExampleLabel:
        """The whole label of an example, see `docs/label.md`; read anew."""
        return self._data.label(self.keys[index])

    def part(self, index: int) -> ExamplePart:
        """Example `index` as it is on the disk. Raises ShardError where its files are not what they were."""
        entry = self._entries[index]
        images = self._data.images(entry.key)
        (_, mask), (name, s_prime) = next(images), next(images)
        inside = mask.planes[0] >= self.spec.inside
        if not inside.any():
            raise ShardError([Problem(where=title_of(self.folder), path=entry.key, hint="build or download it again",
                                      rule=f"expected a mask of up to {entry.cover:g}, as its label says, got less")])
        if entry.key not in self._exposures:
            self._exposures[entry.key] = exposure_of(s_prime.planes, inside)
        layers = ((PARTS.get(name, name), image.planes) for name, image in chain([(name, s_prime)], images))
        return ExamplePart(key=entry.key, layers=layers, inside=inside, exposure=self._exposures[entry.key],
                           source_exposure=self.spec.source_exposure, lighting=entry.lighting, extra=self.extra)

    def fetch(self, indices: Iterable[int]) -> None:
        """Bring examples that are soon asked for into the cache, side by side, where they are at an address."""
        self._data.fetch(self.keys[index] for index in indices)

    def _left_out(self) -> str:
        if not self.left_out:
            return ""
        named = ", ".join(self.left_out[:NAMED]) + (", ..." if len(self.left_out) > NAMED else "")
        return (f": {len(self.left_out)} of {len(self.left_out) + len(self.keys)} examples left out because their mask "
                f"is below {self.spec.inside:g} everywhere: {named}")


def measured(folder: Path | str, split: str, data: DataSpec, levels: Sequence[int] = ()) -> LightingDataset:
    """The examples of a split to measure on, with the noise of their truth where it is known. Raises as
    `LightingDataset` does."""
    return LightingDataset(folder, split, data, levels=levels, extra=noise_layers(load_manifest(folder)))


def opened(folder: Path | str, layers: Sequence[str], spec: DataSpec, *, label: bool = True) -> reader.Dataset:
    """Some layers of a dataset, read as a training says."""
    return reader.open_dataset(folder, layers=layers, verify=spec.verify, label=label, cache=spec.cache or None,
                               cache_size=round(spec.cache_gb * GB))


def splits_of(folder: Path | str) -> tuple[str, ...]:
    """Names of the splits of a finished dataset that have examples. Raises UserError where there is none."""
    if names := tuple(split.name for split in load_manifest(folder).splits if split.examples):
        return names
    raise _wrong(folder, "expected examples, got a dataset without any")


def exposure_of(s_prime: np.ndarray, inside: np.ndarray) -> float:
    """Target exposure of an example: (3, H, W) S' over (H, W) inside, rounded so that it is the same everywhere.

    The mean luminance is the luminance of the mean colour, which is soon found.
    """
    light = s_prime.reshape(len(s_prime), -1).take(np.flatnonzero(inside), axis=1)
    colour = torch.from_numpy(light.mean(axis=1, dtype=np.float64))[:, None, None]
    exposure = float(target_exposure(colour, torch.ones_like(colour[:1])))
    return float(f"{exposure:.{DIGITS}g}")


def layers_with(i_s: str) -> tuple[str, ...]:
    """What is read, with the layer that is I_s."""
    return tuple(i_s if name == "i_s" else name for name in LAYERS)


def require(folder: Path | str, split: str, needed: Sequence[str] = LAYERS) -> None:
    """Raise UserError where a dataset lacks a layer to train on, or the split."""
    manifest = load_manifest(folder)
    layers, splits = [layer.name for layer in manifest.layers], [one.name for one in manifest.splits]
    lacking = problem_of(title_of(folder), layers, needed, "train on and to measure by")
    problems = [lacking] if lacking else []
    if split not in splits:
        rule = f"expected {split or 'one to measure on'}, got {', '.join(splits)}"
        problems.append(Problem(where=title_of(folder), path="splits", rule=rule,
                                hint=OTHER_SPLIT if len(splits) > 1 else ONE_SPLIT))
    if problems:
        raise UserError(problems)


def _entry(label: ExampleLabel) -> _Entry:
    return _Entry(key=label.key, level=label.plan.rough.level, cover=label.layers["mask"].max,
                  lighting=lighting_of(label))


def _at_levels(folder: Path | str, split: str, entries: list[_Entry], levels: Sequence[int]) -> list[_Entry]:
    there = sorted({entry.level for entry in entries})
    if missing := [level for level in levels if level not in there]:
        raise _wrong(folder, f"expected noise levels among {', '.join(map(str, there)) or 'none'} in split {split}, "
                     f"got {', '.join(map(str, missing))}")
    return [entry for entry in entries if not levels or entry.level in levels]


def _wrong(folder: Path | str, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=title_of(folder), path="", rule=rule, hint=hint)])
