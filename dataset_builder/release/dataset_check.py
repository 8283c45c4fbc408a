"""A rule about a whole dataset, and the result of checking it."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Rule:
    """What is asked of a statistic."""

    name: str
    statement: str
    low: float = float("-inf")
    """Closed bound, as is `high`."""
    high: float = float("inf")
    why: str
    """Where the bounds come from."""

    def judge(self, value: float, detail: str = "") -> "Check":
        """The rule held against a value. detail: what helps to find the fault, such as keys of examples."""
        return Check(rule=self, value=float(value), detail=detail)

    def pass_over(self, reason: str) -> "Check":
        """The rule where there is nothing to hold it against; `reason` says what is missing."""
        return Check(rule=self, value=None, detail=reason)

    @property
    def bounds(self) -> str:
        """The bounds in words: `>= 0.5`, `<= 2`, `0.7 to 1.3`."""
        if self.low == float("-inf"):
            return f"<= {self.high:g}"
        return f">= {self.low:g}" if self.high == float("inf") else f"{self.low:g} to {self.high:g}"


@dataclass(frozen=True, kw_only=True)
class Check:
    """A rule and what was found."""

    rule: Rule
    value: float | None
    """None where the dataset has nothing to judge by, which `detail` explains."""
    detail: str = ""

    @property
    def name(self) -> str:
        """The rule's name."""
        return self.rule.name

    @property
    def judged(self) -> bool:
        """Whether there was anything to judge by."""
        return self.value is not None

    @property
    def holds(self) -> bool:
        """False where a value is out of bounds or no number at all; what is not judged is not refused."""
        return self.value is None or self.rule.low <= self.value <= self.rule.high

    @property
    def verdict(self) -> str:
        """`yes`, `no`, or `not judged`."""
        return ("yes" if self.holds else "no") if self.judged else "not judged"
