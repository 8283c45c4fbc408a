"""Does a long build stay flat: thousands of tiny examples in one process, measured every hundred.

Prints, for each hundred examples, CPU seconds, memory, open files, threads, Python objects, kernels that were new, and
bytes that the build keeps beside the shards, and draws them. What must not grow is compared between the first and the
last half: seconds per example, and slopes per thousand examples. Exit code 1 where a bound is broken.
"""

import argparse
import gc
import json
import resource
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
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


def main() -> int:
    """Print the figures; exit code 1 where a bound is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, default=2000)
    parser.add_argument("--every", type=int, default=100)
    parser.add_argument("--rows", type=Path, help="a file for the rows, as JSON lines")
    args = parser.parse_args()
    print(f"backend: {activate('auto', 1).summary}, one thread")
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    rows: list[Sample] = []
    with TemporaryDirectory() as scratch:
        (Path(scratch) / "spec").mkdir()
        for sample in samples(write_spec(Path(scratch) / "spec", args.examples), Path(scratch) / "out", args.every):
            rows.append(sample)
            print(json.dumps(asdict(sample)), flush=True)
            if args.rows:
                args.rows.write_text("".join(json.dumps(asdict(row)) + "\n" for row in rows), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
