"""One run of units on a Ray cluster: what is handed out when, what comes back, and what is tried again."""

import shutil
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, Protocol

from dataset_builder.engine.hand_outs import HandOut, after_death, grouped, reserved, unit_costs
from dataset_builder.engine.local import Limit, Told
from dataset_builder.engine.made_by import versions
from dataset_builder.engine.node import Delivery, Shipment, here, keep, lost
from dataset_builder.engine.parcel import Parcel
from dataset_builder.engine.ray_process import News, do
from dataset_builder.engine.unit import BuildJob, planner_of, run_unit
from dataset_builder.errors import OutputError, Problem
from dataset_builder.files import require_space, size_text
from dataset_builder.remote.address import local_path
from dataset_builder.shards.published_examples import published_in

AHEAD = 2
"""Hand-outs per worker before results come back."""

LISTEN = 0.2
"""Seconds between looks at what processes tell."""

WAIT = 2.0
"""Seconds between looks at the cluster, where nothing is told."""

HEAD_LOST = ("the head of the Ray cluster does not answer any more; finished examples are kept: start it again, and "
             "run the same command again")

MARGIN = 0.95
"""Of a machine's memory that is shared out."""


@dataclass(frozen=True, kw_only=True)
class Machine:
    """One that takes work."""

    name: str
    cpus: int
    gpus: int
    memory: int
    """Bytes."""


class Cluster(Protocol):
    """What a run asks of the cluster."""

    def machines(self) -> list[Machine]:
        """Those that take work now."""

    def look(self, *, now: bool = False) -> None:
        """See which machines there are, if it is time to."""

    def say(self, line: str) -> None:
        """Tell people."""


def workers_on(machines: Sequence[Machine], backend: str) -> int:
    """How many processes may render side by side."""
    return max(sum(machine.gpus if backend == "cuda" else machine.cpus for machine in machines), 1)


