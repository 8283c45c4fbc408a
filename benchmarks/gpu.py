"""A GPU beside the CPU, on the mini dataset: examples per hour, seconds of compiling kernels, memory.

Each backend runs in processes of its own: once with no kernels on the disk (cold), once with those of the first (warm).
Where there is no GPU, the CPU's column stands alone. No bound: the figures are what is asked for.
"""

import argparse
import json
import os
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter

import _common as common
import drjit as dr

from dataset_builder.planning.plan import Planner
from dataset_builder.rendering import plugins
from dataset_builder.rendering.backend import activate, cuda_available
from dataset_builder.rendering.device import bytes_in_use
from dataset_builder.rendering.examples import render_view
from dataset_builder.spec.load import load_dataset

MIB = 2**20
ROWS = (("first", "s for the first example"), ("compiled", "s of compiling kernels"), ("kernels", "kernels compiled"),
        ("hourly", "examples per hour after it"), ("mib", "MiB in use at most, beyond those at the start"))


def side(backend: str, examples: int) -> dict[str, float]:
    """Figures of one backend in this process. The first example compiles what the others need, too."""
    activate(backend)
    plugins.register()
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    planner, spent, compiled, kernels = Planner(load_dataset(common.MINI)), [], 0.0, 0
    dr.eval(dr.zeros(dr.auto.Float, 1))
    begin, most = bytes_in_use(), 0
    for ref in planner.examples[:examples + 1]:
        plan, start = planner.example(ref), perf_counter()
        next(render_view([plan], planner.loaded.path.parent))
        spent.append(perf_counter() - start)
        new = [kernel for kernel in dr.kernel_history() if not kernel.get("cache_hit", True)]
        compiled, kernels = compiled + sum(kernel["backend_time"] for kernel in new) / 1e3, kernels + len(new)
        dr.kernel_history_clear()
        most = max(most, bytes_in_use())
    return {"first": spent[0], "compiled": compiled, "kernels": kernels, "hourly": 3600 * examples / sum(spent[1:]),
            "mib": (most - begin) / MIB}


def measured(backend: str, examples: int, folder: str) -> dict[str, float]:
    """`side` in a process whose kernels are kept in `folder`."""
    command = [sys.executable, __file__, "--side", backend, "--examples", str(examples)]
    environment = {**os.environ, "DRJIT_CACHE_DIR": folder}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=16, help="after the first (default: 16)")
    parser.add_argument("--side", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.side:
        print(json.dumps(side(args.side, args.examples)))
        return 0
    found = {}
    for backend in ("llvm", *(("cuda",) if cuda_available() else ())):
        with TemporaryDirectory() as folder:
            for state in ("cold", "warm"):
                found[f"{backend}, {state}"] = measured(backend, args.examples, folder)
    print(f"{'':>48}" + "".join(f"{name:>14}" for name in found))
    for key, title in ROWS:
        print(f"{title:>48}" + "".join(f"{figures[key]:>14.1f}" for figures in found.values()))
    if not cuda_available():
        print("no NVIDIA GPU here: the CPU alone")
    return 0


if __name__ == "__main__":
    sys.exit(main())
