"""Run units on the machines of a Ray cluster, with the promises of `engine.local`."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext, suppress
from math import inf
from socket import create_connection
from time import monotonic, sleep
from types import TracebackType
from typing import Any
from uuid import uuid4
from warnings import catch_warnings, simplefilter

from dataset_builder.engine.local import Limit, Told
from dataset_builder.engine.parcel import forget
from dataset_builder.engine.ray_running import HEAD_LOST, Machine, RayRunning, workers_on
from dataset_builder.errors import OutputError, UserError
from dataset_builder.extras import missing_named
from dataset_builder.processes import cores

LOOK = 5.0
"""Seconds between looks at which machines there are."""

PATIENCE = 10.0
"""Seconds that the head has to answer."""

FAREWELL = 5.0
"""Seconds that machines have to clear away what a build left there."""

QUIET = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
"""A Ray that is started here tells nobody, and leaves the variables of GPUs as they are."""


class RayCluster:
    """A cluster, local to this machine where no address is given, from `with` on; say: takes lines for people."""

    def __init__(self, address: str | None = None, *, say: Callable[[str], None] = lambda line: None,
                 cpus: int | None = None):
        self._address, self._say, self._cpus = address, say, cpus
        self._build, self._began = uuid4().hex, False
        self._machines, self._looked, self._head = list[Machine](), -inf, ("", 0)

    def __enter__(self) -> "RayCluster":
        with missing_named():
            import ray

        if not ray.is_initialized():
            for name, value in QUIET.items():
                os.environ.setdefault(name, value)
            local = {} if self._address or "RAY_ADDRESS" in os.environ else {
                "num_cpus": self._cpus or cores(), "include_dashboard": False}
            try:
                _knock(self._address or os.environ.get("RAY_ADDRESS", ""))
                with catch_warnings():
                    # What it warns of is raised, too
                    simplefilter("ignore", UserWarning)
                    ray.init(self._address, log_to_driver=False, configure_logging=False, logging_level="ERROR",
                             **local)
            except (OSError, ValueError, RuntimeError) as error:
                raise UserError(f"--address: expected a Ray cluster at {self._address or 'this machine'}, got: "
                                f"{str(error).strip().splitlines()[0]}; start one with `ray start --head`") from error
            self._began = True
        if not ray.util.client.ray.is_connected():
            host, _, port = ray.get_runtime_context().gcs_address.rpartition(":")
            self._head = host, int(port)
        self._machines = self._found()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        import ray

        if kind is None or (issubclass(kind, Exception) and self._head_answers()):
            with suppress(OSError):
                self._clear_away()
        if self._began:
            ray.shutdown()
            self._began = False

    def machines(self) -> list[Machine]:
        """Those that take work, as of the last look."""
        return self._machines

    def _found(self) -> list[Machine]:
        import ray

        found = [(node, node["Resources"]) for node in ray.nodes() if node["Alive"]]
        return [Machine(name=node["NodeManagerHostname"], cpus=int(there["CPU"]), gpus=int(there.get("GPU", 0)),
                        memory=int(there.get("memory", 0))) for node, there in found if there.get("CPU", 0) >= 1]

    def workers(self, backend: str) -> int:
        """How many processes may render side by side."""
        return workers_on(self.machines(), backend)

    def backend(self, wanted: str) -> str:
        """What renders: as wanted, or, for `auto`, CUDA where every machine has a GPU, else LLVM. Two never mix."""
        machines = self.machines()
        if wanted != "auto":
            return wanted
        return "cuda" if machines and all(machine.gpus for machine in machines) else "llvm"

    def summary(self, backend: str, workers: int | None) -> str:
        """One line for the start of a build."""
        machines = self.machines()
        gpus = sum(machine.gpus > 0 for machine in machines)
        count, able = len(machines), workers or self.workers(backend)
        idle = f"; GPUs of {gpus} of {count} machines are not used, since not all have one" \
            if backend == "llvm" and 0 < gpus < count else ""
        where = _shown(self._address) if self._address else "on this machine"
        return f"engine: Ray {where}, {count} machine{'s' * (count != 1)}, {able} workers, {backend} on all{idle}"

    def run(self, work: Callable[..., Any], units: Iterable[Any], *, workers: int,
            told: Told | None = None, limit: Limit | None = None) -> Iterator[Any]:
        """As `local.run`, but that no worker is this process. A unit of examples may come back in parts.

        Raises what `work` raises, OutputError where a unit's process dies as often as it is tried and where there is no
        room, and UserError, naming the machine, where one has other versions. What was finished is kept.
        """
        if left := list(units):
            with self if not _connected() else nullcontext():
                yield from RayRunning(self, self._build, work, told, limit).results(left, workers)

    def look(self, *, now: bool = False) -> None:
        """See which machines there are, where the last look was a while ago, or `now`; say where some came or went.
        Raises OutputError where the head is gone: Ray itself would end this process without a word."""
        if not now and monotonic() - self._looked < LOOK:
            return
        if not self._head_answers():
            raise OutputError(HEAD_LOST)
        before, self._machines, self._looked = len(self._machines), self._found(), monotonic()
        if (after := len(self._machines)) != before:
            self._say(f"{after} machine{'s' * (after != 1)} now, {abs(after - before)} "
                      f"{'more' if after > before else 'lost: what was at work there is done elsewhere'}")

    def _head_answers(self) -> bool:
        """Whether the head of the cluster takes connections; through a client, Ray says so by itself."""
        end = monotonic() + PATIENCE
        while self._head[0]:
            try:
                with create_connection(self._head, timeout=PATIENCE):
                    return True
            except OSError:
                if monotonic() > end:
                    return False
                sleep(PATIENCE / 10)
        return True

    def say(self, line: str) -> None:
        """Tell people."""
        self._say(line)

    def _clear_away(self) -> None:
        """Let the folders of this build go on every machine that is there."""
        import ray
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy as On

        with suppress(ray.exceptions.RayError, ConnectionError, RuntimeError):
            clear = ray.remote(num_cpus=0, max_retries=0)(forget)
            left = [clear.options(scheduling_strategy=On(node["NodeID"], soft=False)).remote(self._build)
                    for node in ray.nodes() if node["Alive"]]
            ray.wait(left, num_returns=len(left), timeout=FAREWELL)


def _knock(address: str) -> None:
    """Raise OSError where nothing listens at HOST:PORT: Ray would go on asking for many minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdecimal():
        create_connection((host, int(port)), timeout=PATIENCE).close()


def _connected() -> bool:
    with missing_named():
        import ray

    return bool(ray.is_initialized())


def _shown(address: str) -> str:
    return f"at {address.rpartition('@')[2]}"


def run(work: Callable[..., Any], units: Iterable[Any], *, workers: int, told: Told | None = None,
        limit: Limit | None = None) -> Iterator[Any]:
    """`RayCluster.run` on the cluster that this process is connected to, else on this machine alone."""
    return RayCluster(cpus=workers).run(work, units, workers=workers, told=told, limit=limit)
