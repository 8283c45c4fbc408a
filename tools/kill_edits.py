"""Kill edits of a finished dataset and look at what is left: `python tools/kill_edits.py [--count N] [--spec FILE]`.

Every edit changes the spec and builds over what is there; it is killed (`kill -9`) at a random time, or, every second
one, within milliseconds of the moment at which the new files begin to take the places of the old ones. After each the
old or the new dataset must open and verify. In the end the last edit is finished and compared with a fresh build.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from dataset_builder.seeding import rng
from dataset_builder.shards.folder import SUMS, WORK, next_of
from dataset_builder.shards.one_writer import left_over
from dataset_builder.shards.reader import load_manifest, open_dataset
from dataset_builder.shards.verify import verify
from dataset_builder.spec.load import load_dataset

SMALL = ("image={width: 24, height: 20}", "render.spp=4", "rough.sigma=0.002", "gates.mask_overlap=0",
         "storage.examples_per_shard=1", *(f"splits.{split}.{key}=1" for split in ("train", "evaluation")
                                           for key in ("objects.count", "scenes.count", "pairs")))
"""Overrides that make four examples of the mini dataset."""
EDITS = ((), ("title=Renamed",), ("seed=1",), ("storage.dtype=float16",), ("storage.examples_per_shard=2",))
AFTER = 0.03
"""Seconds after the new files are all there, within which every second edit is killed."""


def kill_edits(spec: Path, small: Sequence[str], folder: Path, *, count: int, seed: int = 0) -> Counter[str]:
    """Kill `count` edits of the dataset of `spec` in `folder`. Counts `old` and `new`, by the dataset that is left;
    `cut` of them left files of the other one to be put away, and `wrong` are neither or do not verify. Old is also the
    edit before, where that was killed so late that the next build finished it."""
    found, random = Counter[str](), rng(seed, "kills")
    length = _finish(spec, small, folder)
    digests = [load_dataset(spec, small).spec_digest]
    for number in range(count):
        edit = (*small, *EDITS[(number + 1) % len(EDITS)])
        digests.append(load_dataset(spec, edit).spec_digest)
        with subprocess.Popen(_command(spec, edit, folder), stdout=subprocess.DEVNULL) as build:
            if number % 2:
                while build.poll() is None and not (next_of(folder) / SUMS).exists():
                    time.sleep(0.0005)
                time.sleep(random.uniform(0, AFTER))
            else:
                time.sleep(random.uniform(0, length))
            build.kill()
        found[_left(folder, digests)] += 1
        found["cut"] += bool(left_over(folder))
    return found


def _left(folder: Path, digests: Sequence[str]) -> str:
    """Which of the datasets of these specs is in `folder`, whole: that of the last, or of one before."""
    if verify(folder) or not list(open_dataset(folder)):
        return "wrong"
    found = load_manifest(folder).spec_digest
    return "new" if found == digests[-1] else "old" if found in digests else "wrong"


def _command(spec: Path, overrides: Sequence[str], folder: Path) -> list[str]:
    command = [sys.executable, "-m", "dataset_builder", "build", str(spec), "--out", str(folder), "--workers", "1"]
    return [*command, "--backend", "llvm", *(part for override in overrides for part in ("--set", override))]


def _finish(spec: Path, overrides: Sequence[str], folder: Path) -> float:
    """Build to the end; the seconds that it took."""
    start = time.perf_counter()
    subprocess.run(_command(spec, overrides, folder), stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


def files(folder: Path) -> dict[str, bytes]:
    """The dataset's files by relative name."""
    names = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    return {name.as_posix(): path.read_bytes() for name, path in names.items()
            if name.parts[0] not in (WORK, "previews", "seconds.csv")}


def main(arguments: Sequence[str] | None = None) -> int:
    """Kill as the command line says; exit code 1 where something else than one of both datasets was left."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="edits to kill")
    parser.add_argument("--spec", type=Path, default=Path("scene_specs/3df-lighting-mini.yaml"))
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as place:
        edited, fresh = Path(place) / "edited", Path(place) / "fresh"
        found = kill_edits(options.spec, SMALL, edited, count=options.count)
        for folder in (edited, fresh):
            _finish(options.spec, SMALL, folder)
        equal = files(edited) == files(fresh)
    print(f"{options.count} edits killed: {found['old']} left the old dataset, {found['new']} the new one, "
          f"{found['wrong']} neither; {found['cut']} while files changed places; "
          f"the last one finished {'equals' if equal else 'differs from'} a fresh build")
    return 0 if equal and not found["wrong"] else 1


if __name__ == "__main__":
    sys.exit(main())
