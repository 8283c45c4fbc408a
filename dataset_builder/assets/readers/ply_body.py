"""The numbers of a PLY file after its header: of text or binary, found by their positions."""

from collections.abc import Callable
from itertools import accumulate
from pathlib import Path
from struct import Struct
from typing import Protocol

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.polygon_checks import numbers_of
from dataset_builder.spec.ply_references import PlyHeader
from dataset_builder.spec.problems import shown

STRUCT = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q"}
CHUNK = 2**20
"""Values that are gathered at once."""


class PlyBody(Protocol):
    """Numbers at positions, which are bytes in binary files and words in text. Kinds are types as NumPy names them."""

    length: int
    """Of all that there is."""

    def size(self, kind: str) -> int:
        """What a number takes."""

    def lengths(self, kind: str) -> Callable[[int], int]:
        """What reads the length of a list at a position; below 0 for what is none. Raises IndexError or struct.error
        behind the end."""

    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]:
        """Columns of (kind, how many) from `start` on, each (count, how many), not yet typed."""

    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray:
        """(N,) numbers at (N,) positions, not yet typed."""

    def typed(self, values: np.ndarray, kind: str) -> np.ndarray:
        """The values as numbers of a kind. Raises UserError for text that is none."""


def ply_body(path: Path, data: bytes, header: PlyHeader) -> PlyBody:
    """What follows the header of a file. Raises UserError for text that holds anything but numbers."""
    return _Binary(data, header) if header.order else _text(path, data, header)


class _Binary:
    def __init__(self, data: bytes, header: PlyHeader):
        self._view, self._order = memoryview(data)[header.size:], header.order
        self._bytes = np.frombuffer(self._view, np.uint8)
        self.length = len(data) - header.size

    def size(self, kind: str) -> int:
        return int(kind[1])

    def lengths(self, kind: str) -> Callable[[int], int]:
        if kind == "u1":
            return self._view.__getitem__
        parse = Struct(self._order + STRUCT[kind]).unpack_from
        return lambda position: parse(self._view, position)[0]

    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]:
        dtype = np.dtype([(f"c{number}", self._order + kind, (many,)) for number, (kind, many) in enumerate(columns)])
        table = np.frombuffer(self._view, dtype, count, start)
        return [table[f"c{number}"] for number in range(len(columns))]

    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray:
        size = int(kind[1])
        found = np.empty((len(positions), size), np.uint8)
        for first in range(0, len(positions), CHUNK):
            found[first:first + CHUNK] = self._bytes[positions[first:first + CHUNK, None] + np.arange(size)]
        return found.reshape(-1).view(self._order + kind)

    def typed(self, values: np.ndarray, kind: str) -> np.ndarray:
        return values


class _Text:
    def __init__(self, path: Path, words: np.ndarray):
        self._path, self._words = path, words
        self.length = len(words)

    def size(self, kind: str) -> int:
        return 1

    def lengths(self, kind: str) -> Callable[[int], int]:
        words = self._words

        def length(position: int) -> int:
            value = words[position]
            return int(value) if value == np.floor(value) and value < 2**53 else -1
        return length

    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]:
        width = sum(many for _, many in columns)
        table = self._words[start:start + count * width].reshape(count, width)
        ends = [*accumulate(many for _, many in columns)]
        return [table[:, end - many:end] for end, (_, many) in zip(ends, columns, strict=True)]

    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray:
        return self._words[positions]

    def typed(self, values: np.ndarray, kind: str) -> np.ndarray:
        if kind[0] == "f":
            return values
        limits = np.iinfo(kind)
        wrong = values[~((np.floor(values) == values) & (values > limits.min - 1.0) & (values < limits.max + 1.0))]
        if len(wrong):
            refuse(self._path, f"expected whole numbers in [{limits.min}, {limits.max}], got {len(wrong)} others, "
                               f"first {wrong[0]:.10g}")
        return values.astype(kind)


def _text(path: Path, data: bytes, header: PlyHeader) -> _Text:
    words = numbers_of(data[header.size:])
    if words is not None:
        return _Text(path, words)
    first = len(data[:header.size].splitlines())
    for number, line in enumerate(data[header.size:].splitlines(), start=first + 1):
        if numbers_of(line) is None:
            refuse(path, f"expected numbers, got {shown(line.decode('latin-1'))}", at=f"line {number}")
    refuse(path, "expected numbers, got something else")
