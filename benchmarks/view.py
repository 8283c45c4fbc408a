"""How long `dataset-builder view` takes: to its picture and in all, with kernels compiled before and without.

`python benchmarks/view.py [SPEC ...]`. Each run is a process of its own, with a home folder that holds its kernels or
none. Medians of three; seconds of the processor are of all threads. The bound is 10 s in all on two idle cores; the
load of the machine is printed with the times.
"""

import argparse
import os
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
MINI = ROOT / "scene_specs" / "3df-lighting-mini.yaml"
REPEATS, SIDE = 3, 100
BOUND = 10.0


def own_mesh(folder: Path) -> Path:
    """A spec whose object is a mesh file, a bowl of 19,602 triangles, in an embedded room."""
    x, y = (axis.ravel() for axis in np.mgrid[0:SIDE, 0:SIDE] / (SIDE - 1) - 0.5)
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel() + 1
    faces = np.concatenate([np.stack([corner, corner + SIDE, corner + 1], 1),
                            np.stack([corner + 1, corner + SIDE, corner + SIDE + 1], 1)])
    lines = [f"v {a:.5f} {b:.5f} {1.6 * (a * a + b * b):.5f}" for a, b in zip(x, y, strict=True)]
    (folder / "bowl.obj").write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in faces)]) + "\n")
    (folder / "bowl.yaml").write_text("file: bowl.obj\ncategory: bowl\nlicence: CC0-1.0\nup: z\nscale: 0.4\n")
    scenes = os.path.relpath(ROOT / "scene_specs" / "scenes" / "living_room.yaml", folder)
    spec = folder / "own.yaml"
    spec.write_text("name: own\nsplits:\n  - name: train\n    objects: {count: 1, from: [bowl.yaml]}\n"
                    f"    scenes: {{count: 1, from: [{scenes}]}}\n    views: 4\n")
    return spec


def view(spec: Path, home: Path, *more: str) -> tuple[float, float, float]:
    """Seconds to the picture and in all, and of the processor."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), perf_counter()
    command = [sys.executable, "-u", "-m", "dataset_builder", "view", str(spec), "--out", str(home / "view"), *more]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT,
                          env={**os.environ, "HOME": str(home), "PYTHONPATH": str(ROOT)}) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        picture = perf_counter() - start
        process.stdout.read()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if process.returncode or not line.startswith("picture: "):
        raise SystemExit(f"view failed: {line}")
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return picture, perf_counter() - start, used


def main() -> None:
    """Print a row for each spec and kind of run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("specs", nargs="*", type=Path)
    with TemporaryDirectory() as folder:
        specs = parser.parse_args().specs or [MINI, own_mesh(Path(folder))]
        print(f"{'spec':22} {'kernels':10} {'picture':>9} {'in all':>9} {'processor':>9}   of {BOUND:g} s")
        for spec in specs:
            for kind, more in (("cold", ()), ("warm", ()), ("none", ("--no-preview",))):
                homes = [Path(folder) / f"{spec.stem}-{k if kind == 'cold' else 0}" for k in range(REPEATS)]
                runs = []
                for home in homes:
                    home.mkdir(exist_ok=True)
                    runs.append(view(spec, home, *more))
                times = [f"{median(column):8.1f}s" for column in zip(*runs, strict=True)]
                print(f"{spec.stem:22} {kind:10} {' '.join(times)}   load {os.getloadavg()[0]:.1f}", flush=True)


if __name__ == "__main__":
    main()
