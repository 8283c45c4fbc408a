"""The output folder: whose it is, and what in it is ours.

`.build/claim.json` says it before there is a `dataset.json`: which dataset is built here, and which files outside
`.build` builds put there.
"""

import errno
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field, ValidationError

from dataset_builder.digest import canonical_json, read_regular
from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors, partial_of, write_atomic
from dataset_builder.spec.model import Model

WORK = ".build"
CLAIM, LEASE, STAGING, NEXT = "claim.json", "lease", "staging", "next"
MENDING, ASIDE = "repair", "set-aside"
"""Where mended files wait until all are there, and where files go that are not of the dataset."""
SHARDS, INDEX, PREVIEWS = "shards", "index", "previews"
MANIFEST, CARD, CROISSANT, SUMS = "dataset.json", "README.md", "croissant.json", "SHA256SUMS"
SECONDS = "seconds.csv"
"""What examples took; of one machine, so no part of the dataset proper."""
SHEET = f"{PREVIEWS}/contact_sheet.png"
FORMAT: Literal["3df-lighting"] = "3df-lighting"
NAMED = 8
"""Files of others that are named; of the rest only how many there are."""

MOST_BYTES = 2**26
"""What a dataset's files of text may hold: some 250,000 shards, or 8,000 examples of one shard."""

_UNKNOWN = (errno.EMFILE, errno.ENFILE, errno.EIO, errno.ESTALE)
"""Errors after which nobody knows what a file says: a claim that cannot be read now is not none."""

M = TypeVar("M", bound=Model)
_STEM = "[a-z0-9][a-z0-9._-]*"
_PREVIEW = re.compile(rf"{PREVIEWS}/([0-9]{{8}}(-mesh)?\.(html|png)|"
                      rf"{_STEM}-[0-9]+-[0-9]+(-[0-9]+-[0-9]+)?(-strip)?\.png)(\.partial)?")
"""Of `inspect`: pages and pictures of examples, pictures of sequences."""
_FILE = rf"^({SHARDS}/{_STEM}\.tar|{INDEX}/{_STEM}\.manifest|README\.md|croissant\.json|SHA256SUMS|dataset\.json)$"


class Claim(Model):
    """Which dataset a folder is for, and what in it is ours."""

    format: Literal["3df-lighting"] = FORMAT
    name: str
    version: str
    files: tuple[Annotated[str, Field(pattern=_FILE)], ...] = ()
    """Those outside `.build` that are ours, relative; of the old and the new set while `publishing`."""
    publishing: bool = False
    """Whether a new set is taking the place of the old one."""

    @property
    def title(self) -> str:
        """Name and major version: what makes a dataset another one."""
        return f"{self.name} v{self.version.partition('.')[0]}"


class _Shard(Model, extra="ignore"):
    name: str


class _Published(Model, extra="ignore"):
    """What is needed of `dataset.json`, of whatever version of the builder."""

    format: Literal["3df-lighting"]
    name: str
    version: str
    shards: tuple[_Shard, ...]


def files_of(shards: Iterable[str]) -> tuple[str, ...]:
    """Every file of a whole dataset of shards with these names, relative, sorted."""
    both = [(f"{SHARDS}/{name}", f"{INDEX}/{name.removesuffix('.tar')}.manifest") for name in shards]
    return tuple(sorted([*(name for pair in both for name in pair), MANIFEST, CARD, CROISSANT, SUMS]))


def next_of(folder: Path) -> Path:
    """Where the files of the next set wait until all are there."""
    return folder / WORK / NEXT


def read_claim(folder: Path) -> Claim | None:
    """The claim on `folder`; None where there is none that this builder wrote."""
    return _read(Claim, folder / WORK / CLAIM)


def require_ours(folder: Path, wanted: Claim, *, replace: bool = False) -> Claim:
    """What is wanted with all files in `folder` that are ours; nothing is touched.

    Raises OutputError where it is a file, cannot be read, holds a file that this builder did not write, or, unless
    `replace`, another dataset or another major version.
    """
    if folder.exists() and not folder.is_dir():
        raise refused(folder, "expected a folder, got a file", "choose another output folder")
    with output_errors(folder):
        found = [claim for claim in (published_claim(folder), read_claim(folder)) if claim]
        ours = {file for claim in found for file in claim.files}
        strange = list(_strange(folder, ours, known=bool(found))) if folder.is_dir() else []
    if strange:
        more = f" and {len(strange) - NAMED} more" if len(strange) > NAMED else ""
        raise refused(folder, "expected a new or empty folder, or a dataset of this builder, got other files: "
                       f"{', '.join(strange[:NAMED])}{more}",
                       "move them away, or choose another output folder; no file was changed")
    if found and not replace and found[0].title != wanted.title:
        raise refused(folder, f"expected a new or empty folder, or {wanted.title}, got the dataset {found[0].title}",
                       "choose another output folder, or say --replace; no file was changed")
    return wanted.model_copy(update={"files": tuple(sorted(ours))})


def _strange(folder: Path, ours: set[str], *, known: bool) -> Iterator[str]:
    """What in a folder is not of this builder, relative, folders with a slash. A link is never a folder."""
    sheet, claim = Path(SHEET), Path(CLAIM)
    fine = {*ours, SECONDS, SHEET, partial_of(sheet).as_posix()} if known else set()
    begun = {"lock", LEASE, CLAIM, partial_of(claim).name}
    for path in sorted(folder.iterdir()):
        name = _entry(path, folder)
        if name == f"{WORK}/":
            nested = path / NEXT
            entries = [*path.iterdir(), *(nested.iterdir() if nested.is_dir() else ())]
            # An earlier version had a file that it locked
            yield from sorted(_entry(entry, folder) for entry in entries
                              if entry.is_symlink() or not (known or entry.name in begun))
        elif known and name in (f"{SHARDS}/", f"{INDEX}/", f"{PREVIEWS}/"):
            inside = {_entry(inner, folder) for inner in path.iterdir() if not _is_preview(inner, folder)}
            yield from sorted(inside - fine)
        elif name not in fine:
            yield name


def _is_preview(path: Path, folder: Path) -> bool:
    """Whether it is a file of `inspect`."""
    return not path.is_symlink() and _PREVIEW.fullmatch(path.relative_to(folder).as_posix()) is not None


def _entry(path: Path, folder: Path) -> str:
    name = path.relative_to(folder).as_posix()
    return f"{name}/" if path.is_dir() and not path.is_symlink() else name


def published_claim(folder: Path) -> Claim | None:
    """What `dataset.json` says, as a claim; None where there is none of this builder."""
    found = _read(_Published, folder / MANIFEST)
    if found is None:
        return None
    try:
        return Claim(name=found.name, version=found.version, files=files_of(shard.name for shard in found.shards))
    except ValidationError:
        return None


def _read(model: type[M], path: Path) -> M | None:
    try:
        return model.model_validate_json(read_regular(path, most=MOST_BYTES))
    except ValidationError:
        return None
    except OSError as error:
        if error.errno in _UNKNOWN:
            with output_errors(path):
                raise
        return None


def write_claim(folder: Path, claim: Claim) -> None:
    """Say in the folder whose it is. Raises OutputError."""
    write_atomic(folder / WORK / CLAIM, canonical_json(claim.model_dump(mode="json")))


def refused(folder: Path, rule: str, hint: str) -> OutputError:
    """That a folder cannot be written as it is."""
    return OutputError([Problem(where=str(folder), path="", rule=rule, hint=hint)])
