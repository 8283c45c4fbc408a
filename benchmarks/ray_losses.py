"""A build on Ray that loses two of three machines, then its head, against one that loses nothing and a local one.

Machines are processes of this one, with a core each, so that seconds say what the cluster costs, not what it gains.
Prints wall seconds, and whether the bytes are those of the local build; exit code 1 where they are not.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep
from typing import Any

from tests.engine.ray_machines import cluster_of, finished
from tests.small_specs import contents

SPEC = "scene_specs/3df-lighting-mini.yaml"
SMALLER = ("--set", "image={width: 48, height: 48}", "--set", "render.spp=16")
MACHINES = 3


@dataclass
class Command:
    """A build, as a user types it."""

    out: Path
    address: str = ""
    """Of a cluster; on this machine alone where it is empty."""

    def start(self) -> subprocess.Popen[str]:
        """Begin it, or go on."""
        where = ["--engine", "ray", "--address", self.address] if self.address else ["--workers", str(MACHINES)]
        arguments = ["build", SPEC, "--out", str(self.out), "--backend", "llvm", *SMALLER, *where]
        return subprocess.Popen([sys.executable, "-m", "dataset_builder", *arguments], stdout=subprocess.DEVNULL,
                                stderr=subprocess.DEVNULL, text=True)


def timed(command: Command, losses: dict[int, Callable[[], Any]]) -> float:
    """Seconds of a build during which something is lost each time that so many examples are finished."""
    begin, process, left = perf_counter(), command.start(), dict(losses)
    while process.poll() is None:
        for count in [count for count in left if finished(command.out) >= count]:
            left.pop(count)()
        sleep(0.1)
    if left and command.address:
        raise SystemExit(f"the build ended before {min(left)} examples were seen: nothing was lost")
    return perf_counter() - begin


def main() -> int:
    """Run all four, and compare."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    with TemporaryDirectory() as name:
        folder, rows = Path(name), dict[str, float]()
        rows[f"local, {MACHINES} workers"] = timed(Command(folder / "local"), {})
        with cluster_of(MACHINES, folder, connected=False) as cluster:
            rows[f"Ray, {MACHINES} machines"] = timed(Command(folder / "ray", cluster.address), {})
            victims = [node for node in cluster.worker_nodes if node is not cluster.head_node][:2]
            losses = {count: lambda node=node: cluster.remove_node(node, allow_graceful=False)
                      for count, node in zip((8, 24), victims, strict=True)}
            rows["Ray, two of three machines killed"] = timed(Command(folder / "lost", cluster.address), losses)
        with cluster_of(MACHINES, folder, connected=False) as cluster:
            def lose_the_head() -> None:
                cluster.head_node.kill_gcs_server(check_alive=False)
                cluster.head_node.kill_raylet(check_alive=False)

            first = timed(Command(folder / "head", cluster.address), {24: lose_the_head})
        with cluster_of(MACHINES, folder, connected=False) as cluster:
            rows["Ray, the head killed and a new one"] = first + timed(Command(folder / "head", cluster.address), {})
        whole = contents(folder / "local")
        equal = {name: contents(folder / name) == whole for name in ("ray", "lost", "head")}
    print("| build | wall seconds |\n| --- | --- |")
    for name, seconds in rows.items():
        print(f"| {name} | {seconds:.0f} |")
    print(f"equal bytes: {equal}")
    return 0 if all(equal.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
