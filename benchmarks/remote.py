"""What reading a dataset takes from its folder, from a server into an empty cache, and from a full cache.

`python benchmarks/remote.py [DIR]`, on the layers of a finished dataset that training reads. The server is nginx on
this machine where it is installed, so that no network is measured, but what the reader itself does; else one in this
process, whose work is then counted, too. Ways are measured in turn, round by round, one example after another; figures
are medians over rounds. Processor time is that of this process; rates depend on who else uses the machine.
"""

import argparse
import resource
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from statistics import median
from time import perf_counter

import _common as common

from dataset_builder.errors import UserError
from dataset_builder.lightnet.data.lighting_dataset import LAYERS
from dataset_builder.shards.reader import Dataset, open_dataset

DEFAULT = common.ROOT / "datasets" / "3df-lighting-mini"
ROUNDS, MOST = 7, 48


def processor() -> float:
    """Seconds of processor time of this process."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def epoch(dataset: Dataset) -> tuple[float, float]:
    """Seconds, and seconds of processor time, for each of the first examples."""
    keys = [key for split in dataset.splits.values() for key in split][:MOST]
    begin, busy = perf_counter(), processor()
    for key in keys:
        dict(dataset.images(key))
    return (perf_counter() - begin) / len(keys), (processor() - busy) / len(keys)


def served(folder: Path, tmp: Path) -> AbstractContextManager[str]:
    """A server of the folder, said in a line."""
    sys.path.insert(0, str(common.ROOT))
    from tests.file_servers import NGINX, nginx_server, range_server

    print("server: nginx" if NGINX else "server: Python, in this process")
    return nginx_server(folder.resolve(), tmp) if NGINX else range_server(folder)


def main() -> int:
    """Print the figures; exit code 2 where there is nothing to measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DEFAULT, metavar="DIR")
    folder = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as tmp:
        caches = [Path(tmp) / "0"]

        def cold(address: str) -> Dataset:
            # What was written is not removed meanwhile: file systems go on with that for a while
            caches.append(Path(tmp) / str(len(caches)))
            return open_dataset(address, layers=LAYERS, cache=caches[-1])

        try:
            open_dataset(folder, layers=LAYERS)
        except UserError as error:
            print(f"error: {error}\nBuild the default one with `make dataset`.", file=sys.stderr)
            return 2
        with served(folder, Path(tmp)) as address:
            ways: dict[str, Callable[[], Dataset]] = {
                "folder, hashed": lambda: open_dataset(folder, layers=LAYERS),
                "http, empty cache": lambda: cold(address),
                "http, full cache": lambda: open_dataset(address, layers=LAYERS, cache=caches[-1]),
                "http, no cache": lambda: open_dataset(address, layers=LAYERS, cache_size=0)}
            rounds = [{name: epoch(way()) for name, way in ways.items()} for _ in range(ROUNDS)]
    for name in ways:
        times = median(one[name][0] for one in rounds), median(one[name][1] for one in rounds)
        share = median(one[name][1] / one["folder, hashed"][1] for one in rounds)
        print(f"{name}: {1 / times[0]:.0f} examples/s, {times[1] * 1e3:.2f} ms of processor time each, "
              f"{share:.2f} of the folder's")
    return 0


if __name__ == "__main__":
    sys.exit(main())
