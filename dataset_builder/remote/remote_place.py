"""A folder of files at an address: every transfer is checked, tried again where that may help, and bounded.

Connections belong to a process and are made when they are first needed, so that a place can be pickled, and used after
a fork. Requests run on fsspec's own event loop, in a thread that ends with the process.
"""

import asyncio
import errno
import os
from collections.abc import Coroutine, Iterator, Sequence
from typing import Any, Protocol, TypeVar

from dataset_builder.remote.address import scrubbed, shown
from dataset_builder.remote.patience import PROGRESS, Fetch, Patience, TransientError
from dataset_builder.remote.place import ByteRange

STREAM_BYTES = 1 << 22
"""Of a file that is read from start to end, at a time."""
LONGEST_NAME = 1024

T = TypeVar("T")
_left_by_parent: list[object] = []
"""Connections that a fork took along. They are the parent's: closing them here would end them there."""


class Fetcher(Protocol):
    """Who speaks with a server. Not to be used in another process than the one that made it."""

    async def receive(self, fetch: Fetch) -> None:
        """Add what is wanted, or a part of it, to `fetch.data`; returns when all is there.

        Raises TransientError where another attempt may help, else OSError (FileNotFoundError, PermissionError), and
        EndedError.
        """


class RemotePlace:
    """A folder at an address; see `Place`. What fails is tried again as `patience` says."""

    def __init__(self, address: str, patience: Patience):
        self._address, self._patience = address, patience
        self._made: tuple[int, Fetcher, asyncio.Semaphore] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return RemotePlace, (self._address, self._patience)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RemotePlace) and self.__reduce__() == other.__reduce__()

    def __hash__(self) -> int:
        return hash((self._address, self._patience))

    def __repr__(self) -> str:
        return f"RemotePlace({self.title!r})"

    @property
    def title(self) -> str:
        """The address, without passwords and keys."""
        return shown(self._address)

    def size(self, name: str) -> int:
        """Bytes of a file."""
        return self.sizes([name])[0]

    def sizes(self, names: Sequence[str]) -> list[int]:
        """Bytes of some files."""
        return [head.total or 0 for head in self._heads(names)]

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file of at most `most` bytes."""
        return self.files([(name, most)])[0]

    def files(self, wanted: Sequence[tuple[str, int]]) -> list[bytes]:
        """Some whole files, fetched side by side."""
        fetches = [Fetch(name=name, most=most) for name, most in wanted]
        self._all(fetches)
        return [bytes(fetch.data) for fetch in fetches]

    def ranges(self, wanted: Sequence[ByteRange]) -> list[bytes]:
        """Pieces of files, in order, fetched side by side."""
        fetches = [Fetch(name=piece.name, start=piece.start, size=piece.size, most=piece.size) for piece in wanted]
        self._all(fetches)
        return [bytes(fetch.data) for fetch in fetches]

    def stream(self, name: str, *, start: int = 0) -> Iterator[bytes]:
        """A file from byte `start` to its end. Raises OSError, too, where it changes meanwhile."""
        head, = self._heads([name])
        for begin in range(start, head.total or 0, STREAM_BYTES):
            size = min(STREAM_BYTES, (head.total or 0) - begin)
            fetch = Fetch(name=name, start=begin, size=size, most=size, mark=head.mark, pinned=True)
            self._all([fetch])
            yield bytes(fetch.data)

    def _heads(self, names: Sequence[str]) -> list[Fetch]:
        """Fetches of the first byte of some files, which tell their sizes."""
        heads = [Fetch(name=name, size=1, most=1, head=True) for name in names]
        self._all(heads)
        for head in heads:
            if head.total is None:
                raise OSError(errno.EPROTO, "the server does not tell its size in bytes", self._file(head.name))
        return heads

    def _all(self, fetches: Sequence[Fetch]) -> None:
        for fetch in fetches:
            _require_name(fetch.name)
        _run(self._side_by_side([fetch for fetch in fetches if fetch.size != 0]))

    async def _side_by_side(self, fetches: Sequence[Fetch]) -> None:
        fetcher, turn = self._connection()
        try:
            async with asyncio.TaskGroup() as group:
                for fetch in fetches:
                    group.create_task(self._patiently(fetcher, fetch, turn))
        except BaseExceptionGroup as failed:
            # All but the first are consequences, or as good
            raise failed.exceptions[0] from None

    async def _patiently(self, fetcher: Fetcher, fetch: Fetch, turn: asyncio.Semaphore) -> None:
        failures, tried, before = 0, 0, 0
        while True:
            try:
                async with turn:
                    await fetcher.receive(fetch)
                return
            except TransientError as error:
                tried += 1
                failures = 1 if len(fetch.data) - before >= PROGRESS else failures + 1
                before = len(fetch.data)
                if failures >= self._patience.attempts:
                    rule = f"{error}; tried {tried} times: try again later"
                    raise OSError(errno.EIO, rule, self._file(fetch.name)) from error
                await asyncio.sleep(self._patience.wait(failures, error.after))
            except EOFError:
                # An empty file has no first byte
                if fetch.head and fetch.total == 0:
                    return
                raise
            except OSError as error:
                # With the class that the number stands for, such as FileNotFoundError
                raise OSError(error.errno or errno.EIO, error.strerror or str(error), self._file(fetch.name)) from error

    def _file(self, name: str) -> str:
        return f"{self.title}/{name}"

    def _connection(self) -> tuple[Fetcher, asyncio.Semaphore]:
        if self._made is None or self._made[0] != os.getpid():
            _left_by_parent.append(self._made)
            self._made = (os.getpid(), self._connected(), asyncio.Semaphore(self._patience.side_by_side))
        return self._made[1:]

    def _connected(self) -> Fetcher:
        scheme = self._address.partition("://")[0].lower()
        if scheme in ("http", "https"):
            from dataset_builder.remote.strict_http import StrictHttp

            return StrictHttp(address=self._address, patience=self._patience)
        from dataset_builder.remote.object_store import ObjectStore

        return ObjectStore(self._address, self._patience)


def _run(work: Coroutine[Any, Any, T]) -> T:
    """The result of what runs on fsspec's loop; Ctrl-C ends it there, too."""
    from fsspec.asyn import get_loop

    future = asyncio.run_coroutine_threadsafe(work, get_loop())
    try:
        return future.result()
    except BaseException:
        future.cancel()
        raise


def _require_name(name: str) -> None:
    """Raise OSError where a name leads out of its place."""
    parts = name.split("/")
    if not name.isprintable() or "\\" in name or len(name) > LONGEST_NAME or {"", ".", ".."} & set(parts):
        raise OSError(errno.EINVAL, "expected a name of a file inside the folder", scrubbed(name)[:80])
