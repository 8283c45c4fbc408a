"""The effects study as files: differences and seconds as CSV."""

from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

from dataset_builder.files import write_atomic
from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.effects.effects_study import Compared
from dataset_builder.studies.effects.picture_differences import Difference

DIFFERENCE_COLUMNS = (*(field.name for field in fields(Difference)), "verdict")
SECONDS_COLUMNS = ("example", "pass", "planned", "everything")


def write_tables(found: Sequence[Compared], folder: Path) -> None:
    """`differences.csv`, one row per example and layer, and `seconds.csv`, one per example and pass. Raises
    OutputError."""
    write_atomic(folder / "differences.csv", comma_separated(DIFFERENCE_COLUMNS, [
        [*astuple(one), "pass" if one.holds else "fail"] for compared in found for one in compared.differences]))
    write_atomic(folder / "seconds.csv", comma_separated(SECONDS_COLUMNS, [
        [one.example, name, one.planned.get(name, 0.0), one.everything.get(name, 0.0)]
        for one in found for name in dict.fromkeys((*one.planned, *one.everything))]))
