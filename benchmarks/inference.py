"""What a prediction takes: seconds and memory of LighTNet at 800x800, at its small and its full width.

Each width has a process of its own, whose largest resident size the system keeps. The input is made up, a disc that
covers a third of the frame: nothing that a network does depends on what it sees. The paper states about 4 s per
rendered image on one V100.
"""

import argparse
import json
import resource
import subprocess
import sys
from time import perf_counter, process_time

WIDTHS, SIZE, REPEATS = (16, 64), 800, 3
MIB = 2**20
UNIT = 1 if sys.platform == "darwin" else 1024
"""Bytes per unit of `ru_maxrss`."""


def measure(width: int, size: int, repeats: int, device: str) -> dict[str, float | str]:
    """Best of some predictions after one to warm up, in this process; sizes in MiB."""
    import torch

    from dataset_builder.lightnet.data.batch import Inputs
    from dataset_builder.lightnet.methods.checkpoint import build_method
    from dataset_builder.lightnet.methods.method import choose, count_parameters, precision_on, predict
    from dataset_builder.lightnet.settings import TrainingSpec

    where = choose(device)
    spec = TrainingSpec.model_validate({"model": {"width": width}, "objective": {"fr": 0}})
    method = build_method(spec).to(where).eval()
    away = torch.linspace(-1, 1, size).square()
    inside = (away[:, None] + away[None] < 0.42).float().expand(1, 1, size, size).to(where)
    images = [torch.rand(1, 3, size, size, generator=torch.Generator().manual_seed(seed)).to(where) * inside
              for seed in (0, 1)]
    inputs = Inputs(i_s=images[0], s_prime=images[1], inside=inside, sh=torch.zeros(1, 3, 9, device=where))
    before, times = resident(), list[tuple[float, float]]()
    for _ in range(1 + repeats):
        begin, worked = perf_counter(), process_time()
        predict(method, inputs, precision_on(where, "auto")).i_t.sum().item()
        times.append((perf_counter() - begin, process_time() - worked))
    name = torch.cuda.get_device_name(where) if where.type == "cuda" else f"CPU, {torch.get_num_threads()} threads"
    wall, worked = (min(kind) for kind in zip(*times[1:], strict=True))
    return {"device": name, "parameters": count_parameters(method), "first": times[0][0], "seconds": wall,
            "worked": worked, "before": before, "peak": resident(),
            "card": torch.cuda.max_memory_allocated(where) / MIB if where.type == "cuda" else 0.0}


def resident() -> float:
    """Largest resident size of this process so far, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * UNIT / MIB


def in_process(width: int, options: argparse.Namespace) -> dict:
    """`measure` in a process of its own."""
    command = [sys.executable, __file__, "--width", str(width), "--size", str(options.size), "--repeats",
               str(options.repeats), "--device", options.device]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def main() -> int:
    """Print the figures and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=SIZE)
    parser.add_argument("--repeats", type=int, default=REPEATS)
    parser.add_argument("--device", choices=("auto", "cpu", "cuda"), default="auto")
    parser.add_argument("--width", type=int, help="measure this width in this process and print JSON")
    options = parser.parse_args()
    if options.width:
        print(json.dumps(measure(options.width, options.size, options.repeats, options.device)))
        return 0
    found = {width: in_process(width, options) for width in WIDTHS}
    for width, one in found.items():
        card = f", {one['card']:.0f} MiB on the card" if one["card"] else ""
        print(f"LighTNet of width {width} ({one['parameters'] / 1e6:.2f} M parameters), {options.size}x{options.size}, "
              f"{one['device']}: {one['seconds']:.2f} s per image ({one['worked']:.2f} s of processor time; the first "
              f"{one['first']:.2f} s), peak memory "
              f"{one['peak']:.0f} MiB, {one['peak'] - one['before']:.0f} of it for predictions{card}")
    small, full = (found[width] for width in WIDTHS)
    print(f"width {WIDTHS[1]} over width {WIDTHS[0]}: {full['seconds'] / small['seconds']:.1f} times the time by the "
          f"clock, {full['worked'] / small['worked']:.1f} times the processor time, "
          f"{full['peak'] / small['peak']:.1f} times the memory")
    return 0


if __name__ == "__main__":
    sys.exit(main())
