"""A spec with every file that it names, taken to a machine that may not have them, and the folder it has there."""

import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import time

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors
from dataset_builder.spec.resolve import LoadedSpec
from dataset_builder.spec.spec_files import SpecFiles

BUILDS, CACHE = "builds", "cache"
STALE = 86_400.0
"""Seconds after which what nobody used goes, should its build never have said that it ended."""


@dataclass(frozen=True, kw_only=True)
class Parcel:
    """The files of a spec; their bytes travel beside it, in the order of `names`."""

    names: tuple[str, ...]
    folders: tuple[str, ...]
    spec: str
    """Name of the dataset file."""

    @classmethod
    def of(cls, loaded: LoadedSpec) -> tuple["Parcel", list[Path]]:
        """The parcel of a spec that was loaded here, and where its files lie."""
        found = SpecFiles.of(loaded)
        return cls(names=found.files, folders=found.folders, spec=found.spec), [found.top / name
                                                                                for name in found.files]

    def unpacked(self, folder: Path, contents: Sequence[Callable[[], bytes]]) -> Path:
        """The dataset file in `folder`, which appears whole or not at all, whoever else unpacks it. contents: give the
        bytes of the files, one at a time. Raises OutputError."""
        if not folder.is_dir():
            with output_errors(folder):
                folder.parent.mkdir(parents=True, exist_ok=True)
                aside = Path(tempfile.mkdtemp(dir=folder.parent, prefix="unpacking-"))
                try:
                    for name in self.folders:
                        (aside / name).mkdir(parents=True, exist_ok=True)
                    for name, content in zip(self.names, contents, strict=True):
                        (aside / name).parent.mkdir(parents=True, exist_ok=True)
                        (aside / name).write_bytes(content())
                    # Where another process was faster, its folder is there and this one cannot take its name
                    with suppress(FileExistsError):
                        _rename(aside, folder)
                finally:
                    shutil.rmtree(aside, ignore_errors=True)
        return folder / self.spec


def _rename(source: Path, target: Path) -> None:
    try:
        os.rename(source, target)
    except OSError as error:
        if not target.is_dir():
            raise
        raise FileExistsError(str(target)) from error


def own_folder() -> Path:
    """The folder of this user on this machine for what builds of others need here: below the temporary one. Raises
    OutputError where somebody else made it."""
    folder = Path(tempfile.gettempdir()) / f"3df-lighting-{os.getuid()}"
    with output_errors(folder):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        rule = "expected a folder of this user, got another's"
        raise OutputError([Problem(where=str(folder), path="", rule=rule, hint="set TMPDIR on this machine")])
    return folder


def build_folder(build: str) -> Path:
    """The folder of one build on this machine, which goes when the build ends; those of builds that never said so go
    once they are stale."""
    builds = own_folder() / BUILDS
    folder = builds / build
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
    for other in builds.iterdir():
        with suppress(OSError):
            if time() - other.stat().st_mtime > STALE:
                shutil.rmtree(other, ignore_errors=True)
    return folder


def forget(build: str) -> None:
    """Let the folder of a build go."""
    shutil.rmtree(own_folder() / BUILDS / build, ignore_errors=True)
