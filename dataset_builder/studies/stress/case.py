"""A hard case: an expectation, a measured figure, a bound for it, and a verdict."""

from collections.abc import Callable
from dataclasses import dataclass

from dataset_builder.label.example_plan import Transport

SIGMAS = 4.9
"""Bound on the worst of some thousand standard normal deviates: a correct renderer exceeds it once in a thousand runs
with other seeds (two-sided tail 9.6e-7 each)."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """How large the cases are."""

    name: str
    side: int
    """Pixels."""
    spp: int
    """Samples per pixel and replica."""
    replicas: int
    """Independent pictures, whose spread is the standard error."""
    faces: int
    """Of the large mesh."""
    long: int
    """Samples of the long sums."""
    transport: Transport = "camera"
    """Of cases that have a lamp in the scene; the others have camera paths."""


SIZES = {
    "small": Size(name="small", side=20, spp=16, replicas=32, faces=200_000, long=1 << 16),
    "full": Size(name="full", side=40, spp=64, replicas=32, faces=2_000_000, long=1_000_000),
}


@dataclass(frozen=True, kw_only=True)
class CaseMeasured:
    """The figure of a case."""

    figure: float
    wrong: tuple[str, ...] = ()
    """Laws that every case must keep but this one broke, one sentence each."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """One hard case: an expectation, a measured figure and a bound for it."""

    name: str
    """`group/case`."""
    expectation: str
    """What should be seen."""
    failure: str
    """What a defect would look like."""
    figure: str
    """What is measured, at best 0."""
    bound: float
    """The largest figure that passes."""
    measure: Callable[[Size], CaseMeasured]


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """A case that ran."""

    case: Case
    figure: float
    wrong: tuple[str, ...]
    """Broken laws, or why there is no figure."""
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
