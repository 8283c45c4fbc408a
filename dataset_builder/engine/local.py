"""Run units on this machine, in this process or in several. No other module starts processes for a build."""

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import TypeVar

from dataset_builder.errors import OutputError
from dataset_builder.processes import follow_the_parent

Unit = TypeVar("Unit")
Result = TypeVar("Result")
PATIENCE = 5.0
"""Seconds that a process has to end when it is told to."""

AHEAD = 2
"""Units handed out per process before results come back."""


def run(work: Callable[[Unit], Result], units: Iterable[Unit], *, workers: int) -> Iterator[Result]:
    """Results of `work` on every unit, in order of completion. One worker means this process.

    `work` must be picklable and derive everything from its unit. Raises what `work` raises, and OutputError where a
    process dies (out of memory, say); units that were finished before keep whatever they wrote.
    """
    if workers <= 1:
        yield from map(work, units)
        return
    # A forked child would inherit the state of Dr.Jit and of thread pools
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=follow_the_parent) as pool:
        try:
            yield from _drain(pool, work, iter(units), workers * AHEAD)
        except BrokenProcessPool as error:
            raise OutputError("a worker process died, possibly out of memory; finished examples are kept: run the "
                              "build again with fewer --workers") from error
        except BaseException:
            _end_children()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _drain(pool: ProcessPoolExecutor, work: Callable[[Unit], Result], units: Iterator[Unit],
           most: int) -> Iterator[Result]:
    pending: set[Future[Result]] = {pool.submit(work, unit) for unit in islice(units, most)}
    while pending:
        done, pending = wait(pending, return_when=FIRST_COMPLETED)
        for future in done:
            pending |= {pool.submit(work, unit) for unit in islice(units, 1)}
            yield future.result()


def _end_children() -> None:
    """End the pool's processes at once: an interrupted pool may never tell them to, and would wait for them for ever.

    What they wrote is whole: examples are staged by a rename.
    """
    children = multiprocessing.active_children()
    for child in children:
        child.terminate()
    for child in children:
        child.join(PATIENCE)
        if child.is_alive():
            child.kill()
