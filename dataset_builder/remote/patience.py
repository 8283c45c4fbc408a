"""How often, and for how long, what failed at an address is tried again; and what one transfer has so far."""

import errno
from dataclasses import dataclass, field

from dataset_builder.remote.place import ByteRange

PROGRESS = 1 << 14
"""Bytes that count as progress: fewer of them in `Patience.stall` seconds are a stall."""


class TransientError(Exception):
    """What may go better another time. after: seconds that the server asks to wait, if it does."""

    def __init__(self, rule: str, after: float | None = None):
        super().__init__(rule)
        self.after = after


@dataclass(frozen=True, kw_only=True)
class Patience:
    """When to try again, and when to give up. Waits depend on the number of the attempt alone."""

    attempts: int = 6
    """In a row without progress."""
    stall: float = 30.0
    """Seconds without progress after which an attempt is given up, also of connecting."""
    first: float = 0.5
    """Seconds before the second attempt; each further wait is twice as long."""
    longest: float = 60.0
    """Seconds of the longest wait, also where a server asks for more."""
    side_by_side: int = 16
    """Requests at a time."""

    def wait(self, failures: int, after: float | None = None) -> float:
        """Seconds to wait after so many failures in a row.

        >>> [Patience().wait(failures) for failures in (1, 2, 3, 99)]
        [0.5, 1.0, 2.0, 60.0]
        """
        return min(max(self.first * 2.0 ** min(failures - 1, 32), after or 0.0), self.longest)


PATIENCE = Patience()


@dataclass(kw_only=True, eq=False)
class Fetch:
    """One piece of a file, or a file from `start` on, and what has come of it."""

    name: str
    start: int = 0
    size: int | None = None
    """Bytes; None for all that follow."""
    most: int
    """More bytes are refused."""
    head: bool = False
    """Whether it is the size of the file that is asked for."""
    mark: str = ""
    """What tells this version of the file from others (ETag, or time of change): as asked for, or as it was answered
    first."""
    pinned: bool = False
    """Whether another version is an error; else the piece is begun anew."""
    total: int | None = None
    """Bytes of the whole file, once that is known."""
    data: bytearray = field(default_factory=bytearray)

    @property
    def next(self) -> int:
        """The byte of the file that is wanted next."""
        return self.start + len(self.data)

    @property
    def end(self) -> int | None:
        """The byte of the file that follows the piece, where that is known."""
        return None if self.size is None else self.start + self.size

    @property
    def piece(self) -> ByteRange:
        """What was asked for, to say so."""
        return ByteRange(self.name, self.start, self.most if self.size is None else self.size)

    def see(self, mark: str, total: int | None) -> None:
        """Take note of an answer's version. Raises OSError or TransientError where it is another one than before; then
        nothing of the other one is kept."""
        if self.mark and mark and mark != self.mark:
            self.data.clear()
            if self.pinned:
                raise OSError(errno.ESTALE, "changed meanwhile: open it again to read what is there now")
            self.mark = ""
            raise TransientError("changed meanwhile")
        self.mark, self.total = self.mark or mark, total
