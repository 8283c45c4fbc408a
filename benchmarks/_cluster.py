"""A build on many workers, simulated by discrete events: tasks of known length, workers that are lost, one writer.

Workers take tasks from those that the driver has handed out. A result joins the queue of the one writer, which stages
it, publishes a shard when its last example is there, and hands out the next task. A worker that is lost comes back
after a while, elsewhere, and what it was at is handed out again, first; so is a task that ran out of memory, which has
enough the second time.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf

import numpy as np

HOUR = 3600.0


@dataclass(frozen=True, kw_only=True)
class Cluster:
    """Workers and the writer. Times in seconds."""

    workers: int
    begin: float = 0.0
    """Until a worker is ready, at first and after it was lost: process, libraries, kernels."""
    losses: float = 0.0
    """Of one worker, per hour."""
    absence: float = 0.0
    """Until another worker begins in its place."""
    slow_share: float = 0.0
    """Of workers."""
    slow_speed: float = 1.0
    """Of these, over the others'."""
    memory_share: float = 0.0
    """Of examples that run out of memory once."""
    per_task: float = 0.0
    """Of the writer, to hand out a task and take its result."""
    per_example: float = 0.0
    """Of the writer, to stage one, whatever its size."""
    per_byte: float = 0.0
    """Of the writer, to take and stage a byte."""
    per_shard: float = 0.0
    """Of the writer, to publish a shard, whatever its size."""
    per_published: float = 0.0
    """Of the writer, to publish a byte."""
    ahead: int = 2
    """Tasks in flight per worker."""


@dataclass(frozen=True, kw_only=True)
class Load:
    """What is to be made, in order."""

    seconds: np.ndarray
    """Of every example, on a worker of speed 1."""
    bytes: float = 0.0
    """Of an example."""
    per_task: int = 1
    """Examples in a task, which is what a worker takes, loses and hands over."""
    per_shard: int = 32


@dataclass(kw_only=True)
class Run:
    """What became of it, in seconds."""

    end: float = 0.0
    workers: int = 0
    useful: float = 0.0
    """Of workers, in tasks that were finished."""
    lost: float = 0.0
    """In tasks that were not."""
    away: float = 0.0
    """Beginning, and while nobody was in a lost worker's place."""
    writing: float = 0.0
    """Of the writer."""
    examples: int = 0
    losses: int = 0
    out_of_memory: int = 0
    longest_queue: int = 0
    """Results that waited for the writer."""
    waits: float = 0.0
    """Of results for the writer, in all."""

    @property
    def utilisation(self) -> float:
        """Share of the workers' time that went into what was finished."""
        return self.useful / (self.workers * self.end)

    @property
    def idle(self) -> float:
        """Of workers, with nothing to do."""
        return self.workers * self.end - self.useful - self.lost - self.away

    @property
    def writer_share(self) -> float:
        """Of the time that the writer was busy."""
        return self.writing / self.end


@dataclass(kw_only=True)
class _Task:
    examples: range
    seconds: float
    dies_after: float = inf
    """Share of the task, where it runs out of memory."""


@dataclass(kw_only=True)
class _Worker:
    speed: float
    task: _Task | None = None
    since: float = 0.0
    """When it began what it is at, or went away."""
    ready: bool = False
    life: int = 0
    """Machines that were in its place before: news of those is none."""


def simulate(load: Load, cluster: Cluster, seed: int) -> Run:
    """One build, from the start of its workers to its last shard; the same for the same seed."""
    return _Build(load, cluster, np.random.default_rng(seed)).run()


