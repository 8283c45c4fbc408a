"""The trainings of the study, and their results on the examples that every level has."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from dataset_builder.digest import digest
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset, measured, splits_of
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow, contender, evaluate, trivial
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.lightnet.training.events import Event
from dataset_builder.lightnet.training.fit import LAST, TrainingJob
from dataset_builder.planning.catalogue import examples
from dataset_builder.shards.reader import load_manifest
from dataset_builder.studies.noise.axes import NoiseAxis, axis_of, figures
from dataset_builder.studies.noise.noise_study import NoiseStudy, level_name
from dataset_builder.studies.trainings import SCORES, claim, read_facts, read_scores, train, write_scores

MIXED = "mixed"
"""The training on all levels of noise."""


@dataclass(frozen=True, kw_only=True)
class HeldOutExample:
    """A held-out example that every level has."""

    index: int
    """Position in the split."""
    key: str
    case: tuple[str, int]
    level: int
    figures: Mapping[str, float]
    """What was measured of its rough mesh: by names of `AXES`, in the label's unit; at least on the study's axis."""


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """The split that is measured on."""

    dataset: LightingDataset = field(repr=False)
    examples: tuple[HeldOutExample, ...]
    """Of the cases (view, light) that every level has, no others."""
    left_out: int
    """Cases that a gate took some level of."""

    @cached_property
    def cases(self) -> tuple[tuple[str, int], ...]:
        """Views under their lights, in order."""
        return tuple(dict.fromkeys(example.case for example in self.examples))

    def of(self, level: int) -> list[HeldOutExample]:
        """One level's examples, in the order of `cases`."""
        own = {example.case: example for example in self.examples if example.level == level}
        return [own[case] for case in self.cases]


@dataclass(frozen=True, kw_only=True)
class LevelNews:
    """What a training said."""

    name: str
    number: int
    """Of `count` trainings, from 1."""
    count: int
    event: Event


def jobs(study: NoiseStudy) -> dict[str, TrainingJob]:
    """The trainings by name: on all levels of noise first, then on each level alone."""
    alone = {level_name(level): (level,) for level in study.alone}
    mixed = () if len(study.noise) == len(study.levels) else study.noise
    return {MIXED: _job(study, MIXED, study.training, mixed),
            **{name: _job(study, name, study.per_level, levels) for name, levels in alone.items()}}


def train_all(study: NoiseStudy) -> Iterator[LevelNews]:
    """Every training, to its end; those that an earlier run finished are kept. Raises UserError as `fit` does."""
    work = jobs(study)
    for number, (name, job) in enumerate(work.items(), start=1):
        for event in train(job):
            yield LevelNews(name=name, number=number, count=len(work), event=event)


def held_out(study: NoiseStudy) -> HeldOut:
    """The held-out split, and what can be compared in it. Raises UserError where a label lacks the study's axis."""
    data = study.training.data.among(splits_of(study.dataset))
    dataset = measured(study.dataset, data.held_out, data)
    axis = axis_of(study.axis)
    every = [_example(dataset, index, axis) for index in range(len(dataset))]
    levels = defaultdict[tuple[str, int], set[int]](set)
    for example in every:
        levels[example.case].add(example.level)
    whole = {case for case, found in levels.items() if len(found) == len(study.levels)}
    return HeldOut(dataset=dataset, examples=tuple(one for one in every if one.case in whole),
                   left_out=len(levels) - len(whole))


def measure(study: NoiseStudy, split: HeldOut) -> Sequence[ScoreRow]:
    """Every example by every training and by what learns nothing; the table of an earlier run is taken where it is of
    the same trainings."""
    folder = study.out / "scores"
    claim(folder, digest({"trainings": {name: job.identity() for name, job in jobs(study).items()},
                          "layers": list(split.dataset.extra)}))
    if kept := read_scores(folder / SCORES):
        return kept
    rows = list(evaluate(contenders(study), split.dataset, [example.index for example in split.examples]))
    write_scores(rows, folder / SCORES)
    return rows


def contenders(study: NoiseStudy) -> list[Contender]:
    """The trained ones by name, and what learns nothing. Of a training the last weights, which no measurement chose."""
    trained = [contender(name, load_trained(job.out / LAST, study.device)) for name, job in jobs(study).items()]
    return [*trained, *trivial()]


def training_counts(study: NoiseStudy) -> dict[str, int]:
    """Examples that each training had to learn from, by its name."""
    return {name: int(read_facts(job.out).get("examples", 0)) for name, job in jobs(study).items()}


def rejected_by_level(study: NoiseStudy) -> list[int]:
    """How many examples of each level a gate rejected, over all splits."""
    level_of = {ref.key: ref.level for ref in examples(study.loaded.dataset)}
    counts = Counter(level_of[rejected.key] for rejected in load_manifest(study.dataset).rejected)
    return [counts[level] for level in range(len(study.levels))]


def _job(study: NoiseStudy, name: str, spec: TrainingSpec, levels: tuple[int, ...]) -> TrainingJob:
    folder: Path = study.out / "trainings" / name.replace(" ", "-")
    return TrainingJob(dataset=study.dataset, out=folder, spec=spec, vgg_weights=study.vgg_weights, device=study.device,
                       levels=levels)


def _example(dataset: LightingDataset, index: int, axis: NoiseAxis) -> HeldOutExample:
    label = dataset.label(index)
    plan = label.plan
    return HeldOutExample(index=index, key=plan.key, case=(plan.view, plan.light), level=plan.rough.level,
                          figures=figures(label.record, axis))
