"""Rows as CSV files."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from math import isfinite
from pathlib import Path

from dataset_builder.errors import cell
from dataset_builder.files import write_atomic


def comma_separated(columns: Sequence[str], rows: Iterable[Sequence[object]], digits: int = 6) -> bytes:
    """A head and rows; floats to so many digits, empty where they are not finite.

    >>> comma_separated(("a", "b"), [(1, 0.123456789), ("x", float("nan"))])
    b'a,b\\n1,0.123457\\nx,\\n'
    """
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_text(value, digits) for value in row] for row in rows)
    return stream.getvalue().encode()


def _text(value: object, digits: int) -> object:
    if isinstance(value, float):
        return f"{value:.{digits}g}" if isfinite(value) else ""
    return cell(value)


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]], digits: int = 6) -> None:
    """Write what `comma_separated` makes, whole or not at all. Raises OutputError."""
    write_atomic(path, comma_separated(columns, rows, digits))


def read_csv(path: Path) -> list[dict[str, str]]:
    """Rows of a file as texts by column. Raises FileNotFoundError."""
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))
