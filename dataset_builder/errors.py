"""Errors that a user can act on: where, which rule, which value, what to do.

Whatever a user did wrong ends as a `UserError` and is printed without a traceback (exit code 2). Everything else is a
bug of ours and keeps its traceback.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

FORMULA = ("=", "+", "-", "@")
"""What cells begin with that spreadsheets compute. https://owasp.org/www-community/attacks/CSV_Injection"""
NUMBER = re.compile(r"[+-]?[0-9.]+(e[+-]?[0-9]+)?")


def printable(text: str) -> str:
    """Text with control characters and the like as escapes: what a file says must not steer a terminal.

    >>> printable("a\\x1b[2J\\nb")
    'a\\\\x1b[2J\\\\nb'
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def cell(value: object) -> object:
    """A value for a CSV file: no text that a spreadsheet would take for a formula, and none with control characters.

    >>> cell("=1+1"), cell("chair"), cell("-1.5"), cell(-1.5)
    ("'=1+1", 'chair', '-1.5', -1.5)
    """
    if not isinstance(value, str):
        return value
    return printable(f"'{value}" if value.startswith(FORMULA) and not NUMBER.fullmatch(value) else value)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One broken rule; as text it is one line without control characters."""

    where: str
    """`file:line` or a path."""
    path: str
    """The dotted key."""
    rule: str
    """The expectation with its value."""
    hint: str = ""

    def __str__(self) -> str:
        place = ": ".join(part for part in (self.where, self.path) if part)
        text = f"{place}: {self.rule}" if place else self.rule
        return printable(f"{text} ({self.hint})" if self.hint else text)


class UserError(Exception):
    """Something the user can mend. `problems` holds every broken rule that was found, in reading order."""

    def __init__(self, problems: Iterable[Problem] | str):
        if isinstance(problems, str):
            problems = [Problem(where="", path="", rule=problems)]
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


class SpecError(UserError):
    """A spec, or a file that it names, breaks its rules."""


class PlanError(UserError):
    """A valid spec asks for something that cannot be planned, such as a camera that never sees its object."""


class OutputError(UserError):
    """The output folder cannot be written, is full, is in use, or holds something else."""


class ShardError(UserError):
    """A shard or a manifest does not hold what it says it holds."""


def count_of(number: int, what: str) -> str:
    """So many things: `1 object`, `2 objects`."""
    return f"{number:,} {what}{'s' if number != 1 else ''}"
