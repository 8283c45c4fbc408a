"""What readers of shards cost, against the bare decode of the same layers from memory.

`python benchmarks/readers.py [DIR] [--http]`, on the training split of a finished dataset. A pass reads every example
once and hands over its layers as arrays, in this process or from 1 and 2 workers of PyTorch's DataLoader. Readers take
turns; figures are medians over rounds: processor time per example of all processes together, starting them included, as
a multiple of what OpenEXR alone takes in the same round; and examples per second, which say little where others use the
machine.

`benchmarks/loader.py` measures the training loader's own processes, whose start would say all here.
Ours hash every file and look at every header and pixel; the others take what comes. Parquet is read twice: EXR files
in its columns as `export` writes them, and the same pixels as numbers, compressed by zstd. MosaicML's library is not
installed with this project; where it is, its reader takes part.
"""

import argparse
import importlib.util
import io
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from statistics import median
from tempfile import TemporaryDirectory, mkdtemp
from time import perf_counter
from typing import Any

import _common as common
import numpy as np
import OpenEXR
from _file_server import served
from torch.utils.data import DataLoader, Dataset, IterableDataset, get_worker_info

from dataset_builder.errors import UserError
from dataset_builder.exporting.export_dataset import DatasetExport, export_dataset
from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import training_batches
from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.shards import exr
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.reader import load_manifest, open_dataset

DEFAULT = common.ROOT / "datasets" / "3df-lighting-mini"
TWO, SPLIT = ("i_s", "i_t"), "train"
ROUNDS, WORKERS = 3, (0, 1, 2)
Layers = tuple[str, ...]
Arrays = dict[str, np.ndarray]
Work = Callable[[], int]


def pixels(data: bytes) -> np.ndarray:
    """What the pages and the card of a dataset show: OpenEXR, and nothing else."""
    return next(iter(OpenEXR.File(io.BytesIO(data)).channels().values())).pixels


@dataclass(frozen=True)
class Items(Dataset):
    """`read` of every item, where items can be had in any order."""

    items: Sequence[Any]
    read: Callable[[Any], Any]

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: int) -> Any:
        return self.read(self.items[index])


@dataclass(frozen=True)
class Rows(IterableDataset):
    """Rows of files, which workers share; where `split` is false they share them by themselves."""

    files: Sequence[str]
    rows: Callable[[Sequence[str]], Iterable[Any]]
    split: bool = True

    def __iter__(self) -> Iterator[Any]:
        worker = get_worker_info()
        return iter(self.rows(self.files[worker.id::worker.num_workers] if worker and self.split else self.files))


@dataclass(frozen=True, kw_only=True)
class Source:
    """The dataset, its exports, and where its shards are: paths, or addresses."""

    manifest: Manifest
    folder: Path
    place: str
    made: Path

    @property
    def shards(self) -> list[str]:
        """Those of the split."""
        return [f"{self.place}/shards/{one.name}" for one in self.manifest.shards if one.split == SPLIT]


def ours(source: Source, layers: Layers) -> Dataset:
    """`open_dataset`, as a DataLoader takes it; from an address without what an earlier pass has kept."""
    local = source.place == str(source.folder)
    options = {} if local else {"cache": mkdtemp(prefix="cache-", dir=source.made)}
    dataset = open_dataset(source.place, layers=layers, label=False, **options)
    return Items(dataset.splits[SPLIT], dataset.__getitem__)


def webdataset(source: Source, layers: Layers) -> IterableDataset:
    """Members of other layers are passed over."""
    import webdataset as wds

    wanted = tuple(f".{layer}.exr" for layer in layers)
    rows = wds.WebDataset(source.shards, shardshuffle=False, empty_check=False,
                          select_files=lambda name: name.endswith(wanted))
    return rows.decode(lambda key, data: pixels(data) if key.endswith(".exr") else None).map(
        lambda row: {layer: row[f"{layer}.exr"] for layer in layers})


