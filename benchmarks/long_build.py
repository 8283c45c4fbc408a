"""Does a long build stay flat: thousands of tiny examples in one process, measured every hundred.

Prints, for each hundred examples, CPU seconds, memory, open files, threads, Python objects, kernels that were new, and
bytes that the build keeps beside the shards, and draws them (`--figure`). Bounds are on what grew between the first
hundred and the last. Exit code 1 where one is broken.
"""

import argparse
import gc
import json
import resource
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import drjit as dr
import psutil

from dataset_builder.builder import build
from dataset_builder.rendering.backend import activate
from dataset_builder.shards.folder import WORK
from dataset_builder.spec.load import load_dataset

OBJECTS = ("cabinet", "nightstand", "ottoman", "stool")
SPEC = """\
name: long-build
seed: 1
image: {{width: 16, height: 16}}
layers: {{i_s: frame, i_t: frame, d: object, r: object, s_prime: object, mask: object, mask_rough: object}}
render: {{spp: 16, max_depth: 3}}
rough: {{sigma: [0.0, 0.006], edge_length: 0.2, rounds: 0}}
camera: {{azimuth: {{uniform: [-180, 180]}}, elevation: {{uniform: [10, 40]}}, coverage: [0.1, 0.5]}}
gates: {{mask_overlap: 0.85}}
storage: {{examples_per_shard: 100}}
splits:
  - name: train
    objects: {{count: 10, from: [{objects}]}}
    scenes: {{count: {scenes}, from: [scenes/den.yaml]}}
    lights: 2
"""
PER_SCENE = 40
"""Examples: ten objects under two lights at two noise levels."""
ROOM = "width: {uniform: [3.5, 4.5]}\ndepth: {uniform: [3.5, 4]}\nheight: 2.5\nwindows: 1\n"
MIB = 2**20
SLOWER, MEMORY, KERNELS = 1.1, 40.0, 8
"""Bounds: seconds per example in the second half over the first, MiB more in a thousand examples, and new kernels."""
TITLES = {"each": "CPU seconds per example", "rss": "memory, MiB", "objects": "Python objects", "files": "open files",
          "threads": "threads", "kernels": "different kernels", "kept": "notes beside shards, KiB",
          "rejected": "rejected examples"}


@dataclass(frozen=True, kw_only=True)
class Sample:
    """The process after so many examples."""

    examples: int
    seconds: float
    """Of CPU, of this process, since the start."""
    rss: float
    """MiB."""
    files: int
    """Open ones."""
    threads: int
    objects: int
    """Of Python, that its collector knows."""
    kernels: int
    """Different ones that ran so far."""
    kept: float
    """KiB below `.build` that are neither staged examples nor remembered passes nor shards."""
    rejected: int