class RayRunning:
    """One call of `RayCluster.run`."""

    def __init__(self, cluster: Cluster, build: str, work: Callable[..., Any], told: Told | None,
                 limit: Limit | None = None):
        import ray

        self._cluster, self._told, self._limit = cluster, told, limit or (lambda _: inf)
        self._job: BuildJob | None = None
        self._work, self._shipment = work, None
        if isinstance(work, partial) and work.args and isinstance(work.args[0], BuildJob):
            self._job, self._work = work.args[0], work.func
            self._shipment = ray.put(shipment_of(work.args[0], build))
        self._news = None if told is None else ray.remote(num_cpus=0)(News).remote()
        self._pending = dict[Any, HandOut]()
        self._distrusted = frozenset[str]()
        self._staged = self._job.staging.known() if self._job and self._work is run_unit else {}
        self._waiting = False

    def results(self, units: Sequence[Any], workers: int) -> Iterator[Any]:
        """Of all units, as they come."""
        import ray

        # Reused by all hand-outs: Ray would start a process for each function that is new to it
        task = ray.remote(max_retries=0, max_calls=0)(do)
        queue, failed = deque(self._hand_outs(units, workers)), list[Problem]()
        try:
            while queue or self._pending:
                self._cluster.look()
                self._submit(task, queue, workers)
                try:
                    done, _ = ray.wait(list(self._pending), timeout=LISTEN if self._told else WAIT)
                except (OSError, ray.exceptions.RaySystemError) as error:
                    # Ray's own process on this machine is gone, as it is where the head was here
                    raise OutputError(HEAD_LOST) from error
                self._hear()
                for ref in done:
                    hand_out = self._pending.pop(ref)
                    try:
                        deliveries = ray.get(ref)
                    except (ray.exceptions.NodeDiedError, ray.exceptions.ObjectLostError,
                            ray.exceptions.LocalRayletDiedError):
                        # No fault of the unit's
                        queue.appendleft(hand_out)
                        self._cluster.look(now=True)
                    except (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError) as error:
                        short = isinstance(error, ray.exceptions.OutOfMemoryError)
                        most = max(map(self._limit, hand_out.units))
                        late = "" if most == inf else f", or took longer than {most:,.6g} s"
                        again = after_death(
                            hand_out, "its machine ran out of memory" if short else f"its process was killed{late}")
                        if isinstance(again, Problem):
                            failed.append(again)
                        else:
                            queue.extendleft(reversed(again))
                    else:
                        yield from self._received(hand_out, deliveries, queue)
            if failed:
                raise OutputError(failed)
        finally:
            for ref in self._pending:
                with suppress(ray.exceptions.RayError, OSError):
                    ray.cancel(ref, force=True)

    def _hand_outs(self, units: Sequence[Any], workers: int) -> list[HandOut]:
        if self._job is None or self._work is not run_unit:
            return [HandOut(units=(unit,)) for unit in units]
        return grouped(units, unit_costs(planner_of(self._job), units), workers)

    def _submit(self, task: Any, queue: deque[HandOut], workers: int) -> None:
        backend = self._job.backend if self._job else "llvm"
        machines = self._cluster.machines()
        able = workers_on(machines, backend)
        most = workers if workers < able else able * AHEAD
        share = min((int(MARGIN * machine.memory) // machine.cpus for machine in machines), default=0)
        largest = max((int(MARGIN * machine.memory) for machine in machines), default=0)
        while queue and len(self._pending) < most and self._room(queue[0]):
            one = queue.popleft()
            staged = [frozenset(self._staged[ref.key] for ref in unit.examples if ref.key in self._staged)
                      - self._distrusted if self._staged else frozenset() for unit in one.units]
            ref = task.options(num_cpus=1, num_gpus=int(backend == "cuda"),
                               memory=reserved(one.tries, share, largest) or None).remote(
                [self._shipment], self._work, one.units, staged, self._distrusted, self._news,
                [self._limit(unit) for unit in one.units])
            self._pending[ref] = one

    def _room(self, coming: HandOut) -> bool:
        """Whether the disk takes what is in flight and this. Raises OutputError where nothing is in flight that could
        make room."""
        folder = self._staging_folder()
        needed = round(coming.bytes + sum(one.bytes for one in self._pending.values()))
        if folder is None or not needed:
            return True
        there = next(path for path in (folder, *folder.parents) if path.exists())
        if shutil.disk_usage(there).free >= needed:
            self._waiting = False
            return True
        if not self._pending:
            require_space(folder, needed)
        if not self._waiting:
            self._cluster.say(f"waiting for room: less than {size_text(needed)} free in {folder}")
            self._waiting = True
        return False

    def _staging_folder(self) -> Path | None:
        """Where finished examples lie, if that is a folder here."""
        if self._job is None:
            return None
        url = self._job.staging_url
        if not url:
            return here(self._job.folder)
        return local_path(url) if url.lower().startswith("file:") else None

    def _received(self, hand_out: HandOut, deliveries: Sequence[Delivery], queue: deque[HandOut]) -> Iterator[Any]:
        for unit, delivery in zip(hand_out.units, deliveries, strict=False):
            self._hear()
            if delivery.error is not None:
                raise delivery.error
            if self._job is not None:
                keep(delivery, self._job)
                if self._work is run_unit and (gone := lost(delivery.result, self._job)):
                    self._distrusted |= gone
                    queue.appendleft(replace(hand_out, units=(unit,)))
                    continue
            yield delivery.result

    def _hear(self) -> None:
        import ray

        if self._told is not None and self._news is not None:
            with suppress(ray.exceptions.RayActorError):
                for news in ray.get(self._news.take.remote()):
                    self._told(news)


def shipment_of(job: BuildJob, build: str) -> Shipment:
    """Put what machines need where they find it."""
    import ray

    job = replace(job, spec_path=here(job.spec_path), folder=here(job.folder), threads=1,
                  cache=job.cache and here(job.cache))
    loaded = planner_of(job).loaded
    parcel, paths = Parcel.of(loaded)
    shelf = job.fields.folder
    fields = {path.stem: ray.put(path.read_bytes()) for path in sorted(shelf.glob("*.npz"))} \
        if loaded.dataset.fields and shelf is not None and shelf.is_dir() else {}
    return Shipment(build=build, job=job, made_by=versions(job.backend, loaded.dataset), parcel=parcel,
                    contents=tuple(ray.put(path.read_bytes()) for path in paths), fields=fields,
                    published=published_in(job.folder, job.replaces).digests)