def hugging_face(source: Source, layers: Layers) -> IterableDataset:
    """Streaming; other columns are read, but not decoded."""
    from datasets import load_dataset

    rows = load_dataset("webdataset", data_files={SPLIT: source.shards}, split=SPLIT, streaming=True)
    rows = rows.select_columns([f"{layer}.exr" for layer in layers])
    return Rows([], lambda _: ({name: pixels(data) for name, data in row.items()} for row in rows), split=False)


def mds(source: Source, layers: Layers) -> Dataset:
    """MosaicML's own reader of files on this machine."""
    from streaming import LocalDataset

    rows = LocalDataset(str(source.made / "mds"), SPLIT)

    def read(index: int) -> Arrays:
        row = rows[index]
        return {layer: pixels(row[layer]) for layer in layers}

    return Items(range(len(rows)), read)


def parquet(source: Source, layers: Layers) -> IterableDataset:
    """Columns of EXR files."""
    return Rows(files_in(source.made / "parquet" / "data"), lambda files: (
        {layer: pixels(data) for layer, data in row.items()} for row in parquet_rows(files, layers)))


def numbers(source: Source, layers: Layers) -> IterableDataset:
    """Columns of numbers, as lists of one length."""
    height, width = source.manifest.height, source.manifest.width

    def rows(files: Sequence[str]) -> Iterator[Arrays]:
        import pyarrow.parquet as pq

        for path in files:
            for batch in pq.ParquetFile(path).iter_batches(8, columns=list(layers)):
                columns = {name: batch[name].flatten().to_numpy().reshape(len(batch), height, width, -1)
                           for name in layers}
                yield from ({name: column[row].copy() for name, column in columns.items()} for row in range(len(batch)))

    return Rows(files_in(source.made / "numbers"), rows)


def parquet_rows(files: Sequence[str], layers: Layers) -> Iterator[dict[str, bytes]]:
    """Rows of some columns."""
    import pyarrow.parquet as pq

    return (row for path in files for batch in pq.ParquetFile(path).iter_batches(8, columns=list(layers))
            for row in batch.to_pylist())


def files_in(folder: Path) -> list[str]:
    """Files of the split, in order."""
    return [str(path) for path in sorted(folder.glob(f"{SPLIT}-*"))]


