"""The table of the study: one row for each question, setting, example and layer."""

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from dataset_builder.files import write_atomic
from dataset_builder.studies.comma_separated import comma_separated

NONE = math.nan
WHOLE = "all"
"""The layer of a row that is about all layers of an example together."""


@dataclass(frozen=True, kw_only=True)
class AccuracyRow:
    """One measurement. Figures that a question does not have are NaN, and empty in the file.

    value: the setting as a number (spp, error asked for, depth, metres, texels, samples). seconds: of the pass that
    makes the layer, or of what the question is about. spp: mean over its pixels, with least and most. relmse: less the
    share that the reference's own noise is expected to have in it; relmse_measured: with it; relmse_reference: that
    share; floor: relmse below which nothing can be told. reached: relative error that the renderer claims. bias: mean
    of the difference over the mean; bias_se: its standard error. drift: relative difference of a sum from the double
    one.
    """

    question: str
    setting: str
    value: float
    example: str
    layer: str
    seconds: float = NONE
    spp: float = NONE
    spp_min: float = NONE
    spp_max: float = NONE
    paths: float = NONE
    relmse: float = NONE
    relmse_measured: float = NONE
    relmse_reference: float = NONE
    floor: float = NONE
    psnr: float = NONE
    flip: float = NONE
    reached: float = NONE
    bias: float = NONE
    bias_se: float = NONE
    triangles: float = NONE
    bytes: float = NONE
    encode_seconds: float = NONE
    decode_seconds: float = NONE
    drift: float = NONE

    @property
    def error(self) -> float:
        """sqrt(relmse): relative error, root mean square."""
        return math.sqrt(self.relmse)

    @property
    def at_floor(self) -> bool:
        """Whether noise that is not its own hides this error."""
        return self.relmse < self.floor


TEXTS = ("question", "setting", "example", "layer")
COLUMNS = (*(field.name for field in fields(AccuracyRow)), "at_floor")


def write_table(rows: Iterable[AccuracyRow], path: Path) -> None:
    """Write the rows as CSV, whole or not at all, figures to six digits. Raises OutputError."""
    write_atomic(path, comma_separated(COLUMNS, ([*map(_text, astuple(row)), int(row.at_floor)] for row in rows)))


def read_table(path: Path) -> list[AccuracyRow]:
    """The rows of a table that `write_table` wrote."""
    with path.open(encoding="utf-8", newline="") as stream:
        return [_row(line) for line in csv.DictReader(stream)]


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
