"""What an engine costs per unit: CPU seconds of all of its processes beyond those of the work itself.

Units that do nothing, and tiny ones. The cost of N units less that of a few, over the difference, so that starting the
engine is told apart; runs take turns, the least of several counts. What the processes of a Ray that has nothing to do
take, second by second, is measured first and left out. Wall time says little where the machine does other things
besides.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from time import monotonic, process_time, sleep

import psutil

from dataset_builder.engine import local
from dataset_builder.engine.ray_cluster import RayCluster
from tests.engine.ray_machines import cluster_of

WORKERS = (1, 2, 4, 8)
FEW, BLOCK = 20, bytes(10**6)
ROUNDS = 8
"""Of hashing in a tiny unit."""

Run = Callable[..., Iterator[object]]


def nothing(unit: int) -> float:
    """A unit that does nothing; its CPU seconds."""
    return 0.0


def tiny(unit: int) -> float:
    """A unit of a few milliseconds; its CPU seconds."""
    begin = process_time()
    for _ in range(ROUNDS):
        sha256(BLOCK)
    return process_time() - begin


def cpu() -> float:
    """CPU seconds of this process and of all that it started, living or not."""
    own, total = psutil.Process(), 0.0
    for process in (own, *own.children(recursive=True)):
        try:
            times = process.cpu_times()
        except psutil.NoSuchProcess:
            continue
        total += times.user + times.system + times.children_user + times.children_system
    return total


def idle(seconds: float = 5.0) -> float:
    """CPU seconds that all processes take per second of doing nothing."""
    begin, start = cpu(), monotonic()
    sleep(seconds)
    return (cpu() - begin) / (monotonic() - start)


def spent(run: Run, work: Callable[[int], float], count: int, workers: int, idling: float) -> float:
    """CPU seconds of a run beyond those of its units, and of doing nothing for as long."""
    begin, start = cpu(), monotonic()
    inside = sum(run(work, range(count), workers=workers))  # type: ignore[arg-type]
    return cpu() - begin - inside - idling * (monotonic() - start)


def figures(runs: dict[str, Run], workers: int, count: int, repeats: int) -> None:
    """Print a row for each engine and kind of unit."""
    kinds = {(name, work): ([], []) for name in runs for work in (nothing, tiny)}
    for name, work in kinds:
        spent(runs[name], work, FEW, workers, 0.0)
    idling = idle()
    for _ in range(repeats):
        for (name, work), (few, many) in kinds.items():
            few.append(spent(runs[name], work, FEW, workers, idling))
            many.append(spent(runs[name], work, FEW + count, workers, idling))
    for (name, work), (few, many) in kinds.items():
        print(f"| {name} | {workers} | {work.__name__} | {(min(many) - min(few)) / count * 1e3:.2f} | {min(few):.2f} |",
              flush=True)
    print(f"a Ray with {workers} workers that has nothing to do: {idling:.2f} CPU seconds per second", file=sys.stderr)


def main() -> int:
    """Print the table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--units", type=int, default=400)
    options.add_argument("--repeats", type=int, default=3)
    asked = options.parse_args()
    print("| engine | workers | unit | CPU ms per unit | CPU s of a run of 20 |\n| --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as temporary:
        for workers in WORKERS:
            with cluster_of(1, Path(temporary), cpus=workers), RayCluster() as cluster:
                figures({"local": partial(local.run), "ray": cluster.run}, workers, asked.units, asked.repeats)
    return 0


if __name__ == "__main__":
    sys.exit(main())
