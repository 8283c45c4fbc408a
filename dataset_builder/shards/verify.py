"""Whether a dataset agrees, file by file, with its manifest, at one of four depths. Every problem is listed."""

import multiprocessing
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from pathlib import Path
from typing import get_args

from dataset_builder.errors import OutputError, Problem, ShardError, UserError
from dataset_builder.processes import follow_the_parent
from dataset_builder.shards.folder import CARD, CROISSANT, MANIFEST, SUMS
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.one_writer import placed
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.shard_index import ShardRecord
from dataset_builder.shards.verify_files import (
    croissant_problems,
    file_problems,
    hash_of,
    manifest_problems,
    sum_problems,
)
from dataset_builder.shards.verify_shard import AcrossShards, Depth, Known, Look, ShardFacts

NOT_LOOKED_AT: Mapping[Depth, str] = {
    "size": f"the bytes of all files but {MANIFEST} (a flipped bit, another file of the same size)",
    "shard": "whether indexes fit their shards, and what is in these (a file that was wrong before it was summed)",
    "member": "pixels and labels (values out of range, layers that contradict each other, files that do not decode)",
    "pixels": "",
}
"""What each depth leaves out; in the order of depth, each looks at all that the one before does."""
AHEAD = 2
"""Shards handed out per process before facts come back."""

Told = Callable[[int, int], None]
"""Is called with bytes of shards that were looked at, and of all that will be."""


def verify(folder: Path, *, depth: Depth = "pixels", splits: Sequence[str] = (), workers: int = 1,
           known: Known | None = None, told: Told = lambda done, of: None) -> list[Problem]:
    """Everything wrong with the dataset in `folder`; empty where nothing is. The same in the same order for any number
    of `workers`, the processes that look.

    Checked at depth `size`: the manifest's schema, sums and SHA-256; missing and extra files, and sizes of shards.
    `shard`: the SHA-256 of every file, and the catalogue. `member`: indexes, keys, views, and every byte of a shard
    against its index. `pixels`: of every example names, decoding, ranges, pixel digests, label, and the identities of
    `identities.py`. splits: those whose shards are looked at, all where empty. known: facts of an interrupted run,
    taken for shards whose bytes are still the same. Raises UserError where there is no such depth or split, and
    OutputError where a process dies.
    """
    if depth not in get_args(Depth):
        raise UserError(f"depth: expected one of {', '.join(get_args(Depth))}, got {depth!r}")
    try:
        manifest = load_manifest(folder)
    except ShardError as error:
        return list(error.problems)
    shards = list(_different(_chosen(manifest, splits)))
    hashes: dict[str, str | None] = {}
    agreement, problems, done = AcrossShards(manifest), list[Problem](), 0
    numbers = {shard.name: number for number, shard in reversed(list(enumerate(manifest.shards)))}
    look, of = Look(folder=folder, manifest=manifest, depth=depth, known=known), sum(shard.bytes for shard, _ in shards)
    told(0, of)
    for (shard, times), facts in zip(shards, _facts(look, [shard for shard, _ in shards], workers), strict=True):
        hashes |= {name: sha256 for name, sha256 in zip(shard.files, (facts.tar, facts.index), strict=True) if sha256}
        problems += [*facts.problems, *agreement.add(numbers[shard.name], facts, times)]
        told(done := done + shard.bytes, of)
    looked_at = {MANIFEST, CARD, CROISSANT, SUMS, *(name for shard, _ in shards for name in shard.files)}
    small = (MANIFEST,) if depth == "size" else (MANIFEST, CARD, CROISSANT)
    hashes |= {name: hash_of(placed(folder, name)) for name in small}
    return [*manifest_problems(manifest), *file_problems(folder, manifest, looked_at),
            *sum_problems(folder, manifest, hashes),
            *(croissant_problems(folder, manifest) if depth != "size" else ()), *problems, *agreement.summary()]


def _chosen(manifest: Manifest, splits: Sequence[str]) -> Sequence[ShardRecord]:
    names = [split.name for split in manifest.splits]
    if unknown := sorted(set(splits) - set(names)):
        raise UserError(f"split: expected some of {', '.join(names)}, got {', '.join(unknown)}")
    return [shard for shard in manifest.shards if not splits or shard.split in splits]


def _different(shards: Sequence[ShardRecord]) -> Iterator[tuple[ShardRecord, int]]:
    """The first shard of every name, and how often that name is listed: no file is looked into twice."""
    times = Counter(shard.name for shard in shards)
    first = {shard.name: shard for shard in reversed(shards)}
    return ((first[name], count) for name, count in times.items())


_look: Look | None = None
"""How a process looks at shards."""


def _begin(look: Look) -> None:
    """The start of a process."""
    global _look
    _look = look
    follow_the_parent()


def _in_process(shard: ShardRecord) -> ShardFacts:
    assert _look is not None
    return _look.facts(shard)


def _facts(look: Look, shards: Sequence[ShardRecord], workers: int) -> Iterator[ShardFacts]:
    """Facts of shards in their order, found by so many processes; one is this process."""
    if min(workers, len(shards)) <= 1:
        yield from map(look.facts, shards)
        return
    context, left = multiprocessing.get_context("spawn"), iter(shards)
    with ProcessPoolExecutor(min(workers, len(shards)), context, initializer=_begin, initargs=(look,)) as pool:
        try:
            waiting: deque[Future[ShardFacts]] = deque(pool.submit(_in_process, shard)
                                                       for shard in islice(left, workers * AHEAD))
            while waiting:
                facts = waiting.popleft().result()
                waiting += [pool.submit(_in_process, shard) for shard in islice(left, 1)]
                yield facts
        except BrokenProcessPool as error:
            raise OutputError("a process died, possibly out of memory: run it again with fewer --workers") from error
        finally:
            pool.shutdown(cancel_futures=True)
