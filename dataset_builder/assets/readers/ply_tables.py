"""The data of a PLY file: a table for each element, lists of any length included."""

from array import array
from dataclasses import dataclass
from pathlib import Path
from struct import error
from typing import NoReturn

import numpy as np

from dataset_builder.assets.file_model import refuse
from dataset_builder.assets.readers.ply_body import PlyBody, ply_body
from dataset_builder.spec.ply_references import PlyElement, PlyHeader, PlyProperty


@dataclass(frozen=True, kw_only=True, eq=False)
class Lists:
    """A column of lists."""

    counts: np.ndarray
    """(N,) int64 lengths."""
    values: np.ndarray
    """(sum of counts,) all of them, one after the other."""


Table = dict[str, np.ndarray | Lists]
"""Columns by name, single values as (N,)."""


def ply_tables(path: Path, data: bytes, header: PlyHeader) -> dict[str, Table]:
    """Every element of a file by its name. Raises UserError where the data are not what the header declares."""
    body = ply_body(path, data, header)
    tables: dict[str, Table] = {}
    position = 0
    for element in header.elements:
        tables[element.name], position = _table(path, body, element, position)
    rest = body.length - position
    if rest and not (header.order and not data[header.size + position:].strip()):
        unit = "bytes" if header.order else "numbers"
        refuse(path, f"expected {position} {unit} of data, as the header declares, got {body.length}")
    return tables


def _table(path: Path, body: PlyBody, element: PlyElement, start: int) -> tuple[Table, int]:
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
            values = next(rows).reshape(-1)
            if (first != many).any():
                break
            table[each.name] = Lists(counts=np.full(element.count, many), values=values)
        else:
            return _typed(body, element, table), start + width * element.count
    elif not any(each.count_type for each in columns):
        _too_few(path, element, (body.length - start) // width)
    return _walked(path, body, element, start)


def _first_row(path: Path, body: PlyBody, element: PlyElement, start: int) -> tuple[list[int], int]:
    """Length of each list of a table's first row (0 for single values), and where the row ends."""
    lengths, position = [], start
    for each in element.properties:
        try:
            many = body.lengths(each.count_type)(position) if each.count_type else 0
        except (IndexError, error):
            _too_few(path, element, 0)
        lengths.append(_at_least_zero(path, element, 0, each, many))
        head = body.size(each.count_type) if each.count_type else 0
        position += head + (many if each.count_type else 1) * body.size(each.type)
        if position > body.length:
            _too_few(path, element, 0)
    return lengths, position


def _walked(path: Path, body: PlyBody, element: PlyElement, start: int) -> tuple[Table, int]:
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
    found = [array("q") for _ in lists]
    steps = [(skip, body.lengths(each.count_type), body.size(each.count_type), body.size(each.type), each, at.append)
             for skip, each, at in zip(before, lists, found, strict=False)]
    position, tail, length, row = start, before[-1], body.length, 0
    try:
        for row in range(element.count):
            for skip, length_at, head, item, each, add in steps:
                position += skip
                many = length_at(position)
                if many < 0:
                    _at_least_zero(path, element, row, each, many)
                add(position)
                position += head + many * item
            position += tail
            if position > length:
                _too_few(path, element, row)
    except (IndexError, OverflowError, error):
        _too_few(path, element, row)
    starts = [np.frombuffer(at, np.int64) for at in found]
    table, ends = Table(), [starts[0] - before[0]]
    for each, heads in zip(lists, starts, strict=True):
        lengths = body.gathered(heads, each.count_type).astype(np.int64)
        table[each.name] = _gathered(body, each, heads + body.size(each.count_type), lengths)
        ends.append(heads + body.size(each.count_type) + lengths * body.size(each.type))
    for each in element.properties:
        if not each.count_type:
            group, offset = offsets[each.name]
            table[each.name] = body.gathered(ends[group] + offset, each.type)
    return _typed(body, element, table), position


def _typed(body: PlyBody, element: PlyElement, table: Table) -> Table:
    """The table with every column of the type that the header gives it, in the header's order."""
    made: Table = {}
    for each in element.properties:
        column = table[each.name]
        made[each.name] = Lists(counts=column.counts, values=body.typed(column.values, each.type)) if isinstance(
            column, Lists) else body.typed(column, each.type)
    return made


def _gathered(body: PlyBody, column: PlyProperty, starts: np.ndarray, lengths: np.ndarray) -> Lists:
    """The column of lists whose values begin at `starts`."""
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    within *= body.size(column.type)
    within += np.repeat(starts, lengths)
    return Lists(counts=lengths, values=body.gathered(within, column.type))


def _at_least_zero(path: Path, element: PlyElement, row: int, column: PlyProperty, many: int) -> int:
    if many < 0:
        refuse(path, f"expected lists of 0 or more values, got one whose length is negative or no whole number, in "
                     f"{element.name} {row}", at=column.name)
    return many


def _too_few(path: Path, element: PlyElement, got: int) -> NoReturn:
    rows = "faces" if element.name == "face" else "vertices" if element.name == "vertex" else f"{element.name} rows"
    refuse(path, f"expected {element.count} {rows}, as the header declares, got {got}; the file is cut short")
