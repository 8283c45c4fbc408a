"""A table from its rows: every row trained with every seed on the same examples, and measured on the held-out split."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dataset_builder.digest import digest
from dataset_builder.lightnet.data.lighting_dataset import LAYERS, measured, require, splits_of
from dataset_builder.lightnet.methods.checkpoint import load_trained
from dataset_builder.lightnet.methods.vgg import check_file
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow, contender, evaluate, trivial
from dataset_builder.lightnet.settings import DataSpec, TrainingSpec
from dataset_builder.lightnet.training.events import Event
from dataset_builder.lightnet.training.fit import LAST, TrainingJob
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.studies import trainings
from dataset_builder.studies.tables.paper import Table, TableRow
from dataset_builder.studies.tables.result import RowResult


@dataclass(frozen=True, kw_only=True)
class TableStudy:
    """What to measure."""

    table: Table
    base: TrainingSpec
    """What the rows were derived from."""
    dataset: Path
    out: Path
    """The study's folder, with one for each row."""
    seeds: int = 1
    """Trainings of every row, from `base.seed` on."""
    vgg_weights: Path | None = None
    device: str = "auto"
    """As `lightnet.methods.method.choose` takes it."""

    @property
    def sentence(self) -> str:
        """How the rows are trained, to stand on everything that shows them."""
        return trainings.settings_of(self.base, self.device, self.seeds)


@dataclass(frozen=True, kw_only=True)
class RowNews:
    """What a training said."""

    row: TableRow
    seed: int
    number: int
    """Of `count` trainings, from 1."""
    count: int
    event: Event


@dataclass(frozen=True, kw_only=True)
class RowMeasured:
    """A row with one seed is done."""

    row: TableRow
    seed: int
    number: int
    count: int
    scores: tuple[ScoreRow, ...]
    facts: dict[str, Any]
    kept: bool
    """An earlier run had done it."""


def sees_fields(folder: Path, base: TrainingSpec) -> bool:
    """Whether a dataset's training split has both images of fields and rendered ones as I_s. Raises ShardError."""
    data = open_dataset(folder, layers=())
    keys = data.splits.get(base.data.among(splits_of(folder)).train, ())
    there = {"i_s", "i_s_clean"} <= {layer.name for layer in data.manifest.layers}
    return there and any(data.label(key).plan.field.there for key in keys[:1])


def run(study: TableStudy) -> Iterator[RowNews | RowMeasured]:
    """Train and measure what is missing, row by row and seed by seed; an interrupted study goes on where it ended.

    Raises UserError as `lightnet.training.fit.fit` does, and where the dataset lacks what is needed.
    """
    data, work = _checked(study), work_of(study)
    for number, (row, seed) in enumerate(work, start=1):
        job = _job(study, row, seed)
        identity, scores = _identity(study, row, job), job.out / trainings.SCORES
        if not (kept := trainings.about(job.out, identity) and bool(trainings.read_scores(scores))):
            trainings.claim(job.out, identity)
            for event in () if row.spec is None else trainings.train(job):
                yield RowNews(row=row, seed=seed, number=number, count=len(work), event=event)
            trainings.write_scores(_measure(study, row, job, data), scores)
        yield RowMeasured(row=row, seed=seed, number=number, count=len(work), kept=kept,
                          scores=trainings.read_scores(scores), facts=trainings.read_facts(job.out))


def _checked(study: TableStudy) -> DataSpec:
    """The data of a study, once all that it needs has been found."""
    if study.vgg_weights:
        check_file(study.vgg_weights)
    data = study.base.data.among(splits_of(study.dataset))
    noisy = dict.fromkeys(name for row in study.table.rows if row.spec for name in row.spec.extra)
    require(study.dataset, data.held_out, (*LAYERS, *noisy))
    return data


def work_of(study: TableStudy) -> list[tuple[TableRow, int]]:
    """Rows with their seeds, in the order that they are measured in."""
    return [(row, seed) for row in study.table.rows for seed in seeds_of(study, row)]


def jobs_left(study: TableStudy) -> list[TrainingJob | None]:
    """The trainings of `work_of`; None for what learns nothing, and for what an earlier run measured. Raises UserError
    as `run` does."""
    _checked(study)
    found = list[TrainingJob | None]()
    for row, seed in work_of(study):
        job = _job(study, row, seed)
        kept = trainings.about(job.out, _identity(study, row, job)) and (job.out / trainings.SCORES).is_file()
        found.append(None if row.spec is None or kept else job)
    return found


def seeds_of(study: TableStudy, row: TableRow) -> tuple[int, ...]:
    """Seeds that a row is trained with; what learns nothing needs one."""
    return tuple(study.base.seed + number for number in range(1 if row.spec is None else study.seeds))


def results(table: Table, measured: list[RowMeasured]) -> list[RowResult]:
    """Rows of which every seed is done, in the table's order."""
    found = {row.name: [one for one in measured if one.row.name == row.name] for row in table.rows}
    return [RowResult(row=table.row(name), scores=tuple(one.scores for one in done), facts=done[-1].facts)
            for name, done in found.items() if done]


def _job(study: TableStudy, row: TableRow, seed: int) -> TrainingJob:
    spec = trainings.changed(row.spec or study.base, seed=seed)
    return TrainingJob(dataset=study.dataset, out=study.out / row.name / f"seed-{seed}", spec=spec,
                       vgg_weights=study.vgg_weights, device=study.device)


def _identity(study: TableStudy, row: TableRow, job: TrainingJob) -> str:
    """What a row's results depend on."""
    if row.spec is not None:
        return job.identity()
    shards = [shard.sha256 for shard in load_manifest(study.dataset).shards]
    return digest({"formula": row.name, "data": study.base.data.model_dump(mode="json"), "shards": shards})


def _measure(study: TableStudy, row: TableRow, job: TrainingJob, data: DataSpec) -> tuple[ScoreRow, ...]:
    """Every held-out example. The last weights, not the best ones: those were chosen by what is measured here."""
    held_out = measured(study.dataset, data.held_out, job.spec.data)
    return tuple(evaluate([_contender(row, job)], held_out, range(len(held_out))))


def contenders_of(study: TableStudy) -> list[Contender]:
    """The rows of a finished study, with its first seed, by their names."""
    return [_contender(row, _job(study, row, study.base.seed)) for row in study.table.rows]


def _contender(row: TableRow, job: TrainingJob) -> Contender:
    """What a row predicts with."""
    if row.spec is None:
        return next(one for one in trivial() if one.name == row.name)
    return contender(row.name, load_trained(job.out / LAST, job.device))
