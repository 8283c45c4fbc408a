"""The data of a PLY file: a table for each element, of text or of binary numbers, lists of any length included."""

import warnings
from array import array
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import NoReturn, Protocol

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.spec.ply_references import PlyElement, PlyHeader, PlyProperty
from dataset_builder.spec.problems import shown

CHUNK = 2**20
"""Values that are gathered at once."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lists:
    """A column of lists."""

    counts: np.ndarray
    """(N,) int64 lengths."""
    values: np.ndarray
    """(sum of counts,) all of them, one after the other."""


Table = dict[str, np.ndarray | Lists]
"""Columns by name, single values as (N,)."""


class _Body(Protocol):
    """Numbers at positions, which are bytes in binary files and words in text."""

    length: int

    def size(self, kind: str) -> int: ...
    def length_at(self, position: int, kind: str) -> int: ...
    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]: ...
    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray: ...


def ply_tables(path: Path, data: bytes, header: PlyHeader) -> dict[str, Table]:
    """Every element of a file by its name. Raises UserError where the data are not what the header declares."""
    body: _Body = _Binary(data, header) if header.order else _text(path, data, header)
    tables: dict[str, Table] = {}
    position = 0
    for element in header.elements:
        tables[element.name], position = _table(path, body, element, position)
    rest = body.length - position
    if rest and (not isinstance(body, _Binary) or data[header.size + position:].strip()):
        unit = "bytes" if header.order else "numbers"
        refuse(path, f"expected {position} {unit} of data, as the header declares, got {body.length}")
    return tables


class _Binary:
    def __init__(self, data: bytes, header: PlyHeader):
        self._data, self._order, self._start = data, header.order, header.size
        self._bytes = np.frombuffer(data, np.uint8)
        self.length = len(data) - header.size

    def size(self, kind: str) -> int:
        return int(kind[1])

    def length_at(self, position: int, kind: str) -> int:
        start = self._start + position
        value = self._data[start:start + int(kind[1])]
        return int.from_bytes(value, "little" if self._order == "<" else "big", signed=kind[0] == "i")

    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]:
        dtype = np.dtype([(f"c{number}", self._order + kind, (many,)) for number, (kind, many) in enumerate(columns)])
        table = np.frombuffer(self._data, dtype, count, self._start + start)
        return [table[f"c{number}"] for number in range(len(columns))]

    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray:
        size = int(kind[1])
        found = np.empty((len(positions), size), np.uint8)
        for first in range(0, len(positions), CHUNK):
            part = positions[first:first + CHUNK, None] + (self._start + np.arange(size))
            found[first:first + CHUNK] = self._bytes[part]
        return found.reshape(-1).view(self._order + kind)


class _Text:
    def __init__(self, path: Path, words: np.ndarray):
        self._path, self._words = path, words
        self.length = len(words)

    def size(self, kind: str) -> int:
        return 1

    def length_at(self, position: int, kind: str) -> int:
        value = self._words[position] if position < self.length else 0.0
        return int(value) if value == np.floor(value) and abs(value) < 2**53 else -1

    def rows(self, start: int, count: int, columns: list[tuple[str, int]]) -> list[np.ndarray]:
        width = sum(many for _, many in columns)
        table = self._words[start:start + count * width].reshape(count, width)
        ends = [*accumulate(many for _, many in columns)]
        return [self._typed(table[:, end - many:end], kind) for end, (kind, many) in zip(ends, columns, strict=True)]

    def gathered(self, positions: np.ndarray, kind: str) -> np.ndarray:
        return self._typed(self._words[positions], kind)

    def _typed(self, values: np.ndarray, kind: str) -> np.ndarray:
        if kind[0] == "f":
            return values
        limits = np.iinfo(kind)
        wrong = values[~((np.floor(values) == values) & (values > limits.min - 1.0) & (values < limits.max + 1.0))]
        if len(wrong):
            refuse(self._path, f"expected whole numbers in [{limits.min}, {limits.max}], got {len(wrong)} others, "
                               f"first {wrong[0]:.10g}")
        return values.astype(kind)


def numbers_of(text: bytes) -> np.ndarray | None:
    """(N,) float64 numbers of a text with blanks between them; None where something else stands in it."""
    if not text.strip():
        return np.zeros(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.fromstring(text, dtype=np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        return None


def _text(path: Path, data: bytes, header: PlyHeader) -> _Text:
    words = numbers_of(data[header.size:])
    if words is not None:
        return _Text(path, words)
    first = len(data[:header.size].splitlines())
    for number, line in enumerate(data[header.size:].splitlines(), start=first + 1):
        if numbers_of(line) is None:
            refuse(path, f"expected numbers, got {shown(line.decode('latin-1'))}", at=f"line {number}")
    refuse(path, "expected numbers, got something else")


def _table(path: Path, body: _Body, element: PlyElement, start: int) -> tuple[Table, int]:
    """The table of an element, and where the next begins."""
    columns = element.properties
    if not columns or not element.count:
        empty = Lists(counts=np.zeros(0, np.int64), values=np.zeros(0))
        return {each.name: empty if each.count_type else np.zeros(0) for each in columns}, start
    lengths, end = _first_row(path, body, element, start)
    width = end - start
    if width * element.count <= body.length - start:
        kinds = [(each.count_type or each.type, 1) for each in columns]
        wide = [part for each, kind, many in zip(columns, kinds, lengths, strict=True)
                for part in ((kind, (each.type, many)) if each.count_type else (kind,))]
        rows = iter(body.rows(start, element.count, wide))
        table: Table = {}
        for each, many in zip(columns, lengths, strict=True):
            first = next(rows)[:, 0]
            if not each.count_type:
                table[each.name] = first
                continue
            values = next(rows)
            if (first != many).any():
                break
            table[each.name] = Lists(counts=np.full(element.count, many), values=values.reshape(-1))
        else:
            return table, start + width * element.count
    elif not any(each.count_type for each in columns):
        _too_few(path, element, (body.length - start) // width)
    return _walked(path, body, element, start)


def _first_row(path: Path, body: _Body, element: PlyElement, start: int) -> tuple[list[int], int]:
    """Length of each list of a table's first row (0 for single values), and where the row ends."""
    lengths, position = [], start
    for each in element.properties:
        many = body.length_at(position, each.count_type) if each.count_type else 0
        lengths.append(_at_least_zero(path, element, 0, each, many))
        head = body.size(each.count_type) if each.count_type else 0
        position += head + (many if each.count_type else 1) * body.size(each.type)
        if position > body.length:
            _too_few(path, element, 0)
    return lengths, position


