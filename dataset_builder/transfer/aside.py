"""Files that are not of a dataset: moved out of the way, never deleted."""

import os
from collections.abc import Iterable
from pathlib import Path

from dataset_builder.files import output_errors
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.verify_files import extra_files

ASIDE = "set-aside"
"""Folder below `.build` where they go."""


def set_aside(folder: Path, listed: Iterable[str]) -> tuple[str, ...]:
    """Move files that are not of the dataset below `.build/set-aside`; their names."""
    names = tuple(extra_files(folder, listed))
    with output_errors(folder):
        for name in names:
            target = folder / WORK / ASIDE / name
            target.parent.mkdir(parents=True, exist_ok=True)
            os.replace(folder / name, _free(target))
            for parent in list(Path(name).parents)[:-1]:
                if not any((folder / parent).iterdir()):
                    (folder / parent).rmdir()
    return names


def bring_back(folder: Path, names: Iterable[str]) -> None:
    """Put files that were set aside back where they were."""
    with output_errors(folder):
        for name in names:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(folder / WORK / ASIDE / name, folder / name)


def _free(target: Path) -> Path:
    """A name that nothing has: what was set aside earlier stays."""
    number, free = 1, target
    while os.path.lexists(free):
        number, free = number + 1, target.with_name(f"{target.name}.{number}")
    return free