class _Build:
    def __init__(self, load: Load, cluster: Cluster, random: np.random.Generator):
        self._load, self._cluster, self._random = load, cluster, random
        slow = random.random(cluster.workers) < cluster.slow_share
        self._workers = [_Worker(speed=cluster.slow_speed if each else 1.0) for each in slow]
        self._waiting, self._left = self._tasks(), self._shards()
        self._handed_out, self._idle = deque[_Task](), list[int]()
        self._results, self._writing = deque[tuple[float, _Task]](), False
        self._events, self._count = list[tuple[float, int, str, int, int]](), 0
        self._told = Run(workers=cluster.workers)

    def run(self) -> Run:
        """Take events as they come."""
        for place in range(self._cluster.workers):
            self._begins(0.0, place, after=0.0)
        for _ in range(self._cluster.workers * self._cluster.ahead):
            self._hand_out()
        while self._told.examples < len(self._load.seconds):
            now, _, what, place, life = heappop(self._events)
            worker = self._workers[place]
            if what == "written":
                self._written(now)
            elif life == worker.life:
                {"ready": self._ready, "ended": self._ended, "lost": self._lost}[what](now, place, worker)
            while self._idle and self._handed_out:
                self._start(now, self._idle.pop(), self._handed_out.popleft())
        self._told.away += sum(self._told.end - worker.since for worker in self._workers if not worker.ready)
        return self._told

    def _begins(self, now: float, place: int, *, after: float) -> None:
        """A worker in this place is ready after so long, and lost at some time after it is there."""
        cluster, life = self._cluster, self._workers[place].life
        self._soon(now + after + cluster.begin, "ready", place, life)
        if cluster.losses:
            self._soon(now + after + self._random.exponential(HOUR / cluster.losses), "lost", place, life)

    def _start(self, now: float, place: int, task: _Task) -> None:
        worker = self._workers[place]
        worker.task, worker.since = task, now
        self._soon(now + task.seconds / worker.speed * min(task.dies_after, 1.0), "ended", place, worker.life)

    def _ready(self, now: float, place: int, worker: _Worker) -> None:
        self._told.away += now - worker.since
        worker.ready = True
        self._idle.append(place)

    def _ended(self, now: float, place: int, worker: _Worker) -> None:
        task, worker.task = worker.task, None
        assert task is not None
        self._idle.append(place)
        if task.dies_after < 1:
            self._told.lost += now - worker.since
            self._told.out_of_memory += 1
            self._handed_out.appendleft(_Task(examples=task.examples, seconds=task.seconds))
            return
        self._told.useful += now - worker.since
        self._results.append((now, task))
        self._told.longest_queue = max(self._told.longest_queue, len(self._results))
        self._write(now)

    def _lost(self, now: float, place: int, worker: _Worker) -> None:
        self._told.losses += 1
        if worker.task is not None:
            self._told.lost += now - worker.since
            self._handed_out.appendleft(worker.task)
        elif worker.ready:
            self._idle.remove(place)
        else:
            self._told.away += now - worker.since
        worker.task, worker.ready, worker.since, worker.life = None, False, now, worker.life + 1
        self._begins(now, place, after=self._cluster.absence)

    def _write(self, now: float) -> None:
        """Let the writer take the next result, unless it is busy."""
        if self._results and not self._writing:
            came, task = self._results[0]
            seconds = self._service(task)
            self._writing = True
            self._told.writing += seconds
            self._told.waits += now - came
            self._soon(now + seconds, "written", 0, 0)

    def _written(self, now: float) -> None:
        _, task = self._results.popleft()
        self._writing, self._told.end = False, now
        self._told.examples += len(task.examples)
        self._hand_out()
        self._write(now)

    def _service(self, task: _Task) -> float:
        """Seconds of the writer for a result, and for the shards that it completes."""
        cluster, load, count = self._cluster, self._load, len(task.examples)
        seconds = cluster.per_task + count * (cluster.per_example + load.bytes * cluster.per_byte)
        for example in task.examples:
            shard = example // load.per_shard
            self._left[shard] -= 1
            if not self._left[shard]:
                size = min(load.per_shard, len(load.seconds) - shard * load.per_shard) * load.bytes
                seconds += cluster.per_shard + size * cluster.per_published
        return seconds

    def _hand_out(self) -> None:
        if (task := next(self._waiting, None)) is not None:
            self._handed_out.append(task)

    def _tasks(self) -> Iterator[_Task]:
        """A task runs out of memory where one of its examples does; after a share of it that may be any."""
        load, none = self._load, 1 - self._cluster.memory_share
        for first in range(0, len(load.seconds), load.per_task):
            examples = range(first, min(first + load.per_task, len(load.seconds)))
            seconds = float(load.seconds[first:examples.stop].sum())
            dies = self._random.random() >= none ** len(examples)
            yield _Task(examples=examples, seconds=seconds, dies_after=self._random.random() if dies else inf)

    def _shards(self) -> list[int]:
        """Examples that each still waits for."""
        whole, rest = divmod(len(self._load.seconds), self._load.per_shard)
        return [self._load.per_shard] * whole + [rest] * (rest > 0)

    def _soon(self, time: float, what: str, place: int, life: int) -> None:
        self._count += 1
        heappush(self._events, (time, self._count, what, place, life))
