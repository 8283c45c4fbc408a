"""The folder of a gallery: written aside, then put in the place of an earlier one; never in that of anything else."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.digest import canonical_json, read_regular
from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors, partial_of

PAGE, MARK, EXAMPLES, THUMBS = "index.html", "gallery.json", "examples", "thumbs"
OURS = re.compile(rf"{PAGE}|{MARK}|{EXAMPLES}|{THUMBS}|{EXAMPLES}/\d{{8}}\.js|{THUMBS}/\d{{8}}\.jpg")
"""Every name that a gallery has, relative to its folder."""
FORMAT = "3df-lighting-gallery"
NAMED, MOST_BYTES = 8, 1 << 16


@contextmanager
def renewed_folder(path: Path) -> Iterator[Path]:
    """An empty folder beside `path` that takes its place, whole, when all is written; nothing is left of an earlier
    gallery, and nothing of this one where writing fails.

    Raises OutputError where `path` is no gallery and not empty, or holds a file of others, and where it cannot be
    written.
    """
    path = path.resolve()
    aside, old = partial_of(path), path.with_name(f"{path.name}.old")
    for folder in (path, aside, old):
        _require_ours(folder)
    with output_errors(path):
        for folder in (aside, old):
            shutil.rmtree(folder, ignore_errors=not folder.exists())
        aside.mkdir(parents=True)
        try:
            (aside / MARK).write_bytes(canonical_json({"format": FORMAT}))
            yield aside
            if path.exists():
                path.rename(old)
            aside.rename(path)
        except BaseException:
            shutil.rmtree(aside, ignore_errors=True)
            if old.exists() and not path.exists():
                old.rename(path)
            raise
        shutil.rmtree(old, ignore_errors=not old.exists())


def _require_ours(folder: Path) -> None:
    """Raise OutputError where a folder is there that holds anything but a gallery."""
    if not os.path.lexists(folder):
        return
    if not folder.is_dir():
        raise _refused(folder, "expected a folder, got a file")
    with output_errors(folder):
        names = sorted(found.relative_to(folder).as_posix() for found in folder.rglob("*"))
        ours = _marked(folder)
    strange = [name for name in names if not (ours and OURS.fullmatch(name))]
    if strange:
        more = f" and {len(strange) - NAMED} more" if len(strange) > NAMED else ""
        raise _refused(folder, "expected a new or empty folder, or a gallery, got other files: "
                               f"{', '.join(strange[:NAMED])}{more}")


def _marked(folder: Path) -> bool:
    try:
        return read_regular(folder / MARK, most=MOST_BYTES) == canonical_json({"format": FORMAT})
    except OSError:
        return False


def _refused(folder: Path, rule: str) -> OutputError:
    return OutputError([Problem(where=str(folder), path="", rule=rule,
                                hint="choose another folder; no file was changed")])
