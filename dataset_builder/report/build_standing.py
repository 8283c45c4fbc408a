"""How a build stands: what is done, refused and why, how noisy it is, how fast it goes. Its size does not depend on how
many examples there are."""

from collections import Counter
from dataclasses import dataclass, field
from math import isfinite
from statistics import median
from threading import Lock
from time import monotonic

from dataset_builder.builder import Event
from dataset_builder.engine.unit import Outcome
from dataset_builder.planning.unit_cost import example_seconds
from dataset_builder.report.work_pace import WorkPace
from dataset_builder.shards.manifest import Rejected
from dataset_builder.spec.dataset import DatasetSpec

REASONS = 3
"""Rejected examples of each gate that are kept, each of another view."""

VALUES = 2048
"""Values of a layer that are kept; of more, every other goes, and every other of what comes."""

CURVE = 512
"""Points of what was rendered by time."""


@dataclass(kw_only=True)
class Refused:
    """What one gate refused."""

    count: int = 0
    first: list[Rejected] = field(default_factory=list)
    """The first few."""


class RunningMedian:
    """Median of any number of values, from an even choice of them."""

    def __init__(self) -> None:
        self._values, self._every, self.count = list[float](), 1, 0

    def add(self, value: float) -> None:
        """Take one."""
        if self.count % self._every == 0:
            self._values.append(value)
        self.count += 1
        if len(self._values) > VALUES:
            self._values, self._every = self._values[::2], 2 * self._every

    @property
    def median(self) -> float:
        """Of all so far; there is one at least."""
        return median(self._values)


class BuildStanding:
    """Takes a build's news. spec: weighs examples by what those of their split are expected to cost; without it all
    are alike. Times are seconds of a clock that never goes back."""

    def __init__(self, spec: DatasetSpec | None = None, *, start: float | None = None):
        self._spec, self.start = spec, monotonic() if start is None else start
        self.lock = Lock()
        """Whoever reads in another thread holds it."""
        self.wanted: int | None = None
        self.done = 0
        """With those that were there."""
        self.kept = 0
        """Those that were there."""
        self.refused = dict[str, Refused]()
        """By gate."""
        self.noise = dict[str, RunningMedian]()
        """Relative error of what was rendered, by layer."""
        self.stopped = Counter[str]()
        """How often sampling of a layer ended for what reason."""
        self.unknown = Counter[str]()
        """Examples in which the mean of a layer is not known, by layer."""
        self.curve: list[tuple[float, int]] = [(0.0, 0)]
        """Seconds since the start, and examples that were rendered until then; the last point is always there."""
        self._passing, self._every, self._steps = False, 1, 0
        self._weights, self._ahead, self._rendered = dict[str, float](), 0.0, 0
        self._workers, self._pace = 1, WorkPace(self.start)

    def add(self, event: Event, now: float) -> None:
        """Take one."""
        with self.lock:
            if event.wanted is not None:
                self.wanted, self._workers = event.wanted, event.workers
                if self._spec and event.splits:
                    self._weights = {split: example_seconds(self._spec, split) for split in event.splits}
                splits = event.splits or {"": event.wanted}
                self._ahead = sum(count * self._weight(split) for split, count in splits.items())
            if not self._rendered and not event.outcomes:
                # Fields and figures of denoised layers come first
                self._pace = WorkPace(now, self._workers)
            if event.outcomes:
                self._take(event, now)

    def rate(self, now: float, *, ended: bool = False) -> float | None:
        """Examples per second in the last minutes, or of the whole build once it ended; None where nothing is known."""
        if ended:
            return self._rendered / (now - self.start) if self._rendered and now > self.start else None
        return self._pace.rate(now)

    def left(self, now: float) -> float | None:
        """Seconds until the last example is done, fields not counted."""
        return None if self.wanted is None else self._pace.left(now, self._ahead if self.done < self.wanted else 0.0)

    @property
    def rejected(self) -> int:
        """How many examples were refused so far."""
        return sum(each.count for each in self.refused.values())

    @property
    def goals(self) -> dict[str, float]:
        """Shares of reasons why sampling ended, the most frequent first; empty where there was no goal."""
        found = {name: count for name, count in self.stopped.most_common() if name != "spp"}
        return {name: count / sum(found.values()) for name, count in found.items()}

    def _weight(self, split: str) -> float:
        return self._weights.get(split, 1.0)

    def _take(self, event: Event, now: float) -> None:
        # A merge renders nothing: what it copies is its work
        merged = event.shard is not None
        worked = merged or any(outcome.seconds and not outcome.kept for outcome in event.outcomes)
        work, examples = 0.0, 0
        for outcome in event.outcomes:
            weight = self._weight(outcome.ref.view.pair.split)
            self.done += 1
            self._ahead = max(self._ahead - weight, 0.0)
            if outcome.kept and not merged:
                self.kept += 1
            else:
                work, examples = work + weight, examples + 1
            self._note(outcome)
        if worked:
            self._pace.add(now, work, examples)
            self._rendered += examples
            self._point(now)

    def _note(self, outcome: Outcome) -> None:
        if outcome.rejected:
            known = self.refused.setdefault(outcome.rejected.gate, Refused())
            known.count += 1
            if len(known.first) < REASONS and outcome.rejected.view not in {item.view for item in known.first}:
                known.first.append(outcome.rejected)
        self.unknown.update(outcome.unknown)
        for layer, (stopped, error) in outcome.noise.items():
            self.stopped[stopped] += 1
            if isfinite(error):
                self.noise.setdefault(layer, RunningMedian()).add(error)

    def _point(self, now: float) -> None:
        if self._passing:
            self.curve.pop()
        self.curve.append((now - self.start, self._rendered))
        self._steps += 1
        self._passing = self._steps % self._every != 0
        if len(self.curve) > CURVE:
            self.curve, self._every = self.curve[::2], 2 * self._every
