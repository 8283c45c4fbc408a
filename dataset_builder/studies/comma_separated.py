"""Rows as the bytes of a CSV file."""

import csv
from collections.abc import Iterable, Sequence
from io import StringIO
from math import isfinite


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
    return value
