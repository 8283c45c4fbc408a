"""The output folder: is it ours, and does nobody else build into it?

`.build` inside it marks it as ours before there is a `dataset.json`, and holds the lock and the staged examples. The
lock is the system's (flock), which ends with the process that holds it, however it ends.
"""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.errors import OutputError, Problem
from dataset_builder.shards.atomic import flush_folder, output_errors

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
                           "choose another output folder; nothing was touched")
        (folder / WORK).mkdir(parents=True, exist_ok=True)


@contextmanager
def build_lock(folder: Path) -> Iterator[None]:
    """Claim `folder` and keep every other build out of it meanwhile; the lock file is gone afterwards.

    Raises OutputError as `claim` does, and, naming the process, where another build is at work in it.
    """
    claim(folder)
    path = folder / WORK / LOCK
    descriptor = _acquire(folder, path)
    try:
        yield
    finally:
        # Unlink before release: whoever waits for the old file sees that it lost its name
        path.unlink(missing_ok=True)
        os.close(descriptor)


def retract(folder: Path) -> None:
    """Take `dataset.json` away before anything that it vouches for changes: without it the dataset is not finished."""
    with output_errors(folder):
        if (folder / MANIFEST).exists():
            (folder / MANIFEST).unlink()
            flush_folder(folder)


def _acquire(folder: Path, path: Path) -> int:
    while True:
        with output_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise _refused(folder, f"another build is at work here (process {holder})",
                           "wait for it, or choose another output folder") from error
        if path.exists() and os.path.samestat(os.fstat(descriptor), path.stat()):
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
            return descriptor
        os.close(descriptor)


def _is_dataset(folder: Path) -> bool:
    try:
        content = json.loads((folder / MANIFEST).read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and content.get("format") == FORMAT


def _refused(folder: Path, rule: str, hint: str) -> OutputError:
    return OutputError([Problem(where=str(folder), path="", rule=rule, hint=hint)])
