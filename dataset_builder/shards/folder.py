"""The output folder: whether it is ours, and whether another build is using it.

`.build` inside it marks it as ours before there is a `dataset.json`, and holds the lock and the staged examples.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import flush_folder, output_errors
from dataset_builder.lock import locked

WORK = ".build"
LOCK = "lock"
STAGING = "staging"
MANIFEST = "dataset.json"
SECONDS = "seconds.csv"
"""What examples took; of one machine, so no part of the dataset proper."""
FORMAT = "3df-lighting"


def claim(folder: Path) -> None:
    """Make `folder` ours, or find that it is; nothing in it changes but the marker.

    Raises OutputError where it is a file, cannot be written, or holds something that is not a dataset of this builder.
    """
    if folder.exists() and not folder.is_dir():
        raise _refused(folder, "expected a folder, got a file", "choose another output folder")
    with output_errors(folder):
        strange = folder.is_dir() and any(folder.iterdir()) and not (folder / WORK).is_dir() and not _is_dataset(folder)
        if strange:
            raise _refused(folder, "expected a new or empty folder, or a dataset of this builder, got other files",
                           "choose another output folder; no file was changed")
        (folder / WORK).mkdir(parents=True, exist_ok=True)


@contextmanager
def build_lock(folder: Path) -> Iterator[None]:
    """Claim `folder` and keep every other build out of it meanwhile; the lock file is gone afterwards.

    Raises OutputError as `claim` does, and, naming the process, where another build is at work in it.
    """
    claim(folder)
    with locked(folder / WORK / LOCK, folder=folder, work="build"):
        yield


def retract(folder: Path) -> None:
    """Take `dataset.json` away before anything that it vouches for changes: without it the dataset is not finished."""
    with output_errors(folder):
        if (folder / MANIFEST).exists():
            (folder / MANIFEST).unlink()
            flush_folder(folder)


def _is_dataset(folder: Path) -> bool:
    try:
        content = json.loads((folder / MANIFEST).read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and content.get("format") == FORMAT


def _refused(folder: Path, rule: str, hint: str) -> OutputError:
    return OutputError([Problem(where=str(folder), path="", rule=rule, hint=hint)])
