"""Trainings of a study, each in its own folder: kept or resumed where the settings are the same, else started again."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dataset_builder.digest import canonical_json
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.lightnet.training.events import Event, Started, Stepped
from dataset_builder.lightnet.training.fit import BEST, LAST, LOCK, LOG, SPEC, TrainingJob, fit
from dataset_builder.lock import locked

ABOUT, SCORES, FACTS = "study.json", "scores.csv", "facts.json"
BOARD = "tensorboard"


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
    path, content = folder / ABOUT, canonical_json({"identity": identity})
    if path.is_file() and path.read_bytes() == content:
        return
    with output_errors(folder):
        # The statement last: an interruption in between must leave nothing under a statement that is not its own
        path.unlink(missing_ok=True)
        for name in (SCORES, FACTS, LAST, BEST, LOG, SPEC):
            (folder / name).unlink(missing_ok=True)
        if (folder / BOARD).is_dir():
            shutil.rmtree(folder / BOARD)
    write_atomic(path, content)


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
