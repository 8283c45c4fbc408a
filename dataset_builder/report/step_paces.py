"""The time that is left of a study, by what its steps took so far."""

from collections.abc import Sequence
from statistics import fmean

from dataset_builder.report.console import duration


class Paces:
    """The time that is left of work on several examples, whose steps of one kind take about as long for each."""

    def __init__(self, kinds: Sequence[str]):
        """kinds: of the steps of an example, in turn."""
        self._seconds: dict[str, list[float]] = {kind: [] for kind in kinds}

    def after(self, kind: str, seconds: float, left: int) -> str:
        """What to say after a step that took so long, with `left` more to come; nothing until every kind was met."""
        self._seconds[kind].append(seconds)
        if not left or not all(self._seconds.values()):
            return ""
        means, kinds = [fmean(found) for found in self._seconds.values()], list(self._seconds)
        start = kinds.index(kind) + 1
        return f"; about {duration(sum(means[(start + step) % len(means)] for step in range(left)))} left"
