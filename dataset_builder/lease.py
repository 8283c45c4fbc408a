"""One process at a time on all machines that share a folder: a lease that its owner renews and others watch.

A lease is a folder of numbered files; the highest number has it. A number is taken by creating its file (O_EXCL),
which a file system grants once, whoever asks. The owner writes into its file every `RENEW` seconds; who wants the lease
watches that file on its own monotonic clock, and takes the next number once nothing has changed for `LAPSE` seconds. No
clock is compared with another. Before an owner publishes it takes the next number itself: where that fails it has lost
its lease, and after that it has it for `LAPSE` seconds at least.
"""

import errno
import json
import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic
from typing import Any
from uuid import uuid4

from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import output_errors
from dataset_builder.processes import machine, started

RENEW, LAPSE, LOOK = 10.0, 120.0, 0.5
"""Seconds between signs of life; without any, after which an owner on another machine counts as dead; between looks."""
SIZE = 512
"""Bytes of a file: it is written over in place, so that a full disk does not end a lease."""
KEPT = 4
"""Latest files that stay, so that nobody takes an old number unseen."""
_NAME = re.compile(r"[0-9]{8}")

Told = Callable[[str], None]
_held: dict[Path, "Lease"] = {}
"""Leases of this process."""


def say(text: str) -> None:
    """Tell whoever waits."""
    print(text, file=sys.stderr, flush=True)


class Lease:
    """A lease that this process took; see `held`."""

    def __init__(self, path: Path, number: int, folder: Path, work: str):
        self._path, self._folder, self._work, self._nonce, self._beat = path, folder, work, uuid4().hex, 0
        self._guard, self._ended = threading.Lock(), threading.Event()
        self._descriptor = -1
        self.number = number
        """That it has now."""

    def take(self) -> bool:
        """Take the number; False where somebody else has it, or a higher one."""
        name = self._path / f"{self.number:08d}"
        try:
            descriptor = os.open(name, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644)
        except FileExistsError:
            return False
        try:
            # Where a higher one is there, this one is an old number that was free again
            mine = _numbers(self._path)[-1:] == [self.number]
            if mine:
                self._write(descriptor)
        except BaseException:
            mine = False
            raise
        finally:
            if not mine:
                os.close(descriptor)
                name.unlink(missing_ok=True)
        if not mine:
            return False
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = descriptor
        for number in _numbers(self._path):
            if number <= self.number - KEPT:
                (self._path / f"{number:08d}").unlink(missing_ok=True)
        return True

    def require(self) -> None:
        """Make sure of the lease, for `LAPSE` seconds from now. Raises OutputError where it was lost."""
        with self._guard, output_errors(self._folder):
            self.number += 1
            if self._ended.is_set() or not self.take():
                self._ended.set()
                rule = f"this {self._work} stood still for over {LAPSE:g} s and another took its place"
                raise OutputError([Problem(where=str(self._folder), path="", rule=rule,
                                           hint="let the other one finish, or run it again afterwards")])

    def renew(self) -> None:
        """Write signs of life until the lease ends."""
        while not self._ended.wait(RENEW):
            # A disk that does not answer may answer again; others watch what they see
            with self._guard, suppress(OSError):
                if not self._ended.is_set():
                    self._write(self._descriptor)

    def end(self) -> None:
        """Let others have the lease."""
        with self._guard:
            lost = self._ended.is_set()
            self._ended.set()
            if self._descriptor < 0:
                return
            if not lost:
                with suppress(OSError):
                    self._write(self._descriptor, released=True)
            os.close(self._descriptor)

    def _write(self, descriptor: int, *, released: bool = False) -> None:
        self._beat += 1
        owner = {**machine(), "pid": os.getpid(), "started": started(os.getpid()), "nonce": self._nonce,
                 "beat": self._beat, "released": released}
        os.pwrite(descriptor, json.dumps(owner).ljust(SIZE - 1).encode() + b"\n", 0)
        os.fsync(descriptor)


