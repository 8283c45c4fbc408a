"""Every hard case, in reading order: chosen, run one by one, and told as text and as rows of a file."""

from collections.abc import Iterable, Iterator
from fnmatch import fnmatchcase
from time import perf_counter

import numpy as np

from dataset_builder.errors import UserError
from dataset_builder.studies.comma_separated import comma_separated
from dataset_builder.studies.stress import (
    geometry_cases,
    leaf_cases,
    light_cases,
    material_cases,
    mesh_cases,
    number_cases,
    refused_cases,
    scale_cases,
)
from dataset_builder.studies.stress.case import Case, CaseMeasured, CaseResult, Size

MODULES = (light_cases, scale_cases, geometry_cases, mesh_cases, material_cases, leaf_cases, number_cases,
           refused_cases)
CASES = tuple(found for module in MODULES for found in vars(module).values() if isinstance(found, Case))

COLUMNS = ("case", "expectation", "figure", "measured", "bound", "passed", "wrong", "seconds", "size", "backend")
BREAKDOWNS = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError,
              UserError)
"""What a broken renderer may raise: the case fails, the others go on."""


def run(case: Case, size: Size) -> CaseResult:
    """Measure one case; what it raises is its failure."""
    start = perf_counter()
    try:
        # A figure that is no number is a verdict of its own
        with np.errstate(all="ignore"):
            found = case.measure(size)
    except BREAKDOWNS as error:
        found = CaseMeasured(figure=float("nan"), wrong=(f"{type(error).__name__}: {error}",))
    return CaseResult(case=case, figure=found.figure, wrong=found.wrong, seconds=perf_counter() - start)


def run_all(cases: Iterable[Case], size: Size) -> Iterator[CaseResult]:
    """Measure one case after the other, each result as it is there."""
    for case in cases:
        yield run(case, size)


def select(cases: Iterable[Case], pattern: str) -> tuple[Case, ...]:
    """Cases whose name matches a shell pattern, or holds it. Raises UserError where none does."""
    cases = tuple(cases)
    found = tuple(case for case in cases if pattern in case.name or fnmatchcase(case.name, pattern))
    if not found:
        raise UserError(f"--only: expected a pattern that matches a case, got {pattern!r}; cases are "
                        + ", ".join(case.name for case in cases))
    return found


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
