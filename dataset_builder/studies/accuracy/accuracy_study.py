"""The whole study: examples one by one, question by question, then what follows from all rows."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

from dataset_builder.files import write_atomic
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.backend import activate
from dataset_builder.studies.accuracy import bounds, other_examples, precision, sampling
from dataset_builder.studies.accuracy.answers import AskedAccuracy
from dataset_builder.studies.accuracy.conclusions import Conclusions, Setup, write_about
from dataset_builder.studies.accuracy.dataset_work import dataset_work
from dataset_builder.studies.accuracy.rows import (
    COLUMNS,
    OTHERS,
    QUESTIONS,
    AccuracyRow,
    Steps,
    begin,
    kept_steps,
    write_table,
)
from dataset_builder.studies.accuracy.workbench import BUDGETS, Bench
from dataset_builder.studies.renders import REPEATS, References, pixel_versions
from dataset_builder.studies.sampled import StudySpec, chosen_layers

MEASURES: dict[str, Callable[[Bench, ExampleRef], Iterator[AccuracyRow]]] = {
    "sampling": sampling.measure, "path depth": bounds.measure_depth, "edge length": bounds.measure_edges,
    "texture size": bounds.measure_textures, "storage": precision.measure_storage,
    "accumulation": precision.measure_sums, "other examples": other_examples.measure,
}
"""Groups of questions by what the terminal calls them."""

GROUPS = {**dict.fromkeys(QUESTIONS, "sampling"), bounds.DEPTH: "path depth", bounds.EDGES: "edge length",
          bounds.TEXTURES: "texture size", precision.CODECS: "storage", precision.ACCUMULATION: "accumulation",
          OTHERS: "other examples"}
"""The group of every question."""


@dataclass(frozen=True, kw_only=True)
class AccuracyStudy:
    """What to study."""

    spec: StudySpec
    out: Path
    """The study's folder."""
    examples: int
    """How many."""
    layers: tuple[str, ...]
    """Those among them that the dataset holds."""
    budget: str
    """A key of `BUDGETS`."""
    backend: str

    @property
    def table(self) -> Path:
        """Where the rows go."""
        return self.out / "results.csv"


@dataclass(frozen=True, kw_only=True)
class Step:
    """One group of questions on one example: done of `steps`, its rows, and the seconds that it took."""

    number: int
    steps: int
    example: str
    group: str
    rows: tuple[AccuracyRow, ...]
    seconds: float
    kept: bool = False
    """Whether an earlier run had measured it."""


def run(study: AccuracyStudy) -> Iterator[Step]:
    """Measure; the table is written after every step, and a study that was interrupted goes on where it ended.

    Raises UserError where the spec, its plans or the output folder do not allow it.
    """
    activate(study.backend)
    refs, bench = study.spec.sample(study.examples), bench_of(study)
    work = [(ref, group) for ref in refs for group in MEASURES if group != GROUPS[OTHERS]]
    work += [(ref, GROUPS[OTHERS]) for ref in study.spec.sample(bench.budget.others)]
    done = _done(study, bench, [(ref.key, group) for ref, group in work])
    for number, (ref, group) in enumerate(work, start=1):
        start, step = perf_counter(), (ref.key, group)
        if not (kept := step in done):
            done[step] = tuple(MEASURES[group](bench, ref))
            write_table([row for rows in done.values() for row in rows], study.table)
        yield Step(number=number, steps=len(work), example=ref.key, group=group, rows=done[step], kept=kept,
                   seconds=perf_counter() - start)


def _done(study: AccuracyStudy, bench: Bench, work: Sequence[tuple[str, str]]) -> Steps:
    """Steps of this study that an earlier run with the same spec, settings and versions has measured."""
    about = {"spec": study.spec.planner().loaded.spec_digest, "budget": asdict(bench.budget), "repeats": bench.repeats,
             "layers": dict(bench.extents), "versions": bench.references.made_by, "columns": COLUMNS}
    begin(study.out, about, study.table)
    done = kept_steps(study.table, GROUPS)
    return {step: done[step] for step in work if step in done}


def bench_of(study: AccuracyStudy) -> Bench:
    """What the questions work with. Raises UserError where the dataset holds none of the layers."""
    references = References(folder=study.out / "references", made_by=pixel_versions(study.backend))
    return Bench(spec=study.spec, budget=BUDGETS[study.budget], references=references,
                 extents=chosen_layers(study.spec.dataset, study.layers),
                 repeats=REPEATS if study.budget == "full" else 1)


def conclude(study: AccuracyStudy, rows: Sequence[AccuracyRow], asked: AskedAccuracy) -> Conclusions:
    """What all rows say about what was asked; the settings are written to `recommended.txt`, one option of the command
    line per line, and what they follow from besides the table to `answer.json`. Raises OutputError."""
    work, budget = dataset_work(study.spec), BUDGETS[study.budget]
    setup = Setup.here(study.budget, study.backend, study.spec.overrides, reference_spp=budget.reference_spp,
                       first=budget.first)
    write_about(study.out, work, setup, asked)
    found = Conclusions.of(rows, study.spec.dataset, work, setup, asked)
    write_atomic(study.out / "recommended.txt", found.advice.lines().encode())
    return found
