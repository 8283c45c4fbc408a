"""All that a study concludes, from its table alone and what is written beside it: nothing is planned or rendered."""

import json
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

from dataset_builder.digest import canonical_json
from dataset_builder.files import write_atomic
from dataset_builder.rendering.backend import choose, default_workers, on_gpu
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.studies.accuracy import bounds, precision, sampling_advice
from dataset_builder.studies.accuracy.answers import Answer, Answers, AskedAccuracy
from dataset_builder.studies.accuracy.curves import Advice
from dataset_builder.studies.accuracy.dataset_work import DatasetWork
from dataset_builder.studies.accuracy.laws import scatter
from dataset_builder.studies.accuracy.rows import AccuracyRow

ANSWER = "answer.json"
"""Beside the table: what was asked, where it was measured, and what the dataset has to do."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Where and how a study was made."""

    day: str
    machine: str
    """Processor, and what renders."""
    workers: int
    """Cores, or one GPU."""
    gpu: bool
    budget: str
    reference_spp: int
    first: int
    """Samples per pixel of the first round of goals."""
    overrides: Sequence[str]
    """What was changed of the spec."""

    @classmethod
    def here(cls, budget: str, backend: str, overrides: Sequence[str], *, reference_spp: int, first: int) -> "Setup":
        """This machine, now."""
        return cls(day=f"{datetime.now(UTC):%Y-%m-%d}", machine=f"{platform.machine()}, {choose(backend).variant}",
                   workers=default_workers(backend), gpu=on_gpu(backend), budget=budget, reference_spp=reference_spp,
                   first=first, overrides=overrides)

    @property
    def clock(self) -> str:
        """The time that counts: of the device, or of all cores together, which other processes do not lengthen."""
        return "seconds" if self.gpu else "cpu_seconds"


@dataclass(frozen=True, kw_only=True, eq=False)
class Conclusions:
    """The answer, and what leads to it."""

    rows: Sequence[AccuracyRow]
    spec: DatasetSpec
    work: DatasetWork
    setup: Setup
    asked: AskedAccuracy
    answers: Answers
    answer: Answer | None
    advice: Advice

    @classmethod
    def of(cls, rows: Sequence[AccuracyRow], spec: DatasetSpec, work: DatasetWork, setup: Setup,
           asked: AskedAccuracy) -> "Conclusions":
        """From a table."""
        advice, stored = Advice(), Advice()
        precision.advise(stored, rows, spec)
        answers = _answers(rows, spec, work, setup, asked)
        answer = sampling_advice.answer_of(answers, asked, setup.workers)
        sampling_advice.advise(advice, rows, spec, answers, answer, setup.clock)
        bounds.advise(advice, rows, spec)
        advice.sentences |= stored.sentences
        advice.overrides += stored.overrides
        return cls(rows=rows, spec=spec, work=work, setup=setup, asked=asked, answers=answers, answer=answer,
                   advice=advice)

    @property
    def errors(self) -> dict[str, float]:
        """What is asked of every layer."""
        return {layer: self.asked.error_of(layer) for layer in self.answers.layers}

    @cached_property
    def changed(self) -> float:
        """Share of resamplings of the timings in which the settings change."""
        return sampling_advice.changed_share(
            self.rows, lambda rows: _answers(rows, self.spec, self.work, self.setup, self.asked), self.asked,
            self.setup.workers)

    @cached_property
    def scatters(self) -> tuple[float, float]:
        """Relative standard deviation of wall and CPU seconds between runs of one setting."""
        return scatter(self.rows, "seconds"), scatter(self.rows, "cpu_seconds")


def write_about(folder: Path, work: DatasetWork, setup: Setup, asked: AskedAccuracy) -> None:
    """Write what conclusions need besides the table. Raises OutputError."""
    write_atomic(folder / ANSWER, canonical_json({"asked": asdict(asked), "setup": asdict(setup),
                                                  "work": asdict(work)}))


def read_conclusions(rows: Sequence[AccuracyRow], spec: Path, folder: Path) -> Conclusions:
    """The conclusions of a study that is finished, from its table, its spec's file and what `write_about` wrote into a
    folder."""
    about = json.loads((folder / ANSWER).read_bytes())
    dataset = load_dataset(spec, about["setup"]["overrides"]).dataset
    return Conclusions.of(rows, dataset, DatasetWork(**about["work"]), Setup(**about["setup"]),
                          AskedAccuracy(**about["asked"]))


def _answers(rows: Sequence[AccuracyRow], spec: DatasetSpec, work: DatasetWork, setup: Setup,
             asked: AskedAccuracy) -> Answers:
    return Answers(rows, work, setup.clock, first=setup.first, batches=spec.render.batches,
                   dtype=precision.dtype_of(rows, spec), examples=asked.examples)
