"""A folder of files, wherever it is: what every reader of datasets asks for bytes."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from dataset_builder.digest import CHUNK_BYTES, open_regular, read_regular


class ByteRange(NamedTuple):
    """Bytes `start` to `start + size` of the file called `name`."""

    name: str
    start: int
    size: int


class EndedError(EOFError):
    """A file ends before a piece of it does."""

    def __init__(self, piece: ByteRange, there: int):
        """there: bytes of the piece that the file has."""
        super().__init__(f"expected {piece.size} bytes from byte {piece.start}, the file ends after {there}")
        self.piece, self.there = piece, there


class Place(Protocol):
    """A folder of files. Names are relative, with slashes.

    Every method raises FileNotFoundError where there is no such file, another OSError where it cannot be read, also
    after being tried again as often as a place thinks right.
    """

    @property
    def title(self) -> str:
        """What messages call it: a path, or an address without passwords and keys."""

    def size(self, name: str) -> int:
        """Bytes of a file."""

    def sizes(self, names: Sequence[str]) -> list[int]:
        """Bytes of some files, in order."""

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file. Raises OSError where it has more than `most` bytes, without fetching many more."""

    def files(self, wanted: Sequence[tuple[str, int]]) -> list[bytes]:
        """Whole files, in order, by name and the most bytes that each may have; as `read`."""

    def ranges(self, wanted: Sequence[ByteRange]) -> list[bytes]:
        """Pieces of files, in order, fetched side by side where that pays. Raises EndedError where a file ends
        before one of them does."""

    def stream(self, name: str, *, start: int = 0) -> Iterator[bytes]:
        """A file from byte `start` to its end, chunk by chunk."""


@dataclass(frozen=True)
class FolderPlace:
    """A folder on this machine. Only regular files are opened, and none stays open."""

    folder: Path

    @property
    def title(self) -> str:
        """The path as it was given."""
        return str(self.folder)

    def size(self, name: str) -> int:
        """Bytes of a file."""
        with open_regular(self.folder / name) as stream:
            return os.fstat(stream.fileno()).st_size

    def sizes(self, names: Sequence[str]) -> list[int]:
        """Bytes of some files."""
        return [self.size(name) for name in names]

    def read(self, name: str, *, most: int) -> bytes:
        """A whole file of at most `most` bytes."""
        return read_regular(self.folder / name, most=most)

    def files(self, wanted: Sequence[tuple[str, int]]) -> list[bytes]:
        """Some whole files."""
        return [self.read(name, most=most) for name, most in wanted]

    def ranges(self, wanted: Sequence[ByteRange]) -> list[bytes]:
        """Pieces of files, in order; a file is opened once for neighbours in the list."""
        found, name, stream = list[bytes](), "", None
        try:
            for piece in wanted:
                if stream is None or piece.name != name:
                    if stream is not None:
                        stream.close()
                    name, stream = piece.name, open_regular(self.folder / piece.name)
                found.append(_piece(stream.fileno(), piece))
        finally:
            if stream is not None:
                stream.close()
        return found

    def stream(self, name: str, *, start: int = 0) -> Iterator[bytes]:
        """A file from byte `start` to its end."""
        with open_regular(self.folder / name) as stream:
            stream.seek(start)
            while chunk := stream.read(CHUNK_BYTES):
                yield chunk


def _piece(descriptor: int, piece: ByteRange) -> bytes:
    # An index may ask for more than there is memory
    there = max(os.fstat(descriptor).st_size - piece.start, 0)
    data = os.pread(descriptor, min(piece.size, there), piece.start)
    if len(data) != piece.size:
        raise EndedError(piece, len(data))
    return data
