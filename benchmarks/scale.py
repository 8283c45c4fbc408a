"""What a build takes on many workers, SIMULATED from what is measured here: the writer, the engine, and how unit costs
spread; `plan` says what an example of the paper's scale costs.

Answers: hours, use of the workers, work lost, where the one writer saturates, and how large tasks should be. Losses,
slow machines and speeds are assumptions: options. Validates the simulation on a real build by two workers first.
"""

import argparse
import csv
import resource
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import _common as common
import numpy as np
from _cluster import HOUR, Cluster, Load, Run, simulate

from dataset_builder.builder import build
from dataset_builder.engine import local
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.plan import Planner
from dataset_builder.shards.example import Member
from dataset_builder.shards.segment import segment
from dataset_builder.shards.shard_index import ExampleFacts
from dataset_builder.shards.staging import Staging
from dataset_builder.shards.writer import entry, publish_shard
from dataset_builder.spec.load import load_dataset

PAPER = common.ROOT / "scene_specs" / "3df-lighting.yaml"
SMALL = ("image={width: 48, height: 48}", "render.spp=8", "rough.edge_length=0.2", "gates.mask_overlap=0.1",
         "splits.train.pairs=8", "splits.evaluation.pairs=4")
FACTS = ExampleFacts(object="o", category="c", scene="s", light=0, level=0, level_name="")
MEMBERS, SEED = 10, 0
SHORT = 1.5
"""Seconds of an example of the mini dataset, about."""


@dataclass(frozen=True, kw_only=True)
class Writer:
    """Seconds of the one writer, by straight lines through two sizes."""

    stage: float
    stage_byte: float
    publish: float
    publish_byte: float


def cpu(whose: int = resource.RUSAGE_SELF) -> float:
    """Seconds that this process has computed, or those that it started and that ended."""
    used = resource.getrusage(whose)
    return used.ru_utime + used.ru_stime


