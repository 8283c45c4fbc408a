"""Results of hard cases on the terminal: rows of one table, each printed as soon as its case is done."""

from rich.console import Console
from rich.table import Table
from rich.text import Text

from dataset_builder.studies.stress.case import CaseResult

NAME, NUMBER, VERDICT = 31, 10, 7
"""Widths of columns; the expectation takes what is left."""


def header() -> Table:
    """Names of the columns."""
    return _row(*(Text(word, style="bold") for word in ("case", "expectation", "measured", "bound", "verdict")))


def line(result: CaseResult) -> Table:
    """One result."""
    style = "green" if result.passed else "bold red"
    verdict = Text("passed" if result.passed else "failed", style=style)
    return _row(Text(result.case.name), Text(result.case.expectation), Text(f"{result.figure:.3g}"),
                Text(f"{result.case.bound:g}"), verdict)


def show(result: CaseResult, console: Console) -> None:
    """Print a result and, where it failed, what was measured and which laws are broken."""
    console.print(line(result))
    if not result.passed:
        for reason in result.wrong or (f"{result.case.figure}: expected at most {result.case.bound:g}, got "
                                       f"{result.figure:g}",):
            console.print(Text(f"  {reason}", style="red"), soft_wrap=True)


def _row(*cells: Text) -> Table:
    table = Table.grid(padding=(0, 1), expand=True)
    for width in (NAME, None, NUMBER, NUMBER, VERDICT):
        table.add_column(width=width, ratio=None if width else 1, justify="right" if width == NUMBER else "left")
    table.add_row(*cells)
    return table
