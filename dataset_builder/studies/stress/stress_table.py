"""The catalogue and its results as text: a table for the pages, and one row per result for files."""

from collections.abc import Iterable

from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.stress.case import Case, CaseResult

COLUMNS = ("case", "expectation", "figure", "measured", "bound", "passed", "wrong", "seconds", "size", "backend")


def markdown(cases: Iterable[Case]) -> str:
    """What each case expects, what a defect would look like, and the bound on what is measured."""
    rows = [f"| `{case.name}` | {case.expectation} | {case.failure} | {case.figure} | {case.bound:g} |"
            for case in cases]
    return "\n".join(["| case | expectation | what failure looks like | figure | bound |",
                      "| --- | --- | --- | --- | --- |", *rows, ""])


def results_table(results: Iterable[CaseResult], *, size: str, backend: str) -> bytes:
    """One row per result, columns as `COLUMNS`; passed is 1 or 0, broken laws are joined by semicolons."""
    return comma_separated(COLUMNS, (
        (one.case.name, one.case.expectation, one.case.figure, f"{one.figure:.6g}", f"{one.case.bound:g}",
         int(one.passed), "; ".join(one.wrong), f"{one.seconds:.2f}", size, backend) for one in results))


def summary(results: Iterable[CaseResult], seconds: float) -> str:
    """The last line of a run."""
    verdicts = [result.passed for result in results]
    passed = sum(verdicts)
    cases = "1 case" if len(verdicts) == 1 else f"{len(verdicts)} cases"
    return f"{cases}, {passed} passed, {len(verdicts) - passed} failed, {seconds:.1f} seconds"