def written(size: int, count: int) -> tuple[float, float]:
    """Seconds of computing, waits for the disk left out, to stage an example of so many bytes, and to publish a shard
    of `count`."""
    data = np.random.default_rng(SEED).bytes(size // MEMBERS)
    with tempfile.TemporaryDirectory() as name:
        folder, keys = Path(name), [f"{key:08d}" for key in range(count)]
        begin = cpu()
        for key in keys:
            members = [Member(name=f"{key}.{layer}.exr", data=data, pixel_digest="") for layer in range(MEMBERS)]
            Staging(folder).put(key, "0" * 64, segment(members), entry(key=key, view=key, facts=FACTS, members=members))
        staged = cpu()
        publish_shard(folder, slot="s-train-00000", split="train", examples=[(key, "0" * 64) for key in keys],
                      spec_digest="", versions={})
        for key in keys:
            Staging(folder).drop(key)
        return (staged - begin) / count, cpu() - staged


def measure_writer(large: int, per_shard: int) -> Writer:
    """The best of three, of examples of `large` bytes and of a hundredth; the slower where lines would fall."""
    small = large // 100
    times = [np.min([written(size, per_shard) for _ in range(3)], axis=0) for size in (small, large)]
    stage, publish = ((times[1][k] - times[0][k]) / (large - small) for k in (0, 1))
    return Writer(stage=max(times[0][0] - stage * small, 0), stage_byte=stage,
                  publish=max(times[0][1] - publish * small, 0), publish_byte=publish / per_shard)


def nothing(unit: int) -> int:
    """The smallest unit there is."""
    return unit


def engine_overhead(count: int = 2000) -> float:
    """Seconds that this process computes for each unit that it has a pool of two do nothing about."""
    list(local.run(nothing, range(2), workers=2))
    begin = cpu()
    list(local.run(nothing, range(count), workers=2))
    return (cpu() - begin) / count


def validate(folder: Path) -> np.ndarray:
    """Build a small dataset by two workers; the seconds of its examples in order. Prints how far off `plan` is, and the
    simulation of the same units."""
    loaded, came, begin = load_dataset(common.MINI, SMALL), list[float](), perf_counter()
    computed, cost = cpu(resource.RUSAGE_CHILDREN), estimate(Planner(loaded))
    for event in build(loaded, folder, workers=2):
        came += [perf_counter() - begin] * len(event.outcomes)
        size = event.manifest.totals.bytes if event.manifest else 0
    computed = cpu(resource.RUSAGE_CHILDREN) - computed
    print(f"plan: {cost.total.seconds:.1f} core-seconds, {cost.total.bytes / 1e6:.2f} MB for {cost.examples} examples; "
          f"the workers computed {computed:.1f}, their start included, and made {size / 1e6:.2f} MB")
    seconds = unit_seconds(folder / "seconds.csv")
    # One number of the real run goes in: when its workers began
    first = came[0] - seconds[0]
    run = simulate(Load(seconds=seconds), Cluster(workers=2, begin=first), seed=SEED)
    print(f"real build of {len(seconds)} examples by 2 workers: {came[-1]:.1f} s to the last example; SIMULATED from "
          f"their {seconds.sum():.1f} s and {first:.1f} s to begin: {run.end:.1f} s, {run.end / came[-1] - 1:+.0%}")
    return seconds


def unit_seconds(path: Path) -> np.ndarray:
    """Seconds of every example in a `seconds.csv`, by key."""
    total = defaultdict[str, float](float)
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            total[row["key"]] += float(row["seconds"]) if row["key"].isdecimal() else 0.0
    return np.array([total[key] for key in sorted(total) if total[key]])


def line(name: str, load: Load, cluster: Cluster) -> Run:
    """Simulate and print."""
    run = simulate(load, cluster, seed=SEED)
    print(f"  {name:<24} {run.end / HOUR:9.2f} h  used {run.utilisation:6.1%}  lost {run.lost / run.useful:6.1%}  "
          f"writer busy {run.writer_share:6.1%}, queue {run.longest_queue:5d}")
    return run


def saturation(cluster: Cluster, load: Load) -> float:
    """Examples per second that the one writer can take."""
    return 1 / (cluster.per_task / load.per_task + cluster.per_example + cluster.per_shard / load.per_shard +
                load.bytes * (cluster.per_byte + cluster.per_published))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, validate, simulate; print all of it."""
    options = parsed(arguments)
    with tempfile.TemporaryDirectory() as name:
        seconds = unit_seconds(options.seconds) if options.seconds else validate(Path(name) / "small")
    loaded = load_dataset(options.spec, options.overrides)
    cost = estimate(Planner(loaded))
    mean = (cost.total.seconds - cost.field_cost.seconds) / cost.examples
    size, per_shard = cost.total.bytes / cost.examples, loaded.dataset.storage.examples_per_shard
    writer, overhead = measure_writer(int(size), per_shard), options.per_task or engine_overhead()
    print(f"computing alone: writer {writer.stage * 1e3:.1f} ms and {1e-6 / writer.stage_byte:.0f} MB/s to stage, "
          f"{writer.publish * 1e3:.0f} ms and {1e-6 / writer.publish_byte:.0f} MB/s to publish a shard of {per_shard}; "
          f"engine {overhead * 1e3:.2f} ms a task; unit costs spread by {seconds.std() / seconds.mean():.0%}")
    print(f"planned: {cost.examples:,} examples of {mean:.1f} s and {size / 1e6:.1f} MB; fields besides, "
          f"{cost.field_cost.seconds / HOUR:.1f} core-hours")
    print(f"assumed: {options.losses} losses per worker and hour, {options.absence:.0f} s until it is replaced, "
          f"{options.begin:.0f} s to begin, {options.slow_share:.0%} of workers at {options.slow_speed:g} of the "
          f"speed, {options.memory_share:.2%} of examples out of memory once")
    drawn = np.random.default_rng(SEED).choice(seconds / seconds.mean() * mean, cost.examples)
    load = Load(seconds=drawn, bytes=size, per_shard=per_shard)
    cluster = Cluster(workers=1000, begin=options.begin, losses=options.losses, absence=options.absence,
                      slow_share=options.slow_share, slow_speed=options.slow_speed, memory_share=options.memory_share,
                      per_task=overhead, per_example=writer.stage, per_byte=writer.stage_byte,
                      per_shard=writer.publish, per_published=writer.publish_byte)
    shared = replace(cluster, per_example=0.0, per_byte=0.0)
    for speed in options.speeds:
        fast = replace(load, seconds=drawn / speed)
        print(f"SIMULATED, workers of speed {speed:g}; all bytes by way of the writer:")
        for workers in options.workers:
            line(f"{workers} workers", fast, replace(cluster, workers=workers))
        print("SIMULATED, the same where workers stage on a disk that all share:")
        for workers in options.workers:
            line(f"{workers} workers", fast, replace(shared, workers=workers))
        for name, one in (("takes in all bytes", cluster), ("publishes alone", shared)):
            rate = saturation(one, load)
            print(f"  a writer that {name} takes {rate:.1f} examples/s, {rate * size / 1e6:.0f} MB/s: as many as "
                  f"{rate * mean / speed:,.0f} workers of speed {speed:g} make")
    short = Load(seconds=np.resize(drawn, 400_000) * (SHORT / mean), per_shard=per_shard)
    for per_task in (overhead, options.slow_driver):
        print(f"SIMULATED, 1000 workers, tasks of several examples of {SHORT} s, no bytes, a driver that takes "
              f"{per_task * 1e3:.2f} ms for each, so that it keeps up with tasks of {1000 * per_task:.2g} s:")
        for count in (1, 2, 4, 16, 64):
            alone = replace(shared, per_task=per_task, per_shard=0.0, per_published=0.0)
            line(f"{count} examples a task", replace(short, per_task=count), alone)
    return 0


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Options."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spec", type=Path, nargs="?", default=PAPER)
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="A.B=C")
    parser.add_argument("--seconds", type=Path, help="seconds.csv of a dataset, in place of a small build")
    parser.add_argument("--workers", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--speeds", type=float, nargs="+", default=[1.0, 20.0], help="of workers; 1 is a core here")
    parser.add_argument("--losses", type=float, default=0.05, help="of a worker, per hour")
    parser.add_argument("--absence", type=float, default=120.0, help="seconds until a lost worker is replaced")
    parser.add_argument("--begin", type=float, default=20.0, help="seconds until a worker is ready")
    parser.add_argument("--slow-share", type=float, default=0.05)
    parser.add_argument("--slow-speed", type=float, default=0.5)
    parser.add_argument("--memory-share", type=float, default=0.001)
    parser.add_argument("--per-task", type=float, help="seconds of the driver for a task (default: the local engine's)")
    parser.add_argument("--slow-driver", type=float, default=3e-3, help="the same of another driver, to compare")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