def write_spec(folder: Path, examples: int) -> Path:
    """A dataset of about so many examples, with its files."""
    for name in OBJECTS:
        (folder / f"{name}.yaml").write_text(f"family: {name}\n", encoding="utf-8")
    (folder / "scenes").mkdir()
    (folder / "room.yaml").write_text(ROOM, encoding="utf-8")
    den = "room: ../room.yaml\nfurniture:\n  - {object: ../stool.yaml, place: near}\n"
    (folder / "scenes" / "den.yaml").write_text(den, encoding="utf-8")
    path = folder / "long.yaml"
    objects = ", ".join(f"{name}.yaml" for name in OBJECTS)
    path.write_text(SPEC.format(objects=objects, scenes=max(1, examples // PER_SCENE)), encoding="utf-8")
    return path


def samples(spec: Path, out: Path, every: int) -> Iterator[Sample]:
    """Build, and look at this process every so many examples."""
    process, kernels, done, rejected = psutil.Process(), set[int](), 0, 0
    for event in build(load_dataset(spec), out, backend="auto", workers=1):
        kernels.update(kernel["hash"] for kernel in dr.kernel_history() if "hash" in kernel)
        dr.kernel_history_clear()
        before = done
        done += len(event.outcomes)
        rejected += sum(outcome.rejected is not None for outcome in event.outcomes)
        if done // every > before // every:
            gc.collect()
            used = resource.getrusage(resource.RUSAGE_SELF)
            yield Sample(examples=done, seconds=used.ru_utime + used.ru_stime, rss=process.memory_info().rss / MIB,
                         files=process.num_fds(), threads=process.num_threads(), objects=len(gc.get_objects()),
                         kernels=len(kernels), kept=kept(out) / 1024, rejected=rejected)


def kept(out: Path) -> int:
    """Bytes of what a build notes for its next run."""
    return sum(path.stat().st_size for path in (out / WORK).iterdir() if path.is_file())


def told(rows: Sequence[Sample]) -> bool:
    """Print what grew between the first hundreds and the last; whether all is within its bound."""
    first, last, half = rows[0], rows[-1], rows[len(rows) // 2]
    thousands = (last.examples - first.examples) / 1000
    if thousands <= 0:
        return True
    early, late = ((b.seconds - a.seconds) / max(b.examples - a.examples, 1) for a, b in ((first, half), (half, last)))
    figures = {"seconds per example, second half over first": (late / early, SLOWER),
               "MiB per thousand examples": ((last.rss - first.rss) / thousands, MEMORY),
               "open files more": (last.files - first.files, 0), "threads more": (last.threads - first.threads, 0),
               "kernels more": (last.kernels - first.kernels, KERNELS)}
    for title, (value, bound) in figures.items():
        print(f"{title}: {value:.3g} (bound {bound:g})")
    print(f"Python objects per example: {(last.objects - first.objects) / thousands / 1000:.1f}; notes beside the "
          f"shards: {(last.kept - first.kept) / thousands:.1f} KiB per thousand examples")
    return all(value <= bound for value, bound in figures.values())


def draw(runs: Mapping[str, Sequence[Sample]], path: Path) -> None:
    """Every figure against the number of examples, a line for each run."""
    import matplotlib
    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 4, figsize=(14, 6), layout="constrained")
    for axis, (key, title) in zip(axes.flat, TITLES.items(), strict=True):
        for name, rows in runs.items():
            if key == "each":
                values = [(b.seconds - a.seconds) / (b.examples - a.examples) for a, b in pairwise(rows)]
                axis.plot([row.examples for row in rows[1:]], values, label=name)
            else:
                axis.plot([row.examples for row in rows], [getattr(row, key) for row in rows], label=name)
        axis.set(title=title, xlabel="examples", ylim=(0, 1.1 * axis.get_ylim()[1]))
    axes.flat[0].legend()
    figure.savefig(path, dpi=80)


def read(path: Path) -> list[Sample]:
    """Rows that an earlier run wrote."""
    return [Sample(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def main() -> int:
    """Print the figures; exit code 1 where a bound is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=2000)
    parser.add_argument("--every", type=int, default=100)
    parser.add_argument("--rows", type=Path, help="a file for the rows, as JSON lines")
    parser.add_argument("--figure", type=Path, help="a file for the picture")
    parser.add_argument("--beside", type=Path, action="append", default=[], help="rows of another run, to draw too")
    parser.add_argument("--read", type=Path, help="rows of a run that is done, instead of a build")
    args = parser.parse_args()
    rows = read(args.read) if args.read else []
    if not rows:
        print(f"backend: {activate('auto', 1).summary}, one thread")
        dr.set_flag(dr.JitFlag.KernelHistory, True)
        with TemporaryDirectory() as scratch:
            (Path(scratch) / "spec").mkdir()
            spec = write_spec(Path(scratch) / "spec", args.examples)
            for sample in samples(spec, Path(scratch) / "out", args.every):
                rows.append(sample)
                print(json.dumps(asdict(sample)), flush=True)
                if args.rows:
                    args.rows.write_text("".join(json.dumps(asdict(row)) + "\n" for row in rows), encoding="utf-8")
    if args.figure:
        name = args.read.stem if args.read else "this build"
        draw({name: rows, **{path.stem: read(path) for path in args.beside}}, args.figure)
    return 0 if told(rows) else 1


if __name__ == "__main__":
    sys.exit(main())