def _walked(path: Path, body: _Body, element: PlyElement, start: int) -> tuple[Table, int]:
    """The table whose rows differ in length: each is found where the one before it ends."""
    lists = [each for each in element.properties if each.count_type]
    before = [0] * (len(lists) + 1)
    """Size of the single values in front of each list, and behind the last."""
    at = 0
    offsets: dict[str, tuple[int, int]] = {}
    for each in element.properties:
        if each.count_type:
            at += 1
        else:
            offsets[each.name] = at, before[at]
            before[at] += body.size(each.type)
    steps = [(skip, each.count_type, body.size(each.count_type), body.size(each.type))
             for skip, each in zip(before, lists, strict=False)]
    starts, counts = [array("q") for _ in lists], [array("q") for _ in lists]
    targets = [(*step, firsts.append, many.append) for step, firsts, many in zip(steps, starts, counts, strict=True)]
    position, tail, length, length_at = start, before[-1], body.length, body.length_at
    for row in range(element.count):
        for skip, kind, head, item, add_start, add_count in targets:
            position += skip
            many = length_at(position, kind)
            if many < 0:
                _at_least_zero(path, element, row, lists[0], many)
            first, position = position + head, position + head + many * item
            if position > length:
                _too_few(path, element, row)
            add_start(first)
            add_count(many)
        position += tail
    if position > length:
        _too_few(path, element, element.count - 1)
    table = _gathered(body, element, lists, starts, counts)
    ends = [np.full(element.count, 0), *(np.array(first) + np.array(many) * body.size(each.type)
                                         for each, first, many in zip(lists, starts, counts, strict=True))]
    ends[0] = np.array(starts[0]) - steps[0][0] - steps[0][2]
    for each in element.properties:
        if not each.count_type:
            group, offset = offsets[each.name]
            table[each.name] = body.gathered(ends[group] + offset, each.type)
    return table, position


def _gathered(body: _Body, element: PlyElement, lists: list[PlyProperty], starts: "list[array[int]]",
              counts: "list[array[int]]") -> Table:
    """The columns of lists that begin at `starts`."""
    table: Table = {}
    for each, first, many in zip(lists, starts, counts, strict=True):
        lengths = np.array(many, dtype=np.int64)
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        positions = np.repeat(np.array(first, dtype=np.int64), lengths) + within * body.size(each.type)
        table[each.name] = Lists(counts=lengths, values=body.gathered(positions, each.type))
    return table


def _at_least_zero(path: Path, element: PlyElement, row: int, column: PlyProperty, many: int) -> int:
    if many < 0:
        refuse(path, f"expected lists of 0 or more values, got one whose length is negative or no whole number, in "
                     f"{element.name} {row}", at=column.name)
    return many


def _too_few(path: Path, element: PlyElement, got: int) -> NoReturn:
    rows = "faces" if element.name == "face" else "vertices" if element.name == "vertex" else f"{element.name} rows"
    refuse(path, f"expected {element.count} {rows}, as the header declares, got {got}; the file is cut short")
