"""The catalogue and its results as text: a table for the pages, and one row per result for files."""

import csv
from collections.abc import Iterable
from io import StringIO

from dataset_builder.studies.stress.case import Case, CaseResult

COLUMNS = ("case", "expectation", "figure", "measured", "bound", "passed", "wrong", "seconds", "size", "backend")


def markdown(cases: Iterable[Case]) -> str:
    """What each case expects, what a defect would look like, and the bound on what is measured."""
    rows = [f"| `{case.name}` | {case.expectation} | {case.failure} | {case.figure} | {case.bound:g} |"
            for case in cases]
    return "\n".join(["| case | expectation | what failure looks like | figure | bound |",
                      "| --- | --- | --- | --- | --- |", *rows, ""])


def comma_separated(results: Iterable[CaseResult], *, size: str, backend: str) -> bytes:
    """One row per result, columns as `COLUMNS`; passed is 1 or 0, broken laws are joined by semicolons."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for result in results:
        case = result.case
        writer.writerow((case.name, case.expectation, case.figure, f"{result.figure:.6g}", f"{case.bound:g}",
                         int(result.passed), "; ".join(result.wrong), f"{result.seconds:.2f}", size, backend))
    return stream.getvalue().encode()


def summary(results: Iterable[CaseResult], seconds: float) -> str:
    """The last line of a run."""
    verdicts = [result.passed for result in results]
    passed = sum(verdicts)
    cases = "1 case" if len(verdicts) == 1 else f"{len(verdicts)} cases"
    return f"{cases}, {passed} passed, {len(verdicts) - passed} failed, {seconds:.1f} seconds"
