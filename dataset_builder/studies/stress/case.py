"""A hard case: an expectation, a measured figure, a bound for it, and a verdict."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from time import perf_counter

import numpy as np

from dataset_builder.errors import UserError

SIGMAS = 4.9
"""Bound on the worst of some thousand standard normal deviates: a correct renderer exceeds it once in a thousand runs
with other seeds (two-sided tail 9.6e-7 each)."""

BREAKDOWNS = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError,
              UserError)
"""What a broken renderer may raise: the case fails, the others go on."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """How large the cases are. side: pixels; spp: samples per pixel and replica; replicas: independent pictures, whose
    spread is the standard error; faces: of the large mesh; long: samples of the long sums."""

    name: str
    side: int
    spp: int
    replicas: int
    faces: int
    long: int


SIZES = {
    "small": Size(name="small", side=20, spp=16, replicas=16, faces=200_000, long=1 << 16),
    "full": Size(name="full", side=40, spp=64, replicas=16, faces=2_000_000, long=1_000_000),
}


@dataclass(frozen=True, kw_only=True)
class CaseMeasured:
    """The figure of a case, and laws that every case must keep but this one broke, one sentence each."""

    figure: float
    wrong: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hard case.

    name: `group/case`. expectation: what should be seen. failure: what a defect would look like. figure: what is
    measured, at best 0. bound: the largest figure that passes.
    """

    name: str
    expectation: str
    failure: str
    figure: str
    bound: float
    measure: Callable[[Size], CaseMeasured]


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """A case that ran. wrong: broken laws, or why there is no figure."""

    case: Case
    figure: float
    wrong: tuple[str, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """The figure is a number within its bound, and no law is broken."""
        return not self.wrong and 0 <= self.figure <= self.case.bound


def hard_case(*, name: str, expectation: str, failure: str, figure: str,
              bound: float) -> Callable[[Callable[[Size], CaseMeasured]], Case]:
    """Makes a `Case` of the function that measures it."""
    return lambda measure: Case(name=name, expectation=expectation, failure=failure, figure=figure, bound=bound,
                                measure=measure)


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
