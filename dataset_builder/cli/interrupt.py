"""Ctrl-C ends a command in one way, wherever it strikes: one line, exit code 130.

Libraries written in C++ turn the KeyboardInterrupt that strikes in one of their callbacks into an error of their own,
or print it and go on. So it is noted that Ctrl-C struck, and a command that has not ended soon afterwards is ended.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130
"""Exit code, as shells have it."""

PATIENCE = 4.0
"""Seconds that a command has to end by itself."""

LAST = 2.0
"""Seconds that what is said at last may take."""

_last_words: list[Callable[[], None]] = []
_struck, _told = threading.Event(), threading.Lock()


@contextmanager
def last_words(say: Callable[[], None]) -> Iterator[None]:
    """Have `say` called, in any thread, if Ctrl-C ends the process while this lasts before it ends by itself."""
    _last_words.append(say)
    try:
        yield
    finally:
        _last_words.remove(say)


def interrupted(error: BaseException) -> bool:
    """Whether Ctrl-C is behind an error, whatever became of it on the way."""
    return isinstance(error, KeyboardInterrupt) or _struck.is_set()


def guarded(work: Callable[[], int]) -> int:
    """The exit code of `work`, or 130 where Ctrl-C ended it; a second Ctrl-C ends the process at once."""
    struck, timer = _struck, threading.Timer(PATIENCE, _end)
    struck.clear()
    if _told.locked():
        _told.release()
    timer.daemon = True

    def strike(number: int, frame: FrameType | None) -> None:
        if struck.is_set():
            _end()
        struck.set()
        # Python would print an interrupt that strikes while something is disposed of
        sys.unraisablehook = lambda _: None
        timer.start()
        raise KeyboardInterrupt

    alone = threading.current_thread() is threading.main_thread()
    before, hook = signal.signal(signal.SIGINT, strike) if alone else None, sys.unraisablehook
    try:
        code = work()
        if not struck.is_set():
            return code
    except BaseException as error:
        if not struck.is_set() and not isinstance(error, KeyboardInterrupt):
            raise
    finally:
        timer.cancel()
        sys.unraisablehook = hook
        if alone:
            signal.signal(signal.SIGINT, before)
    _tell()
    return INTERRUPTED


def leave(code: int) -> None:
    """End the process. After an interrupt nothing is disposed of: libraries would complain, and Python would die of
    the signal instead where it struck in an `exec`."""
    if code == INTERRUPTED:
        sys.stdout.flush()
        os._exit(code)
    sys.exit(code)


def _tell() -> None:
    """Say it, once, though a thread and the command may end at the same moment."""
    if not _told.acquire(blocking=False):
        return
    print("interrupted: what was finished is kept, nothing is half written; run the same command again to continue",
          file=sys.stderr, flush=True)


def _end() -> None:
    """End the process where it stands: what it writes is written aside and renamed, and its children follow it."""
    _tell()
    for say in tuple(_last_words):
        speaking = threading.Thread(target=say, daemon=True)
        speaking.start()
        speaking.join(LAST)
    os._exit(INTERRUPTED)
