"""Run units on this machine, in this process or in several. No other module starts processes for a build."""

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from dataset_builder.errors import OutputError
from dataset_builder.processes import follow_the_parent

Unit = TypeVar("Unit")
Result = TypeVar("Result")
PATIENCE = 5.0
"""Seconds that a process has to end when it is told to."""

AHEAD = 2
"""Units handed out per process before results come back."""

LISTEN = 0.2
"""Seconds between looks at what processes tell."""

Told = Callable[[Any], None]


def run(work: Callable[..., Result], units: Iterable[Unit], *, workers: int, told: Told | None = None) \
        -> Iterator[Result]:
    """Results of `work` on every unit, in order of completion. One worker means this process.

    `work` must be picklable and derive everything from its unit. With `told` it is called with a function besides, and
    whatever picklable it calls that with, `told` is called with in this process while results are waited for.
    Raises what `work` raises, and OutputError where a process dies (out of memory, say); units that were finished
    before keep whatever they wrote.
    """
    if workers <= 1:
        yield from (work(unit) if told is None else work(unit, told) for unit in units)
        return
    # A forked child would inherit the state of Dr.Jit and of thread pools
    context = multiprocessing.get_context("spawn")
    news = None if told is None else context.SimpleQueue()
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(news,)) as pool:
        try:
            pending = _drain(pool, work if told is None else partial(_telling, work), iter(units), workers * AHEAD,
                             None if told is None else LISTEN)
            for done in pending:
                while told is not None and news is not None and not news.empty():
                    told(news.get())
                yield from (future.result() for future in done)
        except BrokenProcessPool as error:
            raise OutputError("a worker process died, possibly out of memory; finished examples are kept: run the "
                              "build again with fewer --workers") from error
        except BaseException:
            _end_children()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


def _drain(pool: ProcessPoolExecutor, work: Callable[[Unit], Result], units: Iterator[Unit], most: int,
           patience: float | None) -> Iterator[set[Future[Result]]]:
    """What is done, as it comes; nothing wherever `patience` seconds brought none."""
    pending: set[Future[Result]] = {pool.submit(work, unit) for unit in islice(units, most)}
    while pending:
        done, pending = wait(pending, patience, return_when=FIRST_COMPLETED)
        pending |= {pool.submit(work, unit) for unit in islice(units, len(done))}
        yield done


_news: Any = None
"""Where a process puts what it tells."""


def _begin(news: Any) -> None:
    """The start of a process."""
    global _news
    _news = news
    follow_the_parent()


def _telling(work: Callable[..., Result], unit: Any) -> Result:
    return work(unit, _news.put)


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
