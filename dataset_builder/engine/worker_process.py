"""A process that does units one after another, seen from the process that gives them to it."""

import multiprocessing
import pickle
import signal
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from math import inf
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from queue import SimpleQueue
from threading import Thread
from time import monotonic
from typing import Any, Literal

from dataset_builder.processes import follow_the_parent

PATIENCE = 5.0
"""Seconds that a process has to end when it is told to."""

KILLED, SEGFAULT, BUS_ERROR = 9, 11, 7
WORDS = {
    KILLED: "was killed (signal 9), as the system does when memory runs out (fewer --workers need less)",
    SEGFAULT: "was ended by a segmentation fault (signal 11)",
    BUS_ERROR: "was ended by a bus error (signal 7), as where a disk is full under a file in memory",
}
Kind = Literal["begun", "told", "done", "raised"]
Work = Callable[..., Any]


class WorkerProcess:
    """A process, the units that it was given and has not done, and how long it may take for the first of them."""

    def __init__(self, work: Work, limit: Callable[[Any], float], *, tells: bool):
        """limit: seconds that a unit may take. tells: whether `work` is called with a function to tell news, too."""
        # A forked child would inherit the state of Dr.Jit and of thread pools
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, work, tells))
        # What is blocked stays so in the new process: Ctrl-C is the parent's from its first moment on. The tracker
        # comes first, since starting it would unblock it
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        # So that its end is the end of what can be read
        theirs.close()
        self._limit, self._deadline = limit, inf
        self.units = deque[Any]()
        """The first one is being done."""
        self.began, self.at_work = False, False
        """Whether it has begun any, and whether it is at one."""

    def give(self, unit: Any) -> None:
        """Let it do one more; where it has died, that is seen later."""
        with suppress(BrokenPipeError, ConnectionResetError):
            self._connection.send(unit)
        self.units.append(unit)

    def news(self) -> Iterator[tuple[Kind, Any]]:
        """What has come from it; a unit that is done or that raised something is no longer one of `units`."""
        try:
            while self._connection.poll():
                kind, what = self._connection.recv()
                if kind == "begun":
                    self.began, self.at_work = True, True
                    self._deadline = monotonic() + self._limit(self.units[0])
                elif kind != "told":
                    self.units.popleft()
                    self.at_work, self._deadline = False, inf
                yield kind, what
        except (EOFError, OSError):
            # Where it died as it wrote, too
            self._process.join(PATIENCE)

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._process.is_alive()

    @property
    def late(self) -> bool:
        """Whether it takes longer than it may."""
        return monotonic() > self._deadline

    def ended(self) -> str:
        """How a process that no longer runs ended, in words."""
        code = self._process.exitcode or 0
        if code >= 0:
            return f"ended by itself (exit code {code})"
        return WORDS.get(-code) or f"was ended by signal {-code} ({signal.strsignal(-code)})"

    @property
    def failed_to_start(self) -> bool:
        """Whether it ended with an error of its own before it began anything."""
        return not self.began and (self._process.exitcode or 0) > 0

    def kill(self) -> None:
        """End it at once. What it wrote is whole: examples are staged by a rename."""
        self._process.kill()
        self._process.join(PATIENCE)
        self._connection.close()

    @staticmethod
    def leave(crew: "list[WorkerProcess]", *, gently: bool) -> None:
        """End processes: as their units are done, or now."""
        for worker in crew:
            worker._connection.close()
            if not gently:
                worker._process.terminate()
        for worker in crew:
            worker._process.join(PATIENCE)
            if worker.alive:
                worker._process.kill()
                worker._process.join(PATIENCE)

    @staticmethod
    def wait_for(crew: "list[WorkerProcess]") -> None:
        """Until one of them has news, ends or is late."""
        first = min((worker._deadline for worker in crew), default=inf)
        wait([each for worker in crew for each in (worker._connection, worker._process.sentinel)],
             None if first == inf else max(first - monotonic(), 0))


def _serve(connection: Connection, work: Work, tells: bool) -> None:
    """The life of the process."""
    follow_the_parent()
    units = SimpleQueue[bytes | None]()
    # Units are taken off the wire at once, so that whoever gives them never waits for one that is being done
    Thread(target=_receive, args=(connection, units), daemon=True).start()

    def tell(kind: Kind, what: Any = None) -> None:
        connection.send((kind, what))

    while (data := units.get()) is not None:
        try:
            tell("begun")
            unit = pickle.loads(data)
            tell("done", work(unit, lambda news: tell("told", news)) if tells else work(unit))
        except Exception as error:  # noqa: BLE001  whatever it is, it is raised where it is waited for
            _raised(tell, error)


def _receive(connection: Connection, units: "SimpleQueue[bytes | None]") -> None:
    try:
        while True:
            units.put(connection.recv_bytes())
    except (EOFError, OSError):
        units.put(None)


def _raised(tell: Callable[[Kind, Any], None], error: Exception) -> None:
    """Tell of an error and where it was raised; of one that cannot be sent, its words."""
    # `__cause__` and `__traceback__` are not sent with an error
    where = "".join(traceback.format_exception(error))
    error.add_note(where)
    try:
        tell("raised", error)
    except (pickle.PicklingError, TypeError, AttributeError):
        replaced = RuntimeError(str(error))
        replaced.add_note(where)
        tell("raised", replaced)