def write_numbers(source: Source) -> None:
    """The pixels of every layer as lists of numbers, a file for each of `export`'s."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    (source.made / "numbers").mkdir()
    layers = tuple(layer.name for layer in source.manifest.layers)
    for path in files_in(source.made / "parquet" / "data"):
        rows = [{layer: exr.read(data).planes.transpose(1, 2, 0).ravel() for layer, data in row.items()}
                for row in parquet_rows([path], layers)]
        columns = {name: pa.FixedSizeListArray.from_arrays(np.concatenate([row[name] for row in rows]),
                                                           rows[0][name].size) for name in layers}
        pq.write_table(pa.table(columns), source.made / "numbers" / Path(path).name, compression="zstd",
                       use_dictionary=False, row_group_size=32)


def loaded(make: Callable[[Source, Layers], Any], source: Source, layers: Layers, workers: int) -> int:
    """Examples that come out of a DataLoader in one pass."""
    return sum(1 for _ in DataLoader(make(source, layers), batch_size=None, num_workers=workers))


def trained(source: Source) -> int:
    """Examples that come out of the training loader, which reads, cuts, exposes and copies six layers."""
    spec = TrainingSpec.model_validate({"steps": 10**9, "data": {"workers": 0}})
    dataset = LightingDataset(source.folder, SPLIT, spec.data)
    batches, count = training_batches(dataset, spec, multiple=16), 0
    while count < len(dataset):
        count += len(next(batches).keys)
    batches.close()
    return count


def decoded(encoded: list[list[bytes]], decode: Callable[[bytes], object]) -> int:
    """Examples decoded from memory."""
    for data in (data for example in encoded for data in example):
        decode(data)
    return len(encoded)


def timed(name: str, work: Work, wanted: int) -> tuple[float, float]:
    """Processor seconds per example, of this process and of those that it waited for; and wall seconds."""
    before, begin = processor(), perf_counter()
    if (count := work()) < wanted:
        raise AssertionError(f"{name}: expected {wanted} examples, got {count}")
    return (processor() - before) / count, (perf_counter() - begin) / count


def processor() -> float:
    """Seconds that this process and its former children have used."""
    return sum(sum(getrusage(who)[:2]) for who in (RUSAGE_SELF, RUSAGE_CHILDREN))


def encoded(source: Source, layers: Layers) -> list[list[bytes]]:
    """Every file of the layers."""
    rows = parquet_rows(files_in(source.made / "parquet" / "data"), layers)
    return [[row[layer] for layer in layers] for row in rows]


def report(works: dict[str, Work], count: int) -> None:
    """Measure in turn, and print medians; the first is what the others are compared with."""
    rounds = []
    for _ in range(ROUNDS):
        rounds.append({name: timed(name, work, count) for name, work in works.items()})
    bare = next(iter(works))
    for name in works:
        busy, wall = (median(one[name][k] for one in rounds) for k in (0, 1))
        share = median(one[name][0] / one[bare][0] for one in rounds)
        print(f"  {name:<36} {1e3 * busy:7.2f} ms, {share:5.2f} of bare; {1 / wall:5.0f} examples/s", flush=True)


def compare(source: Source, places: Sequence[str]) -> None:
    """All readers, for two layers and all, by workers."""
    every = tuple(layer.name for layer in source.manifest.layers)
    count = sum(shard.examples for shard in source.manifest.shards if shard.split == SPLIT)
    for layers in (TWO, every):
        files = encoded(source, layers)
        for place in places:
            here = Source(manifest=source.manifest, folder=source.folder, place=place, made=source.made)
            local = place == str(source.folder)
            makers = {name: make for name, make in READERS.items() if local or name in REMOTE}
            for workers in WORKERS:
                print(f"{len(layers)} layers, {workers} workers, {'files' if local else 'http'}: processor time")
                works: dict[str, Work] = {
                    "bare decode: OpenEXR alone": lambda files=files: decoded(files, pixels),
                    "decode as ours: shards.exr": lambda files=files: decoded(files, exr.decode)}
                works |= {name: lambda make=make, here=here, layers=layers, workers=workers: loaded(
                    make, here, layers, workers) for name, make in makers.items()}
                if local and layers == every and not workers:
                    works["training_batches, its six layers"] = lambda: trained(source)
                report(works, count)


READERS = {"open_dataset": ours, "webdataset": webdataset, "Hugging Face datasets, streaming": hugging_face,
           **({"MDS, by MosaicML's library": mds} if importlib.util.find_spec("streaming") else {}),
           "Parquet of EXR files": parquet, "Parquet of numbers": numbers}
REMOTE = ("open_dataset", "webdataset", "Hugging Face datasets, streaming")


def main() -> int:
    """Print the figures; exit code 2 where there is nothing to measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=DEFAULT, metavar="DIR")
    parser.add_argument("--http", action="store_true", help="also from a server on this machine")
    options = parser.parse_args()
    try:
        manifest = load_manifest(options.folder)
    except UserError as error:
        print(f"error: {error}\nBuild the default one with `make dataset`.", file=sys.stderr)
        return 2
    with TemporaryDirectory() as made, served(options.folder) as address:
        source = Source(manifest=manifest, folder=options.folder, place=str(options.folder), made=Path(made))
        for kind in ("mds", "parquet"):
            export_dataset(DatasetExport(dataset=options.folder, out=source.made / kind, kind=kind, splits=[SPLIT]))
        write_numbers(source)
        tars = sum(shard.bytes for shard in manifest.shards if shard.split == SPLIT)
        print(f"{manifest.name}: {tars / 1e6:.1f} MB of shards" + "".join(
            f", {sum(path.stat().st_size for path in (source.made / name).rglob('*') if path.is_file()) / 1e6:.1f} as "
            f"{title}" for name, title in (("mds", "MDS"), ("parquet", "Parquet"), ("numbers", "numbers"))))
        compare(source, [source.place, *[address] * options.http])
    return 0


if __name__ == "__main__":
    sys.exit(main())
