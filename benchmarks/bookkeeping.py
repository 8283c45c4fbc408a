"""What a build costs beside rendering: seconds, memory and bytes kept, at ten thousand to a million examples.

The build is the real one; its engine hands back made-up outcomes at once, one example in twenty rejected, and shards
are only counted. Each size runs in a process of its own. Bounds: microseconds and bytes of memory per example at the
largest size are at most twice those at the smallest, plus what does not depend on the size.
"""

import argparse
import json
import resource
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from long_build import write_spec

from dataset_builder import builder
from dataset_builder.engine.unit import Outcome
from dataset_builder.planning.catalogue import ViewUnit
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.shard_index import ExampleFacts, ExampleRecord, MemberRecord, ShardIndex, ShardRecord
from dataset_builder.spec.load import load_dataset

MIB = 2**20
REJECTED = 20
"""One example in so many."""
LAYERS = ("i_s", "i_t", "d", "r", "s_prime", "mask", "mask_rough")
PASSES = ("plan", "first_hit", "source", "target", "first_hit_rough", "rough", "encode")
SIZES = (10_000, 100_000, 1_000_000)
GROWTH = 2.0


def engine(work: Callable[..., Any], units: Iterable[ViewUnit], **_: object) -> Iterator[list[Outcome]]:
    """Outcomes of what was never rendered."""
    for unit in units:
        yield [Outcome(ref=ref, digest=f"{ref.index:064x}", paths=1000, rejected=_rejected(ref),
                       seconds={name: ref.index * 1e-4 + k for k, name in enumerate(PASSES)})
               for ref in unit.examples]


def _rejected(ref: Any) -> Rejected | None:
    reason = "expected 0.85 to 1, got 0.8123 of the mask under that of the rough mesh"
    return None if ref.index % REJECTED else Rejected(key=ref.key, view=ref.view.name, gate="mask_overlap",
                                                      reason=reason)


def shard(folder: Path, *, slot: str, split: str, examples: list[tuple[str, str]], spec_digest: str,
          versions: dict[str, str], share: bool) -> ShardIndex:
    """The index of a shard that was never written."""
    def members(key: str) -> tuple[MemberRecord, ...]:
        names = [f"{key}.{name}.exr" for name in LAYERS] + [f"{key}.label.json", f"{key}.preview.png"]
        return tuple(MemberRecord(name=name, offset=512 * k, size=1000 + k, sha256=f"{k:064x}",
                                  pixel_digest=f"{k + 1:064x}") for k, name in enumerate(names))

    facts = ExampleFacts(object="cabinet", category="cabinet", scene="den", light=0, level=0, level_name="")
    records = tuple(ExampleRecord(key=key, view="train/000000", facts=facts, digest=digest, members=members(key))
                    for key, digest in examples)
    record = ShardRecord(name=f"{slot}-00000000.tar", split=split, bytes=10**6, sha256="0" * 64,
                         examples=len(records), first_key=records[0].key, last_key=records[-1].key)
    return ShardIndex(shard=record, spec_digest=spec_digest, versions=versions, examples=records)


def measure(examples: int) -> dict[str, float]:
    """Bookkeeping of one build, in this process."""
    nothing = SimpleNamespace(drop=lambda key: None, clear=lambda: None, size=lambda: 0)
    with TemporaryDirectory() as scratch:
        (Path(scratch) / "spec").mkdir()
        spec, out = load_dataset(write_spec(Path(scratch) / "spec", examples)), Path(scratch) / "out"
        begin, seen, shards = _seconds(), 0, 0
        base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        with patch.multiple(builder, publish_shard=shard, publish_dataset=lambda *_: None,
                            require_space=lambda *_: None, Staging=lambda _: nothing):
            for event in builder.build(spec, out, workers=1, run=engine):
                seen, shards = seen + len(event.outcomes), shards + (event.shard is not None)
        kept = {path.suffix: path.stat().st_size for path in (out / WORK).rglob("*") if path.is_file()}
        return {"examples": seen, "shards": shards, "seconds": _seconds() - begin, "kept_mib": sum(kept.values()) / MIB,
                "seconds_mib": kept.get(".csv", 0) / MIB,
                "mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - base}


def _seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def main() -> int:
    """Print the figures; exit code 1 where a bound is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--examples", type=int, action="append", help="a size; repeat for more")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(measure(args.one)))
        return 0
    rows = []
    for size in args.examples or SIZES:
        command = [sys.executable, __file__, "--one", str(size)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        rows.append(row := json.loads(done.stdout))
        print(f"{row['examples']:>9,.0f} examples in {row['shards']:,.0f} shards: {row['seconds']:8.1f} s of CPU, "
              f"{row['seconds'] / row['examples'] * 1e6:7.1f} us each; {row['mib']:8.1f} MiB of memory, "
              f"{row['mib'] / row['examples'] * MIB:7.0f} bytes each; {row['kept_mib']:7.1f} MiB of notes", flush=True)
    first, last = rows[0], rows[-1]
    grown = last["seconds"] / last["examples"] / (first["seconds"] / first["examples"])
    print(f"seconds per example at the largest size over those at the smallest: {grown:.2f} (bound {GROWTH:g})")
    return 0 if grown <= GROWTH else 1


if __name__ == "__main__":
    sys.exit(main())
