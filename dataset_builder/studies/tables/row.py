"""A row of a table: what is trained for it, and the published row that it is compared with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.studies.tables.paper import Printed


@dataclass(frozen=True, kw_only=True)
class TableRow:
    """name: of its folder and in files; title: for people. spec: None for what learns nothing, `name` is then its name
    in `lightnet.methods.baselines.trivial`. printed: None where the paper has no such row. note: a remark on it."""

    name: str
    title: str
    spec: TrainingSpec | None
    printed: Printed | None = None
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Group:
    """Rows that the paper compares with each other, by name; order is looked at within a group."""

    title: str
    rows: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Table:
    """number: how the paper calls it. reference: the row that all others are held against. absent: printed rows that
    cannot be measured here, with the reason by title. left_out: what was not asked, and why."""

    name: str
    number: str
    question: str
    rows: tuple[TableRow, ...]
    groups: tuple[Group, ...]
    reference: str
    absent: Mapping[str, tuple[Printed, str]]
    left_out: tuple[str, ...] = ()

    def row(self, name: str) -> TableRow:
        """The row of that name."""
        return next(row for row in self.rows if row.name == name)


def names(rows: Sequence[TableRow]) -> tuple[str, ...]:
    """Names, in order."""
    return tuple(row.name for row in rows)
