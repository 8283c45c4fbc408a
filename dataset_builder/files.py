"""Files that are complete or absent: written under another name, flushed to the disk, renamed."""

import errno
import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from dataset_builder.errors import OutputError, Problem

PARTIAL = ".partial"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
_HANDLES = (errno.EMFILE, errno.ENFILE)
UNITS = ("bytes", "KiB", "MiB", "GiB", "TiB", "PiB")
"""Of sizes, each 1024 of the one before."""


@contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn what the system says about writing `path` into an OutputError that a user can act on."""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL:
            rule, hint = f"the disk is full ({error.strerror})", "free some space and run the same command again"
        elif error.errno in _HANDLES:
            rule = f"no file can be opened any more ({error.strerror})"
            hint = "allow more (ulimit -n) and run the same command again"
        elif error.errno in _FORBIDDEN:
            rule, hint = f"cannot be written ({error.strerror})", "choose another output folder or fix its permissions"
        else:
            rule, hint = f"cannot be written ({error.strerror or error})", "choose another output folder"
        raise OutputError([Problem(where=str(path), path="", rule=rule, hint=hint)]) from error


@contextmanager
def exhaustion_errors(path: Path) -> Iterator[None]:
    """The same, of what the system says of any file, wherever it has no more disk or handles to give."""
    try:
        yield
    except OSError as error:
        if error.errno in (*_FULL, *_HANDLES, errno.EROFS):
            with output_errors(path):
                raise
        raise


def partial_of(path: Path) -> Path:
    """Where `path` is written before it is whole."""
    return path.with_name(path.name + PARTIAL)


def write_partial(path: Path, chunks: Iterable[bytes], *, flush: bool = True) -> tuple[int, str]:
    """Write `path`'s partial file and flush it to the disk, unless a power cut may take it; its size in bytes and
    SHA-256.

    Raises OutputError where that fails; then no partial file is left.
    """
    partial, size, hasher = partial_of(path), 0, hashlib.sha256()
    with output_errors(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            discard_partial(path)
            # Never through a link, or into what somebody else put there
            with open(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666), "wb") as stream:
                for chunk in chunks:
                    stream.write(chunk)
                    hasher.update(chunk)
                    size += len(chunk)
                stream.flush()
                if flush:
                    os.fsync(stream.fileno())
        except OSError:
            discard_partial(path)
            raise
    return size, hasher.hexdigest()


def discard_partial(path: Path) -> None:
    """Remove `path`'s partial file, if there is one that can be removed; a link stays."""
    partial = partial_of(path)
    if partial.is_file() and not partial.is_symlink():
        partial.unlink()


def commit(path: Path, final: Path | None = None, *, flush: bool = True) -> None:
    """Give `path`'s partial file its name, or that of `final` beside it, and flush the folder, unless a power cut may
    undo it. Raises OutputError where that fails."""
    with output_errors(path):
        try:
            os.replace(partial_of(path), final or path)
        except OSError:
            discard_partial(path)
            raise
        if flush:
            flush_folder(path.parent)


def write_atomic(path: Path, data: bytes) -> None:
    """Write a whole file: aside, flushed, renamed. Raises OutputError where that fails."""
    write_partial(path, [data])
    commit(path)


def flush_folder(folder: Path) -> None:
    """Flush a folder's entries to the disk, so that a rename outlives a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def require_writable(folder: Path) -> None:
    """Make a folder and see that files can be written there, before something is worked out for long. Raises
    OutputError."""
    with output_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass


def size_text(size: float, error: float = 0.0) -> str:
    """Bytes for people, in the largest unit of which there is 1 or more; error: a standard error of them, or 0.

    >>> size_text(500), size_text(2**30 - 1), size_text(10e9, 2e9)
    ('500 bytes', '1.0 GiB', '9.3 ± 1.9 GiB')
    """
    power = next((power for power in range(len(UNITS)) if round(size / 1024**power, 1) < 1024), len(UNITS) - 1)
    digits = 1 if power else 0
    spread = f" ± {error / 1024**power:,.2g}" if error else ""
    return f"{size / 1024**power:,.{digits}f}{spread} {UNITS[power]}"


def require_space(folder: Path, size: int) -> None:
    """Raise OutputError where the disk that holds (or will hold) `folder` has fewer than `size` bytes free."""
    existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    with output_errors(folder):
        free = shutil.disk_usage(existing).free
    if free < size:
        rule, hint = f"expected {size_text(size)} free, got {size_text(free)}", "choose another disk"
        raise OutputError([Problem(where=str(folder), path="", rule=rule, hint=hint)])
