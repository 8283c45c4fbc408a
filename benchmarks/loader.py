"""Examples per second of the training loader against the bare decode of the same layers from memory.

`python benchmarks/loader.py [DIR]`, on the training split of a finished dataset. Bare decode is `shards.exr.decode` of
the six layers that training reads, in one process. The loader also reads, checks, cuts, exposes and copies; with 0
workers in this process, else in processes that do nothing else. Shares are medians over rounds in which all are
measured in turn. Aim: 0.9 of bare decode, 1 and 2 workers; one worker alone can only come near it.

On a machine that others use, processes share what is left of its cores, and rates say little. Processor time per
example, of whoever reads, says what a rate would be with a core for each reader.
"""

import argparse
import multiprocessing
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from statistics import median
from time import perf_counter

import _common as common
import psutil

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.lighting_dataset import LAYERS, LightingDataset
from dataset_builder.lightnet.data.loader import training_batches
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.shards import exr
from dataset_builder.shards.manifest import from_json
from dataset_builder.shards.shard_index import ShardIndex
from dataset_builder.shards.structure import read_member
from dataset_builder.shards.writer import shard_path
from dataset_builder.spread import spread_indices

DEFAULT = common.ROOT / "datasets" / "3df-lighting-mini"
WORKERS, ROUNDS, MOST, MULTIPLE = (0, 1, 2), 9, 512, 16
SECONDS, AIM = 1.5, 0.9
"""Least time that each is measured for in a round; share of bare decode that is aimed at."""


@dataclass(frozen=True, kw_only=True)
class Speed:
    """rate: examples per second; busy: seconds of processor time per example, of those who read."""

    rate: float
    busy: float


def files(dataset: LightingDataset) -> list[list[bytes]]:
    """The layers of examples from all over the split, as they are on the disk."""
    found, wanted = [], {dataset.keys[index] for index in spread_indices(len(dataset), MOST)}
    for path in sorted((dataset.folder / "index").iterdir()):
        index = from_json(ShardIndex, path.read_bytes(), where=path.name)
        for example in index.examples:
            if example.key in wanted:
                suffixes = {f"{layer}.exr" for layer in LAYERS}
                tar = shard_path(dataset.folder, index.shard.stem)
                found.append([read_member(tar, member) for member in example.members if member.suffix in suffixes])
    return found


def timed(work: Callable[[], int], readers: Sequence[psutil.Process]) -> Speed:
    """How fast examples come out of `work`, which returns how many did."""
    busy = processor(readers)
    count, begin = 0, perf_counter()
    while perf_counter() - begin < SECONDS:
        count += work()
    return Speed(rate=count / (perf_counter() - begin), busy=(processor(readers) - busy) / count)


def processor(readers: Sequence[psutil.Process]) -> float:
    """Seconds of processor time that processes have used."""
    return sum(sum(reader.cpu_times()[:2]) for reader in readers)


def decode(layers: list[bytes]) -> int:
    """Decode one example."""
    for data in layers:
        exr.decode(data)
    return 1


def measure(dataset: LightingDataset, encoded: Iterator[list[bytes]]) -> dict[int, list[tuple[Speed, Speed]]]:
    """Bare decode and loader of every round, by workers."""
    here = psutil.Process()
    rates: dict[int, list[tuple[Speed, Speed]]] = {workers: [] for workers in WORKERS}
    for _ in range(ROUNDS):
        for workers in WORKERS:
            alone = timed(lambda: decode(next(encoded)), [here])
            spec = TrainingSpec.model_validate({"steps": 10**9, "data": {**dataset.spec.model_dump(),
                                                                         "workers": workers}})
            batches = training_batches(dataset, spec, multiple=MULTIPLE)
            for _ in range(4 * workers + 2):
                next(batches)
            readers = [psutil.Process(child.pid) for child in multiprocessing.active_children()] or [here]
            rates[workers].append((alone, timed(lambda source=batches: len(next(source).keys), readers)))
            batches.close()
    return rates


def main() -> int:
    """Print the figures; exit code 2 where there is nothing to measure."""
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
    for workers, rounds in measure(dataset, cycle(encoded)).items():
        share = median(loader.rate / alone.rate for alone, loader in rounds)
        spent = median(alone.busy / loader.busy for alone, loader in rounds)
        alone, rate = median(alone.rate for alone, _ in rounds), median(loader.rate for _, loader in rounds)
        print(f"{workers} workers: {rate:.0f} examples/s, bare decode {alone:.0f}: share {share:.2f}"
              + (f" (aim {AIM})" if workers else "") + f"; bare decode takes {spent:.2f} of the processor time")
    return 0


if __name__ == "__main__":
    sys.exit(main())
