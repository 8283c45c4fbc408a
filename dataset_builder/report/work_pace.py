"""How fast work is done and when it ends, from what was finished when."""

from collections import deque
from dataclasses import dataclass

WINDOW, SHARE, STEPS = 120.0, 0.1, 20
"""Of the past there count so many seconds, that share of all, and so many steps of every process, each at least."""

POINTS = 512
"""Moments that are kept; of more, every other goes."""

STALLED = 3.0
"""Where nothing was finished for so many of the usual gaps, the time since then counts."""


@dataclass(frozen=True)
class _Moment:
    time: float
    work: float
    examples: int
    steps: int


class WorkPace:
    """Work by time. The first step of every process compiles kernels and reads meshes; no pace is taken of it as soon
    as there is a later one. start: when work began, in seconds of any clock; workers: processes that share the work.
    """

    def __init__(self, start: float, workers: int = 1):
        self._start, self._workers = start, max(workers, 1)
        self._moments = deque([_Moment(start, 0.0, 0, 0)])

    def add(self, now: float, work: float, examples: int = 1) -> None:
        """Note that a step ended: so much work, in any unit, and so many examples."""
        moments, last = self._moments, self._moments[-1]
        moments.append(_Moment(now, last.work + work, last.examples + examples, last.steps + 1))
        if moments[-1].steps == self._workers + 1:
            self._moments = moments = deque(each for each in moments if each.steps >= self._workers)
        horizon = now - max(WINDOW, SHARE * (now - self._start))
        while moments[1].time <= horizon and moments[-1].steps - moments[1].steps >= STEPS * self._workers:
            moments.popleft()
        if len(moments) > POINTS:
            self._moments = deque([*list(moments)[:-1:2], moments[-1]])

    def rate(self, now: float) -> float | None:
        """Examples per second; None where nothing is known."""
        return self._per_second(now, self._moments[-1].examples - self._moments[0].examples)

    def left(self, now: float, work: float) -> float | None:
        """Seconds that so much more work takes; None where nothing is known."""
        if work <= 0:
            return 0.0
        rate = self._per_second(now, self._moments[-1].work - self._moments[0].work)
        if not rate:
            return None
        since, gap = now - self._moments[-1].time, self._gap()
        # What is at work now is done in part
        return max(work / rate - (min(since, gap) if since <= STALLED * gap else 0.0), 0.0)

    def _per_second(self, now: float, done: float) -> float | None:
        if self._moments[-1].steps == self._moments[0].steps:
            return None
        spent = self._moments[-1].time - self._moments[0].time
        if now - self._moments[-1].time > STALLED * self._gap():
            spent = now - self._moments[0].time
        return done / spent if spent > 0 else None

    def _gap(self) -> float:
        """Mean seconds from one end of a step to the next."""
        first, last = self._moments[0], self._moments[-1]
        return (last.time - first.time) / max(last.steps - first.steps, 1)
