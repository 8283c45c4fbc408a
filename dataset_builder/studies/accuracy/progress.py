"""Rows that an interrupted study has measured already: they are reused where their settings are the same."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dataset_builder.digest import canonical_json
from dataset_builder.files import write_atomic
from dataset_builder.studies.accuracy.rows import AccuracyRow, read_table

FILE = "study.json"
Steps = dict[tuple[str, str], tuple[AccuracyRow, ...]]
"""Rows by example and group of questions."""


def begin(folder: Path, about: Mapping[str, Any], table: Path) -> None:
    """State in `folder` what its rows are about; a table that is about anything else goes. Raises OutputError."""
    path, content = folder / FILE, canonical_json(dict(about))
    if _read(path) != content:
        # The table first: an interruption in between must leave no rows under a statement that is not theirs
        table.unlink(missing_ok=True)
        write_atomic(path, content)


def kept_steps(table: Path, groups: Mapping[str, str]) -> Steps:
    """Steps whose rows a table holds; none where it is missing or damaged. groups: question -> group.

    Tables are written whole after every step, so that a step with rows is complete.
    """
    try:
        rows = read_table(table)
        steps = dict[tuple[str, str], list[AccuracyRow]]()
        for row in rows:
            steps.setdefault((row.example, groups[row.question]), []).append(row)
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return {}
    return {step: tuple(own) for step, own in steps.items()}


def _read(path: Path) -> bytes:
    return path.read_bytes() if path.is_file() else b""
