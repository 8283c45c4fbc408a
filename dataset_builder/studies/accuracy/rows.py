"""The table of the study: a row for each question, setting, example and layer; an interrupted study reuses its rows."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from dataset_builder.digest import canonical_json, sha256_bytes
from dataset_builder.files import write_atomic
from dataset_builder.studies.comma_separated import read_csv, write_csv

NONE = math.nan
UNIFORM, ADAPTIVE = "uniform", "adaptive"
DENOISED, ADAPTIVE_DENOISED = "uniform-denoised", "adaptive-denoised"
QUESTIONS = (UNIFORM, ADAPTIVE, DENOISED, ADAPTIVE_DENOISED)
"""Questions 1 to 3, by the way of sampling."""

OTHERS = "other-examples"
"""The question of how examples differ: many, each once, without a reference."""

WHOLE = "all"
"""The layer of a row that is about all layers of an example together."""


@dataclass(frozen=True, kw_only=True)
class AccuracyRow:
    """One measurement. Figures that a question does not have are NaN, and empty in the file."""

    question: str
    setting: str
    value: float
    """The setting as a number: spp, error asked for, depth, metres, texels, samples."""
    example: str
    layer: str
    replicate: float = 0.0
    """Number of an independent run, of those that are repeated with other samples."""
    seconds: float = NONE
    """Of the pass that makes the layer, or of what the question is about."""
    cpu_seconds: float = NONE
    """The same on all cores together, which other processes do not lengthen."""
    spp: float = NONE
    """Mean over the pass's pixels, with least and most."""
    spp_min: float = NONE
    spp_max: float = NONE
    paths: float = NONE
    relmse: float = NONE
    """Less the share that the reference's own noise is expected to have in it."""
    relmse_measured: float = NONE
    """With that share."""
    relmse_reference: float = NONE
    """That share."""
    floor: float = NONE
    """relmse below which nothing can be told."""
    psnr: float = NONE
    flip: float = NONE
    reached: float = NONE
    """Relative error that the renderer claims."""
    unknown: float = NONE
    """1 where it says that the layer's mean is not known, else 0."""
    bias: float = NONE
    """Mean of the difference over the mean."""
    bias_se: float = NONE
    """Standard error of the bias."""
    triangles: float = NONE
    bytes: float = NONE
    encode_seconds: float = NONE
    decode_seconds: float = NONE
    drift: float = NONE
    """Relative difference of a sum from the double one."""

    @property
    def error(self) -> float:
        """sqrt(relmse): relative error, root mean square."""
        return math.sqrt(self.relmse)

    @property
    def at_floor(self) -> bool:
        """Whether noise that is not its own hides this error."""
        return self.relmse < self.floor


Steps = dict[tuple[str, str], tuple[AccuracyRow, ...]]
"""Rows by example and group of questions."""

ABOUT = "study.json"
TEXTS = ("question", "setting", "example", "layer")
COLUMNS = (*(field.name for field in fields(AccuracyRow)), "at_floor")


def write_table(rows: Iterable[AccuracyRow], path: Path) -> None:
    """Write the rows as CSV, whole or not at all, figures to six digits. Raises OutputError."""
    write_csv(path, COLUMNS, ([*map(_text, astuple(row)), int(row.at_floor)] for row in rows))


def read_table(path: Path) -> list[AccuracyRow]:
    """The rows of a table that `write_table` wrote."""
    return [_row(line) for line in read_csv(path)]


def _row(line: dict[str, str]) -> AccuracyRow:
    values: dict[str, Any] = {name: text if name in TEXTS else float(text or NONE) for name, text in line.items()
                              if name != "at_floor"}
    return AccuracyRow(**values)


def of(rows: Iterable[AccuracyRow], question: str, layer: str | None = None) -> list[AccuracyRow]:
    """Rows of one question, and of one layer of it."""
    return [row for row in rows if row.question == question and layer in (None, row.layer)]


def layers_in(rows: Sequence[AccuracyRow], question: str) -> list[str]:
    """Layers that a question has rows of, in order of appearance."""
    return list(dict.fromkeys(row.layer for row in rows if row.question == question))


def _text(value: str | float) -> str:
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else f"{value:.6g}"


def begin(folder: Path, about: Mapping[str, Any], table: Path) -> None:
    """State in `folder` what its rows are about. A table that is about anything else steps aside, with its statement,
    and comes back when it is asked for again: rows are hours of work. Raises OutputError."""
    path, content = folder / ABOUT, canonical_json(dict(about))
    before = path.read_bytes() if path.is_file() else b""
    if before == content:
        return
    # The table first: an interruption in between must leave no rows under a statement that is not theirs
    if table.exists():
        table.replace(_aside(table, before))
    write_atomic(path, content)
    if (kept := _aside(table, content)).exists():
        kept.replace(table)


def _aside(table: Path, about: bytes) -> Path:
    """Where a table is kept whose statement is not the folder's."""
    return table.with_name(f"{table.stem}-{sha256_bytes(about)[:12]}{table.suffix}")


def kept_steps(table: Path, groups: Mapping[str, str]) -> Steps:
    """Steps whose rows a table holds; none where it is missing or damaged. groups: question -> group.

    Tables are written whole after every step, so that a step with rows is complete.
    """
    try:
        steps = dict[tuple[str, str], list[AccuracyRow]]()
        for row in read_table(table):
            steps.setdefault((row.example, groups[row.question]), []).append(row)
    except (FileNotFoundError, ValueError, KeyError, TypeError):
        return {}
    return {step: tuple(own) for step, own in steps.items()}
