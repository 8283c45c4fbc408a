"""One writer at a time, and how one set of files takes the place of another: everything is written below `.build/next`
first, and `swap` lets it take its place."""

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.files import flush_folder, output_errors
from dataset_builder.lease import held, require
from dataset_builder.shards.folder import (
    ASIDE,
    CARD,
    CLAIM,
    CROISSANT,
    INDEX,
    LEASE,
    MANIFEST,
    MENDING,
    NEXT,
    SECONDS,
    SHARDS,
    STAGING,
    SUMS,
    WORK,
    Claim,
    next_of,
    published_claim,
    read_claim,
    refused,
    require_ours,
    write_claim,
)


@contextmanager
def build_lock(folder: Path, wanted: Claim, *, replace: bool = False) -> Iterator[None]:
    """Claim `folder` for a dataset and keep every other build out of it meanwhile, on whatever machine it runs.

    Raises OutputError as `require_ours` does, and, naming the process, where another build is at work in it.
    """
    require_ours(folder, wanted, replace=replace)
    with one_writer(folder):
        # Again, since another build may have been at work
        write_claim(folder, require_ours(folder, wanted, replace=replace))
        yield


@contextmanager
def one_writer(folder: Path, work: str = "build") -> Iterator[None]:
    """Keep every other build or repair out of `folder` meanwhile. Raises OutputError where one is at work in it."""
    # A dataset of somebody else's may lead elsewhere, where files would be written and removed
    for name in (WORK, SHARDS, INDEX, *(f"{WORK}/{inner}" for inner in (LEASE, NEXT, STAGING, MENDING, ASIDE))):
        if (folder / name).is_symlink():
            raise refused(folder, f"expected a folder {name}, got a link", "remove it, or choose another folder")
    with output_errors(folder):
        (folder / WORK).mkdir(parents=True, exist_ok=True)
    with held(folder / WORK / LEASE, folder=folder, work=work):
        finish_swap(folder)
        yield


def still_writer(folder: Path) -> None:
    """Make sure, before something takes its place for others to see, that no other writer took over meanwhile. Raises
    OutputError where one did, since this process stood still."""
    require(folder / WORK / LEASE)


def swap(folder: Path) -> None:
    """Let the whole set below `.build/next` take the place of the old one. `dataset.json` goes by one rename, after
    all that it lists is there; until then the old set is whole. Raises OutputError where the disk refuses.

    Killed at any moment, one of both sets can be read and verified, and `finish_swap` does the rest.
    """
    claim, coming = read_claim(folder), published_claim(next_of(folder))
    if claim is None or coming is None:
        raise refused(folder, f"expected {WORK}/{CLAIM} and a new {MANIFEST}, found none", "run the build again")
    both = tuple(sorted({*claim.files, *coming.files}))
    still_writer(folder)
    write_claim(folder, claim.model_copy(update={"files": both, "publishing": True}))
    finish_swap(folder)


def finish_swap(folder: Path) -> None:
    """Go on with a `swap` to its end, wherever it was cut short; nothing where there was none. Raises OutputError."""
    claim, source = read_claim(folder), next_of(folder)
    if claim is None or not claim.publishing:
        return
    # `dataset.json` is the only file whose going says that the new set is there
    kept = published_claim(source if (source / MANIFEST).exists() else folder)
    if kept is not None:
        with output_errors(folder):
            members = [name for name in kept.files if "/" in name]
            for names in (members, [MANIFEST], [CARD, CROISSANT, SUMS, SECONDS]):
                still_writer(folder)
                _move(source, folder, names)
            for name in sorted({*claim.files} - {*kept.files}):
                (folder / name).unlink(missing_ok=True)
        claim = claim.model_copy(update={"files": kept.files})
    write_claim(folder, claim.model_copy(update={"publishing": False}))
    shutil.rmtree(source, ignore_errors=True)


def left_over(folder: Path) -> frozenset[str]:
    """Files of an old or a coming set that may lie beside the published one, because a `swap` was cut short."""
    claim = read_claim(folder)
    return frozenset(claim.files) if claim and claim.publishing else frozenset()


def placed(folder: Path, name: str) -> Path:
    """Where a file of the published set lies: in its place, or, where a `swap` was cut short, still in `.build`."""
    source = next_of(folder)
    late = (source / name).is_file() and not (source / MANIFEST).exists() and left_over(folder)
    return (source if late else folder) / name


def _move(source: Path, folder: Path, names: Iterable[str]) -> None:
    """Rename those of the files that are in `source`, and flush the folders that they are in now."""
    moved = [name for name in names if (source / name).is_file()]
    for name in moved:
        (folder / name).parent.mkdir(exist_ok=True)
        os.replace(source / name, folder / name)
    for parent in {(folder / name).parent for name in moved}:
        flush_folder(parent)
