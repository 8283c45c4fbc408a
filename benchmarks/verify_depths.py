"""What each depth of `verify` costs, on a dataset: `python benchmarks/verify_depths.py DIR`.

Prints CPU seconds in this process, the least of a few rounds in which all take turns, the rate, and the share of the
deepest look; and the same of a run that finds everything known from an interrupted one.
"""

import argparse
import resource
import tempfile
from pathlib import Path

from dataset_builder.byte_store import ByteStore
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import NOT_LOOKED_AT, verify
from dataset_builder.shards.verify_shard import Depth, Known

ROUNDS = 3
RESUMED = "pixels, all known"


def main() -> None:
    """Print a line for each depth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="DIR")
    folder = parser.parse_args().folder
    size, found = load_manifest(folder).totals.bytes, dict[str, list[float]]()
    with tempfile.TemporaryDirectory() as state:
        known = Known(store=ByteStore(Path(state), 2**30), code="benchmark")
        verify(folder, known=known)
        for _ in range(ROUNDS):
            for depth in NOT_LOOKED_AT:
                found.setdefault(depth, []).append(_seconds(folder, depth, None))
            found.setdefault(RESUMED, []).append(_seconds(folder, "pixels", known))
    for name, seconds in found.items():
        rate, share = size / min(seconds) / 1e6, min(seconds) / min(found["pixels"])
        print(f"{name}: {min(seconds):.3f} s, {rate:.0f} MB/s, {share:.1%} of pixels")


def _seconds(folder: Path, depth: Depth, known: Known | None) -> float:
    start = resource.getrusage(resource.RUSAGE_SELF)
    verify(folder, depth=depth, known=known)
    end = resource.getrusage(resource.RUSAGE_SELF)
    return end.ru_utime + end.ru_stime - start.ru_utime - start.ru_stime


if __name__ == "__main__":
    main()
