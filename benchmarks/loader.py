"""Examples per second of the training loader against the bare decode of the same layers from memory.

`python benchmarks/loader.py [DIR]`, on the training split of a finished dataset. Bare decode is `shards.exr.decode` of
the six layers that training reads, in one process. The loader also reads, checks, cuts, exposes and copies; with 0
workers in this process, else in processes that do nothing else. Shares are medians over rounds in which all are
measured in turn, so that a machine that others use slows all of them. Bound: 0.9 of bare decode, 1 and 2 workers.
"""

import argparse
import statistics
import sys
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path
from time import perf_counter

import _common as common

from dataset_builder.errors import UserError
from dataset_builder.lightnet.batch import Batch
from dataset_builder.lightnet.dataset import LAYERS, LightingDataset
from dataset_builder.lightnet.loader import spread_indices, training_batches
from dataset_builder.shards import exr
from dataset_builder.shards.manifest import ShardIndex, from_json
from dataset_builder.shards.structure import read_member
from dataset_builder.shards.writer import shard_path
from dataset_builder.spec.training import TrainingSpec

DEFAULT = common.ROOT / "datasets" / "3df-lighting-mini"
WORKERS, ROUNDS, MOST, MULTIPLE = (0, 1, 2), 9, 512, 16
SECONDS, BOUND = 1.5, 0.9
"""Least time that each is measured for in a round; least share of bare decode."""


def files(dataset: LightingDataset) -> list[list[bytes]]:
    """The layers of examples from all over the split, as they are on the disk."""
    found, wanted = [], {dataset.keys[index] for index in spread_indices(len(dataset), MOST)}
    for path in sorted((dataset.folder / "index").iterdir()):
        index = from_json(ShardIndex, path.read_bytes(), where=path.name)
        for example in index.examples:
            if example.key in wanted:
                names = {f"{example.key}.{layer}.exr" for layer in LAYERS}
                tar = shard_path(dataset.folder, index.shard.stem)
                found.append([read_member(tar, member) for member in example.members if member.name in names])
    return found


def bare(encoded: Iterator[list[bytes]]) -> float:
    """Examples per second of decoding alone."""
    count, begin = 0, perf_counter()
    while perf_counter() - begin < SECONDS:
        for data in next(encoded):
            exr.decode(data)
        count += 1
    return count / (perf_counter() - begin)


def loaded(batches: Iterator[Batch]) -> float:
    """Examples per second that come out of a loader that has long been running."""
    count, begin = 0, perf_counter()
    while perf_counter() - begin < SECONDS:
        count += len(next(batches).keys)
    return count / (perf_counter() - begin)


def measure(dataset: LightingDataset, encoded: Iterator[list[bytes]]) -> dict[int, list[tuple[float, float]]]:
    """(bare, loader) examples per second of every round, by workers."""
    rates: dict[int, list[tuple[float, float]]] = {workers: [] for workers in WORKERS}
    for _ in range(ROUNDS):
        for workers in WORKERS:
            before = bare(encoded)
            spec = TrainingSpec.model_validate({"steps": 10**9, "data": {**dataset.spec.model_dump(),
                                                                         "workers": workers}})
            batches = training_batches(dataset, spec, multiple=MULTIPLE)
            for _ in range(4 * workers + 2):
                next(batches)
            rates[workers].append((before, loaded(batches)))
            batches.close()
    return rates


def main() -> int:
    """Print the figures; exit code 1 where the bound is broken, 2 where there is nothing to measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DEFAULT, metavar="DIR")
    folder = parser.parse_args().folder
    try:
        dataset = LightingDataset(folder, "train", TrainingSpec().data)
    except UserError as error:
        print(f"error: {error}\nBuild the default one with `make dataset`.", file=sys.stderr)
        return 2
    encoded = files(dataset)
    size = "x".join(map(str, reversed(dataset.size)))
    each = sum(len(data) for few in encoded for data in few) / len(encoded)
    print(f"{dataset.name}: {len(dataset)} examples of {size} pixels, {each / 1e3:.0f} kB in {len(LAYERS)} layers, "
          f"batches of {dataset.spec.batch}")
    broken = False
    for workers, rounds in measure(dataset, cycle(encoded)).items():
        share = statistics.median(rate / alone for alone, rate in rounds)
        alone, rate = (statistics.median(column) for column in zip(*rounds, strict=True))
        broken |= workers > 0 and share < BOUND
        print(f"{workers} workers: {rate:.0f} examples/s, bare decode {alone:.0f}: share {share:.2f}"
              + (f" (bound {BOUND})" if workers else ""))
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
