"""The study: one spec, whose training split is rendered in several ways and whose held-out split is rendered well."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any

from dataset_builder.errors import Problem, UserError
from dataset_builder.layers import PAPER_LAYERS
from dataset_builder.lightnet.data.truth import problem_of
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.planning.catalogue import examples, pairs_of
from dataset_builder.rendering import oidn
from dataset_builder.spec.dataset import DatasetSpec, SplitSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.studies.budget.arms import PLAIN, Mix, even, mixes_of
from dataset_builder.studies.trainings import settings_of


@dataclass(frozen=True, kw_only=True)
class StudySize:
    """How much a study looks at."""

    grid: tuple[int, ...] = (4, 16, 64, 256)
    """Samples per pixel, two or more, rising; multiples of the spec's batches."""
    budgets: tuple[float, ...]
    """In units of the smallest one, rising."""
    least: int
    """Examples at the largest spp that the smallest budget buys."""
    timed: int
    """Examples on which costs are measured."""
    held_out: int
    """Examples to measure on, of as many pairs of object and scene as there are."""
    clean: int
    """Their spp."""
    seeds: int
    side: int = 0
    """Of pictures, in pixels; 0 is as the spec has them."""
    training: tuple[str, ...] = ()
    """Overrides of LighTNet's configuration where the user gives none."""

    @property
    def base(self) -> int:
        """The spp at which one pass at a time gets those of the next."""
        return self.grid[(len(self.grid) - 1) // 2]


SIZES = {
    "small": StudySize(budgets=(1, 3), least=12, timed=2, held_out=24, clean=512, seeds=2, side=64,
                       training=("model.width=8", "data={crop: 48, workers: 0}", "steps=150", "objective.l1=1")),
    "full": StudySize(budgets=(1, 3, 9), least=48, timed=8, held_out=96, clean=1024, seeds=3,
                      training=("objective.l1=1",)),
}


@dataclass(frozen=True, kw_only=True)
class BudgetStudy:
    """What to study."""

    spec: Path
    overrides: tuple[str, ...]
    size: StudySize
    training: TrainingSpec
    """LighTNet, made by `studies.trainings.base_of`."""
    out: Path
    backend: str = "auto"
    workers: int | None = None
    """Processes that render, or train on a processor; None for one per core."""
    device: str = "auto"
    denoise: bool = True
    """Whether denoised arms are compared, too."""

    @cached_property
    def loaded(self) -> LoadedSpec:
        """The spec, with pictures of the study's size unless the user asks for others. Raises SpecError."""
        side = self.size.side
        image = (f"image={json.dumps({'width': side, 'height': side})}",) if side else ()
        return load_dataset(self.spec, (*image, *self.overrides))

    @property
    def dataset(self) -> DatasetSpec:
        """What the spec says."""
        return self.loaded.dataset

    @property
    def mixes(self) -> tuple[Mix, ...]:
        """Ways to render an example."""
        return mixes_of(self.size.grid, self.size.base, denoise=self.denoise)

    @property
    def noisy(self) -> tuple[Mix, ...]:
        """Those of low and middle spp, with whose examples losses that expect noise are tried, too."""
        return tuple(map(even, sorted({self.size.grid[0], self.size.base})))

    @property
    def splits(self) -> tuple[str, str]:
        """To train on and to measure on."""
        data = self.training.data.among([split.name for split in self.dataset.splits])
        return data.train, data.held_out

    @property
    def held_out(self) -> Path:
        """Folder of the dataset that is measured on."""
        return self.out / "datasets" / "held-out"

    def folder(self, mix: Mix) -> Path:
        """Folder of the examples of a mix."""
        return self.out / "datasets" / mix.name

    @property
    def sentence(self) -> str:
        """How networks are trained, to stand on everything that shows their figures."""
        return settings_of(self.training, self.device, self.size.seeds)

    def train_settings(self, mix: Mix, count: int) -> tuple[str, ...]:
        """Overrides for `count` examples to learn from, rendered by a mix."""
        return (*self.loaded.overrides, *mix.settings(self.dataset), self._alone(self.splits[0], count))

    def held_out_settings(self) -> tuple[str, ...]:
        """Overrides for the clean examples to measure on."""
        clean = ("render.accuracy={}", f"render.spp={self.size.clean}", "render.denoise={layers: []}")
        return (*self.loaded.overrides, *clean, self._alone(self.splits[1], self.size.held_out))

    def _alone(self, name: str, count: int) -> str:
        """Leave one split, with as many pairs and then views as `count` examples need."""
        split = self.dataset.split_of(name)
        views, pairs = spread_out(self.dataset, split, count)
        data: Any = self.loaded.documents[""].data
        written = next(dict(one) for one in data["splits"] if one["name"] == name)
        return f"splits={json.dumps([written | {'pairs': pairs, 'views': views}])}"


def spread_out(dataset: DatasetSpec, split: SplitSpec, count: int) -> tuple[int, int]:
    """Views of each pair and pairs of object and scene for `count` examples: all pairs before a second view."""
    variants = dataset.target.count_of(split.lights) * len(split.levels(dataset.rough))
    wanted, most = ceil(count / variants), split.objects.count * split.scenes.count
    views = ceil(wanted / most)
    return views, ceil(wanted / views)


def first_examples(dataset: DatasetSpec, count: int) -> tuple[str, ...]:
    """Keys of the first `count` examples of a dataset of one split, whatever else it holds: one view of every pair,
    then another."""
    place = {pair: number for number, pair in enumerate(pairs_of(dataset.splits[0]))}
    refs = sorted(examples(dataset), key=lambda ref: (ref.view.camera, ref.light, ref.level, place[ref.view.pair]))
    return tuple(ref.key for ref in refs[:count])


def require(study: BudgetStudy) -> None:
    """Raise UserError where the study could not be done once its datasets are built, which may take hours."""
    if problems := list(_lacking(study)):
        raise UserError(problems)
    if study.denoise:
        oidn.require()


def _lacking(study: BudgetStudy) -> Iterator[Problem]:
    dataset, grid = study.dataset, study.size.grid
    if list(grid) != sorted(set(grid)) or len(grid) < 2 or grid[0] < 1:
        yield Problem(where="", path="--spp", rule="expected at least two numbers >= 1, each larger than the one "
                      f"before, got {', '.join(map(str, grid))}")
    if lacking := problem_of("", dataset.layers, PAPER_LAYERS, "train on and to measure by"):
        yield lacking
    names = [split.name for split in dataset.splits]
    for name in study.splits:
        if name not in names:
            yield Problem(where="", path="splits", rule=f"expected a split {name or 'to measure on'}, got "
                          f"{', '.join(names)}")
    if wrong := [spp for spp in grid if spp % dataset.render.batches]:
        yield Problem(where="", path="render.batches", rule=f"expected a divisor of {', '.join(map(str, wrong))}, the "
                      f"spp of the study, got {dataset.render.batches}")
    if dataset.render.batches % 2:
        yield Problem(where="", path="render.batches", rule="expected an even number, for samples in two halves, got "
                      f"{dataset.render.batches}")
    if study.training.objective.noise != PLAIN:
        yield Problem(where="", path="objective.noise", rule=f"expected {PLAIN}, which the study compares with the "
                      f"others, got {study.training.objective.noise}", hint="leave it out")
