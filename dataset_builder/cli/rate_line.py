"""How far bytes are: a line that is written over on a terminal, and elsewhere a new one now and then. Who only reads
datasets has no library for bars."""

import sys
from datetime import timedelta
from time import monotonic

from dataset_builder.files import size_text

OFTEN, SELDOM = 0.2, 60.0
"""Seconds between two lines, on a terminal and elsewhere."""
WIDTH = 70


class RateLine:
    """The line, on standard error."""

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._begun = self._last = monotonic()

    def told(self, done: int, of: int, rate: float | None = None) -> None:
        """Show it, unless it was shown just now. rate: bytes per second, those since the beginning unless given."""
        now = monotonic()
        if now - self._last < (OFTEN if self._terminal else SELDOM):
            return
        self._last = now
        text = rate_text(done, of, done / max(now - self._begun, 1e-3) if rate is None else rate)
        print(f"\r{text:<{WIDTH}}" if self._terminal else text, end="" if self._terminal else "\n", file=sys.stderr,
              flush=True)

    def close(self) -> None:
        """Clear it."""
        if self._terminal:
            print(f"\r{'':<{WIDTH}}\r", end="", file=sys.stderr, flush=True)


def rate_text(done: int, of: int, rate: float) -> str:
    """Bytes, bytes per second, and time left at that rate; where nobody knows yet how many there will be, only that.

    >>> rate_text(250_000_000, 1_000_000_000, 50e6)
    '238.4 MiB of 953.7 MiB, 47.7 MiB/s, 0:00:15 left'
    """
    if not of:
        return "looking at indexes"
    left = f"{timedelta(seconds=round((of - done) / rate))} left" if rate else "looking"
    return f"{size_text(done)} of {size_text(of)}, {size_text(rate)}/s, {left}"
