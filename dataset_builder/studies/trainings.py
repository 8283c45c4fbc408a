"""Trainings of a study, each in its own folder: their configurations, what an earlier run left, and their scores."""

import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from math import nan
from pathlib import Path
from typing import Any

from dataset_builder.digest import canonical_json
from dataset_builder.errors import UserError
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.lightnet.measures.metrics import Metrics
from dataset_builder.lightnet.methods.method import choose
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.lightnet.training.events import Event, Started, Stepped
from dataset_builder.lightnet.training.fit import BEST, LAST, LOCK, LOG, SPEC, TrainingJob, fit
from dataset_builder.lock import locked
from dataset_builder.processes import cores
from dataset_builder.studies.comma_separated import read_csv, write_csv

ABOUT, SCORES, FACTS = "study.json", "scores.csv", "facts.json"
BOARD = "tensorboard"
KINDS: dict[str, Callable[[str], Any]] = {"method": str, "key": str, "view": str, "object": str, "room": str,
                                          "level": int, "sigma": float, "rough": str, "seconds": float}
"""Columns that are no metric, in order, and what their text is."""
EXACT = 17
"""Digits that bring a double back as it was."""
FIGURES = tuple(field.name for field in fields(Metrics))
PARTS = {"metrics": "", "corrected": "_corrected", "ceiling": "_ceiling"}
"""Figures of a row, and what their columns end with."""


def base_of(spec: TrainingSpec) -> TrainingSpec:
    """What all rows of a table share: the configuration, trained to its last step.

    Training that stops early would show rows different numbers of examples, and look at what it is measured on. Raises
    UserError where the configuration is not one of LighTNet.
    """
    if spec.method != "lightnet":
        raise UserError(f"method: expected a configuration of lightnet, from which the rows are derived, got "
                        f"{spec.method}")
    return changed(spec, check={"patience": 0})


def changed(spec: TrainingSpec, **values: Any) -> TrainingSpec:
    """The same with other values, checked again; a mapping changes those values of a part that it names.

    >>> changed(TrainingSpec(), steps=7, model={"width": 4}).model
    ModelSpec(width=4, downs=4, formulation='dr_alpha_s', shading='residual')
    """
    # What nobody wrote stays a default: names of splits give way to a dataset's own
    plain: dict[str, Any] = spec.model_dump(exclude_unset=True)
    for key, value in values.items():
        plain[key] = {**plain.get(key, {}), **value} if isinstance(value, Mapping) else value
    return TrainingSpec.model_validate(plain)


def settings_of(spec: TrainingSpec, device: str, seeds: int = 1) -> str:
    """One sentence on how LighTNet is trained. device: as `lightnet.methods.method.choose` takes it."""
    found = choose(device)
    where = f"{cores()} cores" if found.type == "cpu" else str(found)
    which = f"{seeds} seeds" if seeds > 1 else f"seed {spec.seed}"
    return (f"width {spec.model.width}, {spec.steps} steps of {spec.data.batch} examples, crops of {spec.data.crop} "
            f"pixels, {which}, {where}: not the paper's run")


def train(job: TrainingJob) -> Iterator[Event]:
    """Train to the end, whatever the folder held before, and note what tables say about the training.

    A folder of another spec, dataset or VGG weights is emptied of what trainings and studies leave there, if nobody
    is at work in it. Raises UserError as `fit` does.
    """
    identity = job.identity()
    with locked(job.out / LOCK, folder=job.out, work="training"):
        claim(job.out, identity)
    # Of a training that was finished before, the seconds that it took then
    facts, spent = read_facts(job.out), list[float]()
    for event in fit(job):
        if isinstance(event, Started):
            facts |= {"parameters": sum(event.parameters.values()), "off": list(event.off), "examples": event.train}
        if isinstance(event, Stepped):
            spent.append(event.seconds)
        yield event
    if spent:
        facts["seconds_per_step"] = sum(spent) / len(spent)
    write_atomic(job.out / FACTS, canonical_json(facts) + b"\n")


def claim(folder: Path, identity: str) -> None:
    """State what `folder` is about; what is about anything else goes. Raises OutputError."""
    if about(folder, identity):
        return
    path = folder / ABOUT
    with output_errors(folder):
        # The statement last: an interruption in between must leave nothing under a statement that is not its own
        path.unlink(missing_ok=True)
        for name in (SCORES, FACTS, LAST, BEST, LOG, SPEC):
            (folder / name).unlink(missing_ok=True)
        if (folder / BOARD).is_dir():
            shutil.rmtree(folder / BOARD)
    write_atomic(path, canonical_json({"identity": identity}))


def about(folder: Path, identity: str) -> bool:
    """Whether `folder` holds results of just that."""
    path = folder / ABOUT
    return path.is_file() and path.read_bytes() == canonical_json({"identity": identity})


def read_facts(folder: Path) -> dict[str, Any]:
    """What `train` noted: `parameters`, `off`, `examples` to learn from, `seconds_per_step`; empty where there is
    nothing."""
    try:
        found = json.loads((folder / FACTS).read_bytes())
    except (FileNotFoundError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def write_scores(rows: Iterable[ScoreRow], path: Path) -> None:
    """Write rows as CSV, whole or not at all. Raises OutputError."""
    write_csv(path, (*KINDS, *(name + end for end in PARTS.values() for name in FIGURES)), (
        [getattr(row, name) for name in KINDS] + [getattr(getattr(row, part), name) for part in PARTS
                                                  for name in FIGURES] for row in rows), digits=EXACT)


def read_scores(path: Path) -> tuple[ScoreRow, ...]:
    """The rows of a file that `write_scores` wrote; none where it is missing or damaged."""
    try:
        return tuple(map(_score_row, read_csv(path)))
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return ()


def _score_row(line: dict[str, str]) -> ScoreRow:
    # The same NaN everywhere, so that rows without such figures are equal
    found: dict[str, Any] = {part: Metrics(**{name: float(text) if (text := line[name + end]) else nan
                                              for name in FIGURES}) for part, end in PARTS.items()}
    return ScoreRow(**{name: read(line[name]) for name, read in KINDS.items()}, **found)
