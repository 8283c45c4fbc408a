"""Run units on this machine, in this process or in several. No other module starts processes for a build."""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from math import inf
from typing import Any, Generic, TypeVar

from dataset_builder.engine.worker_process import WorkerProcess
from dataset_builder.errors import OutputError, Problem

Unit = TypeVar("Unit")
Result = TypeVar("Result")
AHEAD = 2
"""Units that a process is given before results come back, while there are enough for all."""

TRIES = 3
"""Times that a unit is tried whose process dies or hangs."""

MANY = 8
"""Units that may be lost while fewer are done: it is not the units, then."""

Told = Callable[[Any], None]
Limit = Callable[[Any], float]
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Lost(Generic[Unit]):
    unit: Unit
    why: str

    def problem(self, tries: int) -> Problem:
        often = "" if tries == 1 else f", {tries} times"
        return Problem(where=str(self.unit), path="", rule=f"its process {self.why}{often}",
                       hint="what was finished is kept: run the same command again to go on")


def run(work: Callable[..., Result], units: Iterable[Unit], *, workers: int, told: Told | None = None,
        limit: Limit | None = None) -> Iterator[Result]:
    """Results of `work` on every unit, in order of completion. One worker without a limit means this process.

    `work` must be picklable and derive everything from its unit. With `told` it is called with a function besides, and
    whatever picklable it calls that with, `told` is called with in this process while results are waited for.
    limit: seconds that a unit may take.

    Raises what `work` raises, at once. A unit whose process dies (out of memory, say) or takes too long is tried again
    when all others are done, alone, `TRIES` times in all; each loss is logged. In the end OutputError names every unit
    that was lost each time, as `str` has it, and why. Whatever units wrote before is kept.
    """
    if workers <= 1 and limit is None:
        yield from (work(unit) if told is None else work(unit, told) for unit in units)
        return
    crew, failed = _Crew[Unit, Result](work, told, limit), list[Problem]()
    yield from crew.results(units, max(workers, 1))
    for unit in [lost.unit for lost in crew.lost]:
        for _ in range(TRIES - 1):
            crew.lost.clear()
            yield from crew.results([unit], 1)
            if not crew.lost:
                break
        else:
            failed.append(crew.lost[0].problem(TRIES))
    if failed:
        raise OutputError(failed)


class _Crew(Generic[Unit, Result]):
    """Processes that do units, and the units that were lost with some of them."""

    def __init__(self, work: Callable[..., Result], told: Told | None, limit: Limit | None):
        self._work, self._told, self._limit = work, told, limit or (lambda _: inf)
        self.lost: list[_Lost[Unit]] = []

    def results(self, units: Iterable[Unit], workers: int) -> Iterator[Result]:
        """What becomes of units, but for those that are lost."""
        crew, done, gently = list[WorkerProcess](), 0, False
        waiting, further = deque[Unit](), iter(units)
        try:
            while True:
                waiting.extend(islice(further, max(AHEAD * workers - len(waiting), 0)))
                self._hand_out(waiting, crew, workers)
                if not any(worker.units for worker in crew):
                    break
                WorkerProcess.wait_for(crew)
                for worker in list(crew):
                    # Asked before the news, of which there is none later
                    gone = not worker.alive
                    for kind, what in worker.news():
                        if kind == "raised":
                            raise what
                        if kind == "told" and self._told:
                            self._told(what)
                        elif kind == "done":
                            done += 1
                            yield what
                    if gone or worker.late or not worker.alive:
                        crew.remove(worker)
                        waiting.extendleft(reversed(self._lose(worker)))
                        self._require_some(done)
            gently = True
        finally:
            WorkerProcess.leave(crew, gently=gently)

    def _hand_out(self, waiting: deque[Unit], crew: list[WorkerProcess], workers: int) -> None:
        """Give every process a unit, and a further one where enough wait for none to be idle in the end."""
        while waiting and (len(crew) < workers or any(len(worker.units) < AHEAD for worker in crew)):
            idle = min(crew, key=lambda worker: len(worker.units), default=None)
            if idle is None or (idle.units and len(crew) < workers):
                crew.append(idle := WorkerProcess(self._work, self._limit, tells=self._told is not None))
            if idle.units and len(waiting) <= workers:
                break
            idle.give(waiting.popleft())

    def _lose(self, worker: WorkerProcess) -> list[Unit]:
        """Note the unit that a process is lost with; those that it had not begun. Raises OutputError where it could not
        even begin."""
        why = worker.ended() if not worker.alive else \
            f"was killed since it took longer than {self._limit(worker.units[0]):,.6g} s"
        worker.kill()
        if worker.failed_to_start:
            raise OutputError(f"a worker process {why} before it began anything: see what it wrote above")
        if not worker.at_work and (worker.began or not worker.units):
            return list(worker.units)
        suspect, *others = worker.units
        self.lost.append(_Lost(suspect, why))
        _log.warning("%s: its process %s; it is tried again, alone", suspect, why)
        return others

    def _require_some(self, done: int) -> None:
        """Raise OutputError where most units are lost."""
        if len(self.lost) >= MANY and len(self.lost) > done:
            raise OutputError([lost.problem(1) for lost in self.lost])
