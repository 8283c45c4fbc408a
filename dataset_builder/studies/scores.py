"""Scores of studies on disk: rows of `lightnet.results.evaluate`, written whole and read back to the last digit."""

import csv
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path
from typing import Any

from dataset_builder.files import write_atomic
from dataset_builder.lightnet.measures.metrics import Metrics
from dataset_builder.lightnet.results.evaluate import ScoreRow
from dataset_builder.studies.comma_separated import comma_separated

KINDS: dict[str, Callable[[str], Any]] = {"method": str, "key": str, "view": str, "object": str, "room": str,
                                          "level": int, "sigma": float, "seconds": float}
"""Columns that are no metric, in order, and what their text is."""
EXACT = 17
"""Digits that bring a double back as it was."""
FIGURES = tuple(field.name for field in fields(Metrics))


def write_scores(rows: Iterable[ScoreRow], path: Path) -> None:
    """Write rows as CSV, whole or not at all. Raises OutputError."""
    columns = (*KINDS, *FIGURES)
    write_atomic(path, comma_separated(columns, ([getattr(row, name) for name in KINDS] + [
        getattr(row.metrics, name) for name in FIGURES] for row in rows), digits=EXACT))


def read_scores(path: Path) -> tuple[ScoreRow, ...]:
    """The rows of a file that `write_scores` wrote; none where it is missing or damaged."""
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            return tuple(_row(line) for line in csv.DictReader(stream))
    except (FileNotFoundError, UnicodeDecodeError, ValueError, KeyError, TypeError):
        return ()


def _row(line: dict[str, str]) -> ScoreRow:
    metrics = Metrics(**{name: float(line[name] or "nan") for name in FIGURES})
    return ScoreRow(**{name: read(line[name]) for name, read in KINDS.items()}, metrics=metrics)
