"""A number as written in a spec: a constant, or a distribution that planning draws from."""

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from dataset_builder.spec.model import Model

PositiveInt = Annotated[int, Field(ge=1)]
Share = Annotated[float, Field(ge=0, le=1)]
MOST_EXAMPLES = 1_000_000
Count = Annotated[int, Field(ge=1, le=MOST_EXAMPLES)]
"""A number of things that a dataset has."""

TAG = "|"
"""First character of the names of union branches: such a name in an error's location is no key of the user's file."""


def _two(value: Any) -> Any:
    if isinstance(value, (list, tuple)) and len(value) != 2:
        raise ValueError(f"expected two numbers, got {len(value)}")
    return value


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError(f"expected low <= high, got [{pair[0]:g}, {pair[1]:g}]")
    return pair


def _positive(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] <= 0:
        raise ValueError(f"expected bounds > 0, got [{pair[0]:g}, {pair[1]:g}]")
    return pair


def _spread(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[1] < 0:
        raise ValueError(f"expected a standard deviation >= 0, got {pair[1]:g}")
    return pair


Pair = Annotated[tuple[float, float], BeforeValidator(_two)]
Interval = Annotated[Pair, AfterValidator(_ascending)]
"""Two numbers, low and high."""


def interval(low: float = -math.inf, high: float = math.inf) -> Any:
    """Metadata of an `Interval` that lies within [low, high]; to be used as `Annotated[Interval, interval(0, 1)]`."""

    def check(pair: tuple[float, float]) -> tuple[float, float]:
        if pair[0] < low or pair[1] > high:
            raise ValueError(f"expected bounds {_rule(low, high)}, got [{pair[0]:g}, {pair[1]:g}]")
        return pair

    return AfterValidator(check)


class Uniform(Model):
    """Uniform between two bounds."""

    uniform: Interval

    def draw(self, rng: np.random.Generator) -> float:
        """One draw in [low, high)."""
        return float(rng.uniform(*self.uniform))

    def support(self) -> tuple[float, float]:
        """Smallest and largest value that can be drawn."""
        return self.uniform


class LogUniform(Model):
    """Uniform in the logarithm between two positive bounds."""

    log_uniform: Annotated[Interval, AfterValidator(_positive)]

    def draw(self, rng: np.random.Generator) -> float:
        """One draw in [low, high]; cut to the bounds, as exp(log(x)) may miss x by a rounding."""
        low, high = self.log_uniform
        return min(max(math.exp(rng.uniform(math.log(low), math.log(high))), low), high)

    def support(self) -> tuple[float, float]:
        """Smallest and largest value that can be drawn."""
        return self.log_uniform


class Normal(Model):
    """Normal with a mean and a standard deviation, cut at four deviations by drawing again."""

    normal: Annotated[Pair, AfterValidator(_spread)]

    def draw(self, rng: np.random.Generator) -> float:
        """One draw within four standard deviations of the mean."""
        mean, deviation = self.normal
        while abs(unit := float(rng.standard_normal())) > 4:
            pass
        return mean + deviation * unit

    def support(self) -> tuple[float, float]:
        """Smallest and largest value that can be drawn."""
        mean, deviation = self.normal
        return mean - 4 * deviation, mean + 4 * deviation


class Choice(Model):
    """One of some numbers, each as likely."""

    choice: Annotated[tuple[float, ...], Field(min_length=1)]

    def draw(self, rng: np.random.Generator) -> float:
        """One of the choices."""
        return float(self.choice[rng.integers(len(self.choice))])

    def support(self) -> tuple[float, float]:
        """Smallest and largest choice."""
        return min(self.choice), max(self.choice)


_KINDS: dict[str, type[Model]] = {"uniform": Uniform, "log_uniform": LogUniform, "normal": Normal, "choice": Choice}


def _branch(value: Any) -> str | None:
    """Which branch of `AnyNumber` a value means; None where it means none of them."""
    if isinstance(value, Model):
        return next((TAG + name for name, kind in _KINDS.items() if isinstance(value, kind)), None)
    if isinstance(value, dict):
        return next((TAG + name for name in _KINDS if name in value), None)
    return TAG + "number" if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def branches(choose: Callable[[Any], str | None], rule: str) -> Discriminator:
    """Chooses one branch of a union, so that a wrong value breaks one rule and not one per branch."""
    return Discriminator(choose, custom_error_type="branch", custom_error_message=rule)


AnyNumber = Annotated[
    Annotated[float, Field(allow_inf_nan=False), Tag("|number")]
    | Annotated[Uniform, Tag("|uniform")]
    | Annotated[LogUniform, Tag("|log_uniform")]
    | Annotated[Normal, Tag("|normal")]
    | Annotated[Choice, Tag("|choice")],
    branches(_branch, f"expected a number or one of {', '.join(_KINDS)}"),
]


def draw(number: AnyNumber, rng: np.random.Generator) -> float:
    """The constant itself, or one draw of the distribution."""
    return number.draw(rng) if isinstance(number, Model) else float(number)


def support(number: AnyNumber) -> tuple[float, float]:
    """Smallest and largest value a number of a spec can take."""
    return number.support() if isinstance(number, Model) else (float(number), float(number))


def draws(value: Any) -> bool:
    """Whether a value of a spec is, or holds, a distribution that gives more than one number."""
    if isinstance(value, (Uniform, LogUniform, Normal, Choice)):
        low, high = support(value)
        return low < high
    parts = value if isinstance(value, tuple) else [part for _, part in value] if isinstance(value, Model) else ()
    return any(map(draws, parts))


def _rule(low: float, high: float) -> str:
    return f">= {low:g}" if math.isinf(high) else f"<= {high:g}" if math.isinf(low) else f"in [{low:g}, {high:g}]"


def check_within(number: AnyNumber, low: float, high: float) -> AnyNumber:
    """The number, if its whole support lies in [low, high]; else ValueError with the rule and the value."""
    smallest, largest = support(number)
    if smallest < low or largest > high:
        got = f"{smallest:g}" if smallest == largest else f"[{smallest:g}, {largest:g}]"
        raise ValueError(f"expected {_rule(low, high)}, got {got}")
    return number


def within(low: float = -math.inf, high: float = math.inf) -> Any:
    """Annotation of a number whose whole support lies in [low, high]."""
    return Annotated[AnyNumber, AfterValidator(lambda number: check_within(number, low, high))]
