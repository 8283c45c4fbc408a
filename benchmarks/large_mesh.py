"""CPU seconds and memory of scans of 0.5 to 2 million triangles through repair, Loop subdivision and noise.

A scan-like mesh is made in code: a bumpy closed ball whose triangles come without shared vertices, as from STL. Each
size runs in a process of its own, whose peak of memory counts. One round of Loop subdivision makes four triangles of
each, up to the budget of `geometry.subdivision.MAX_FACES`; beyond it, noise moves the scan's own vertices. Bound:
repair takes at most `BOUND` times as long per triangle at the largest size as at the smallest.
"""

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Callable
from time import process_time
from typing import Any

import numpy as np

from dataset_builder.geometry.edges import corner_normals
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.raycast import open3d
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.rough_base import bounding_radius, displace, rough_base
from dataset_builder.geometry.roughness import measure_roughness
from dataset_builder.geometry.shape_faults import shape_faults
from dataset_builder.geometry.subdivision import MAX_FACES
from dataset_builder.seeding import rng

SIZES = (500_000, 1_000_000, 2_000_000)
BOUND = 1.6
MEBIBYTE = 1 << 20


def scan(triangles: int) -> TriangleMesh:
    """A closed surface of about as many triangles, each with vertices of its own; metres."""
    rings = int(np.sqrt(triangles / 4))
    height, turn = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings, indexing="ij")
    radius = 1 + 0.05 * np.sin(9 * turn) * np.sin(7 * height) * np.sin(height) ** 2
    # The poles are one place each, to the bit
    across = np.where(np.isin(np.arange(rings + 1), (0, rings)), 0.0, np.sin(height[:, 0]))[:, None]
    positions = np.stack([radius * across * np.cos(turn), radius * across * np.sin(turn), radius * np.cos(height)], 2)
    low, here = np.indices((rings, 2 * rings)).reshape(2, -1)
    ahead = (here + 1) % (2 * rings)
    a, b, c, d = (low * 2 * rings + here, (low + 1) * 2 * rings + here, (low + 1) * 2 * rings + ahead,
                  low * 2 * rings + ahead)
    faces = np.concatenate([np.stack([a, b, c], 1)[low < rings - 1], np.stack([a, c, d], 1)[low > 0]])
    corners = positions.reshape(-1, 3)[faces].reshape(-1, 3)
    return TriangleMesh(positions=corners, faces=np.arange(len(corners)).reshape(-1, 3),
                        uvs=np.zeros((len(faces), 3, 2)), material=np.zeros(len(faces), int))


def measure(triangles: int, rounds: int) -> dict[str, float]:
    """CPU seconds by step, and the peak of memory after it in mebibytes."""
    found: dict[str, float] = {}
    open3d()  # importing it is no part of the work

    def step(name: str, work: Callable[[], Any]) -> Any:
        begin = process_time()
        result = work()
        found[name] = process_time() - begin
        found[f"{name} MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / MEBIBYTE
        return result

    raw = step("made", lambda: scan(triangles))
    mended, report = step("repair", lambda: repair(raw))
    if not (report.closed == report.pieces == 1 and mended.volume > 0):
        raise AssertionError(f"expected one closed piece, got {report}")
    faults = step("faults", lambda: shape_faults(mended))
    if faults.notes:
        raise AssertionError(f"expected a sound shape, got {faults}")
    base = step("Loop", lambda: rough_base(mended, edge_length=1.0, rounds=rounds, crease_angle=30))
    rough = step("noise", lambda: displace(base.mesh, sigma=0.002, radius=bounding_radius(mended), direction="normal",
                                           rng=rng(0)))
    step("normals", lambda: corner_normals(rough, creases=base.creases))
    step("measured", lambda: measure_roughness(rough, mended, rng(0)))
    return found | {"triangles": len(mended.faces), "rough triangles": len(rough.faces)}


def apart(triangles: int, rounds: int) -> dict[str, float]:
    """`measure` in a process of its own."""
    command = [sys.executable, __file__, "--one", str(triangles), str(rounds)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> int:
    """Print the figures; exit code 1 where the bound is broken."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--one", type=int, nargs=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(*options.one)))
        return 0
    runs = [apart(size, int(4 * size <= MAX_FACES)) for size in options.sizes]
    steps = [name for name in runs[0] if f"{name} MiB" in runs[0]]
    print(f"{'triangles':>10} {'rough':>10} " + " ".join(f"{name:>16}" for name in steps))
    for run in runs:
        print(f"{run['triangles']:>10,} {run['rough triangles']:>10,} "
              + " ".join(f"{run[name]:>6.1f} s {run[name + ' MiB']:>5.0f} MiB" for name in steps))
    first, last = runs[0], runs[-1]
    growth = last["repair"] / last["triangles"] / (first["repair"] / first["triangles"])
    print(f"repair per triangle, largest over smallest: {growth:.2f} (bound {BOUND})")
    return 0 if growth <= BOUND else 1


if __name__ == "__main__":
    sys.exit(main())
