"""Whether the published order is reproduced: pair by pair, with the error of each difference, and Kendall's tau.

Of every two rows that the paper compares, the one that it prints as better should be the better one here. A pair is
*told apart* where the interval of its difference, example by example and clustered by object
(`lightnet.results.clustered_means`), does not contain 0; only such pairs can agree with the paper's order or contradict
it. With one seed the interval does not include the spread between trainings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

from dataset_builder.lightnet.results.clustered_means import ClusteredMean
from dataset_builder.studies.tables.paper import Printed

Better = Literal["low", "high"]
Verdict = Literal["as printed", "against", "not told apart"]


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two rows by name."""

    group: str
    metric: str
    better: str
    """The one that the paper prints as better."""
    worse: str
    printed: float
    gain: ClusteredMean
    """Mean over examples of how much better it is here, so that > 0 is the printed order."""
    altered: bool
    """One of them is not quite what the paper's is."""

    @property
    def as_printed(self) -> bool:
        """Whether the means stand in the printed order, told apart or not."""
        return self.gain.mean > 0

    @property
    def verdict(self) -> Verdict:
        """What can be said of it."""
        if not self.gain.told_apart:
            return "not told apart"
        return "as printed" if self.as_printed else "against"


@dataclass(frozen=True, kw_only=True)
class Order:
    """All pairs of one metric."""

    metric: str
    pairs: tuple[Pair, ...]

    @property
    def kendall(self) -> float:
        """Kendall's tau-a: pairs in the printed order less the others, over all; ties of the paper are no pairs."""
        signs = [(pair.gain.mean > 0) - (pair.gain.mean < 0) for pair in self.pairs]
        return sum(signs) / len(signs)

    def count(self, verdict: Verdict) -> int:
        """Pairs of which that can be said."""
        return sum(pair.verdict == verdict for pair in self.pairs)


def printed_pairs(printed: Mapping[str, Printed], metric: str, better: Better) \
        -> list[tuple[str, str, float]]:
    """(better row, worse row, how much better) of every two rows that the paper does not print as equal."""
    sign = 1 if better == "high" else -1
    found = []
    for one, two in combinations(printed, 2):
        gain = sign * (printed[one].of(metric) - printed[two].of(metric))
        if gain:
            found.append((one, two, gain) if gain > 0 else (two, one, -gain))
    return found


def summary(order: Order, symbol: str) -> str:
    """One sentence on one metric."""
    pairs = order.pairs
    right = sum(pair.as_printed for pair in pairs)
    return (f"{symbol}: {right} of {len(pairs)} pairs in the paper's order (Kendall's tau {order.kendall:+.2f}); told "
            f"apart: {order.count('as printed')} as printed, {order.count('against')} against it")


def verdict(orders: Sequence[Order]) -> str:
    """What all metrics together say; that of rows which are not quite the paper's is said, too."""
    pairs = [pair for order in orders for pair in order.pairs]
    altered = sum(pair.altered for pair in pairs)
    caveat = f" In {altered} of {len(pairs)} pairs a row has losses off that the paper's had on." if altered else ""
    return _verdict(pairs) + caveat


def _verdict(pairs: Sequence[Pair]) -> str:
    told = [pair for pair in pairs if pair.verdict != "not told apart"]
    against = sum(pair.verdict == "against" for pair in told)
    if not told:
        return "No two rows are told apart: this run neither reproduces the paper's order nor contradicts it."
    if against:
        return (f"The paper's order is not reproduced: {len(told)} of {len(pairs)} pairs are told apart, {against} of "
                "them against it.")
    if len(told) == len(pairs):
        return "The paper's order is reproduced, by all metrics and pairs."
    return f"Nothing contradicts the paper's order: {len(told)} of {len(pairs)} pairs are told apart, all as printed."
