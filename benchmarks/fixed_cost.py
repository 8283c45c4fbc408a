"""What a pass costs beyond its kernels, on the mini dataset after its first example, and the rates `plan` predicts by.

One thread, as a build with one worker per core runs. Fixed cost of a pass = its wall time (scene, upload, acceleration
structure, tracing, launches, copies, Python) less the execution of its kernels. Bound: 15% of wall time; meshes,
planning and encoding count as wall time.
"""

import gc
import sys
from collections import Counter
from time import perf_counter

import _common as common
import drjit as dr

from dataset_builder.planning.plan import Planner
from dataset_builder.rendering.backend import activate
from dataset_builder.rendering.examples import render_view
from dataset_builder.shards.example import Example, encode_members, preview
from dataset_builder.shards.segment import segment
from dataset_builder.spec.load import load_dataset

VIEWS, BOUND = 24, 0.15
FREE = ("first_hit", "first_hit_rough")


def encode(rendered) -> int:
    """Bytes of an example in a shard."""
    example = Example(plan=rendered.plan, record=rendered.record, layers=rendered.layers)
    return len(segment(encode_members(example, dtype="float32", preview_png=preview(rendered.layers))))


def measure(planner: Planner, indices: range) -> Counter[str]:
    """Sums over views: seconds by step and pass, kernel seconds, paths, passes, bytes."""
    total: Counter[str] = Counter()
    for index in indices:
        begin = perf_counter()
        plan = planner.example(planner.examples[index])
        planned = perf_counter()
        dr.kernel_history_clear()
        rendered = next(render_view([plan], planner.loaded.path.parent))
        done = perf_counter()
        total["bytes"] += encode(rendered)
        total.update(rendered.seconds | {"plan": planned - begin, "encode": perf_counter() - done,
                                         "wall": perf_counter() - begin, "passes": len(rendered.seconds)})
        total["kernels"] += sum(kernel["execution_time"] for kernel in dr.kernel_history()) / 1e3
        for entry in rendered.record.passes:
            total["free paths" if entry.name in FREE else "light paths"] += entry.paths
    return total


def main() -> int:
    """Print the figures; exit code 1 where the bound is broken."""
    print(f"backend: {activate('auto', 1).summary}, one thread")
    planner = Planner(load_dataset(common.MINI))
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    measure(planner, range(1))
    gc.collect()
    found = measure(planner, range(1, 1 + VIEWS))
    passes = {name: found[name] for name in (*FREE, "source", "target", "rough")}
    fixed = sum(passes.values()) - found["kernels"]
    share = fixed / found["wall"]
    print(f"{found['passes']} passes in {VIEWS} views: {fixed / found['passes']:.3f} s each beyond their kernels, "
          f"{share:.1%} of wall time (bound {BOUND:.0%})")
    lit = found["wall"] - sum(found[name] for name in (*passes, "plan", "encode"))
    print(f"wall time per view {found['wall'] / VIEWS:.2f} s: kernels {found['kernels'] / VIEWS:.2f}, fixed cost of "
          f"passes {fixed / VIEWS:.2f}, planning {found['plan'] / VIEWS:.2f}, meshes {lit / VIEWS:.2f}, "
          f"encoding {found['encode'] / VIEWS:.2f}")
    lights = sum(passes[name] for name in ("source", "target", "rough"))
    frees = sum(passes[name] for name in FREE)
    print(f"paths per second and core: {found['light paths'] / lights:.3g} with light, "
          f"{found['free paths'] / frees:.3g} without; {found['bytes'] / VIEWS / 1e3:.0f} kB per example")
    return 0 if share <= BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
