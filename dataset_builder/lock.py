"""One process at a time: a lock file with the system's lock (flock), which is released when the process ends, and a
lease where the file system refuses locks."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors
from dataset_builder.lease import held

REFUSED = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS)
"""What file systems without locks say."""


@contextmanager
def locked(path: Path, *, folder: Path, work: str, wait: bool = False) -> Iterator[None]:
    """Hold the lock file `path` and keep every other `work` out of `folder` meanwhile; the file is gone afterwards.

    Raises OutputError where the file cannot be written, and, naming the process, where another holds it; with `wait`
    it waits for that one instead.
    """
    descriptor = _acquire(path, folder, work, wait)
    if descriptor is None:
        with held(path.with_name(f"{path.name}.lease"), folder=folder, work=work, wait=wait):
            yield
        return
    try:
        yield
    finally:
        # Unlink before release: whoever waits for the old file sees that it lost its name
        try:
            with output_errors(folder):
                path.unlink(missing_ok=True)
        finally:
            os.close(descriptor)


def _acquire(path: Path, folder: Path, work: str, wait: bool) -> int | None:
    """The lock file, locked; None where there are no locks."""
    while True:
        with output_errors(folder):
            path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError as error:
            holder = os.pread(descriptor, 32, 0).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise OutputError([Problem(where=str(folder), path="", hint="wait for it, or choose another output folder",
                                       rule=f"another {work} is running in this folder (process {holder})")]) from error
        except OSError as error:
            os.close(descriptor)
            if error.errno in REFUSED:
                with output_errors(folder):
                    path.unlink(missing_ok=True)
                return None
            raise
        if _names(path, descriptor):
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
            return descriptor
        os.close(descriptor)


def _names(path: Path, descriptor: int) -> bool:
    """Whether the file that is open still has this name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    except FileNotFoundError:
        return False