@contextmanager
def held(path: Path, *, folder: Path, work: str, wait: bool = False, told: Told = say) -> Iterator[Lease]:
    """Hold the lease `path` and keep every other `work` out of `folder` meanwhile, on whatever machine it is.

    An owner that is dead (on this machine at once, elsewhere after `LAPSE` seconds without a sign of life) is replaced,
    and `told` says so. Raises OutputError where another holds it, naming the process; with `wait` it waits for that one
    instead. Where a lease ends nothing but its last number stays.
    """
    with output_errors(folder):
        path.mkdir(parents=True, exist_ok=True)
        while (lease := _next(path, folder, work, wait, told)) is None:
            pass
    key = path.absolute()
    _held[key] = lease
    threading.Thread(target=lease.renew, daemon=True, name="lease").start()
    try:
        yield lease
    finally:
        _held.pop(key, None)
        lease.end()


def require(path: Path) -> None:
    """Make sure of the lease `path` where this process took it. Raises OutputError where it was lost since."""
    if lease := _held.get(path.absolute()):
        lease.require()


def _next(path: Path, folder: Path, work: str, wait: bool, told: Told) -> Lease | None:
    """The lease, as soon as it can be had; None where somebody else was faster."""
    number = (_numbers(path) or [0])[-1]
    why = _vacant(path / f"{number:08d}", folder, work, wait, told) if number else ""
    lease = Lease(path, number + 1, folder, work)
    try:
        if why is None or not lease.take():
            return None
    except BaseException:
        lease.end()
        raise
    if why:
        told(f"note: took over {folder} from {why}")
    return lease


def _vacant(file: Path, folder: Path, work: str, wait: bool, told: Told) -> str | None:
    """Whose the lease was, and why it is no more; empty where it was let go, None where that is to be asked again."""
    first, since, patient = _read(file), monotonic(), False
    while True:
        owner = _owner(first)
        name = f"process {owner.get('pid', 'unknown')}"
        if first is None:
            return None
        if owner.get("released"):
            return ""
        here = owner and all(owner.get(key) == value for key, value in machine().items())
        if here and started(owner["pid"]) != owner["started"]:
            return f"{name}, which is dead"
        name += "" if here else f" on {owner.get('host', 'an unknown machine')}"
        still = monotonic() - since
        if not here and still >= LAPSE:
            return f"{name}, which gave no sign of life for {LAPSE:g} s"
        if here and not wait:
            raise _busy(folder, work, name)
        if not (here or patient or wait):
            told(f"note: {name} holds {folder}; waiting up to {LAPSE:g} s for a sign of life")
            patient = True
        threading.Event().wait(min(LOOK, LAPSE / 10))
        if (now := _read(file)) != first:
            if not wait and _owner(now) and not _owner(now).get("released"):
                raise _busy(folder, work, name)
            return None


def _busy(folder: Path, work: str, name: str) -> OutputError:
    return OutputError([Problem(where=str(folder), path="", hint="wait for it, or choose another output folder",
                                rule=f"another {work} is running in this folder ({name})")])


def _numbers(path: Path) -> list[int]:
    return sorted(int(name) for name in os.listdir(path) if _NAME.fullmatch(name))


def _read(file: Path) -> bytes | None:
    """What an owner wrote; None where it has gone on to another number."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        # Files of other machines may go stale under the hand
        if error.errno in (errno.ENOENT, errno.ESTALE):
            return None
        raise
    try:
        return os.pread(descriptor, SIZE, 0)
    finally:
        os.close(descriptor)


def _owner(data: bytes | None) -> dict[str, Any]:
    """Who wrote a file; nobody where it is not written yet."""
    try:
        found = json.loads(data or b"")
    except ValueError:
        return {}
    return found if isinstance(found, dict) and isinstance(found.get("pid"), int) else {}
