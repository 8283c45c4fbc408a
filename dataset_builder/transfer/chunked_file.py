"""A file that comes in chunks, in any order, over several runs: what of it is there is known by hash, not by length."""

import os
from collections.abc import Iterable
from pathlib import Path

from dataset_builder.digest import sha256_bytes

CHUNK_SIZE = 8 * 2**20
"""Bytes of a chunk: large against what a request costs, small against what a lost one does."""

LONGEST = 12
"""Digits of a chunk's number."""


class ChunkedFile:
    """`path`, which is to have `size` bytes, and beside it a journal of the chunks that are there, with their hashes.

    A chunk of an earlier run counts where the file still has the bytes that the journal says. Both files belong to one
    content, which their name tells.
    """

    def __init__(self, path: Path, size: int, *, chunk_size: int = CHUNK_SIZE):
        self._path, self._size, self._chunk = path, size, chunk_size
        self._journal_path = path.with_name(f"{path.name}.chunks")
        path.parent.mkdir(parents=True, exist_ok=True)
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        self._there = self._known()
        # Rewritten, since a line may be torn or no longer true
        self._write_journal(os.O_TRUNC, (f"{number} {sha256}" for number, sha256 in self._there.items()))

    def close(self) -> None:
        """Close the file; again is no mistake."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    @property
    def missing(self) -> list[int]:
        """Numbers of the chunks that are not there."""
        return [number for number in range(self._count) if number not in self._there]

    def span(self, number: int) -> tuple[int, int]:
        """First byte and size of a chunk."""
        start = number * self._chunk
        return start, min(self._chunk, self._size - start)

    def put(self, number: int, data: bytes) -> None:
        """Keep a chunk."""
        start, size = self.span(number)
        if len(data) != size:
            raise EOFError(f"expected {size} bytes from byte {start}, got {len(data)}")
        written = 0
        while written < size:
            written += os.pwrite(self._descriptor, data[written:], start + written)
        self._there[number] = sha256_bytes(data)
        self._write_journal(os.O_APPEND, [f"{number} {self._there[number]}"])

    def forget(self, first: int, last: int) -> None:
        """Let the chunks go that have a byte of `first` to `last`, the latter left out."""
        wrong = range(first // self._chunk, -(-last // self._chunk))
        self._there = {number: sha256 for number, sha256 in self._there.items() if number not in wrong}
        self._write_journal(os.O_TRUNC, (f"{number} {sha256}" for number, sha256 in self._there.items()))

    def finish(self, final: Path) -> None:
        """Flush the file and give it its name."""
        os.fsync(self._descriptor)
        final.parent.mkdir(parents=True, exist_ok=True)
        os.replace(self._path, final)
        self._journal_path.unlink(missing_ok=True)

    @property
    def _count(self) -> int:
        return -(-self._size // self._chunk)

    def _known(self) -> dict[int, str]:
        found = dict[int, str]()
        if self._journal_path.is_file() and not self._journal_path.is_symlink():
            for line in self._journal_path.read_text(errors="replace").splitlines():
                number, _, sha256 = line.partition(" ")
                # Of text that somebody else wrote no number is made that is beyond all
                if number.isdecimal() and len(number) < LONGEST and int(number) < self._count \
                        and self._has(int(number), sha256):
                    found[int(number)] = sha256
        # What lies beyond is of nobody
        os.ftruncate(self._descriptor, self._size)
        return found

    def _has(self, number: int, sha256: str) -> bool:
        start, size = self.span(number)
        return sha256_bytes(os.pread(self._descriptor, size, start)) == sha256

    def _write_journal(self, how: int, lines: Iterable[str]) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | how
        with open(os.open(self._journal_path, flags, 0o666), "w") as stream:
            stream.writelines(f"{line}\n" for line in lines)
