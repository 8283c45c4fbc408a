"""MosaicML's MDS, version 2: `SPLIT/shard.NNNNN.mds` and `SPLIT/index.json`, for its StreamingDataset.

A file is the number of samples, the offset of each and the end (uint32, little-endian), a JSON text of its columns, and
the samples; a sample is the sizes of its columns without a fixed size (uint32), then their bytes, columns by name.
https://docs.mosaicml.com/projects/streaming/en/stable/preparing_datasets/dataset_format.html
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from dataset_builder.errors import Problem, ShardError
from dataset_builder.exporting.formats.source_shard import ExportFile, SourceRow, SourceShard, write_file
from dataset_builder.shards.example import PREVIEW
from dataset_builder.shards.shard_index import ExampleRecord

FILE_BYTES = 1 << 26
"""Samples that a file holds at most, unless one alone has more: the library's own default."""
MOST_BYTES = 2**32 - 1
"""What offsets can say."""
KEY, LABEL = "key", "label"
WORD = np.dtype("<u4")


def write_shard(shard: SourceShard, out: Path) -> Iterator[ExportFile]:
    """The files of one shard, as many as it takes. Raises ShardError where an example is too large for the format."""
    for number, piece in enumerate(_pieces(shard)):
        name = f"{shard.split}/shard.{shard.number:05d}{f'-{number:02d}' * (number > 0)}.mds"
        yield write_file(out, name, _chunks(shard, piece), examples=len(piece))


def write_index(out: Path, split: str, files: Sequence[ExportFile], layers: Sequence[str]) -> ExportFile:
    """`index.json` of a split, which readers look for first."""
    shards = [{**_columns(layers), "raw_data": {"basename": file.name.rpartition("/")[2], "bytes": file.bytes,
                                                "hashes": {"sha256": file.sha256}},
               "samples": file.examples, "zip_data": None} for file in files]
    text = json.dumps({"shards": shards, "version": 2}, sort_keys=True)
    return write_file(out, f"{split}/index.json", [text.encode()], examples=0)


def _columns(layers: Sequence[str]) -> dict[str, Any]:
    """Layers are EXR files; the label is parsed by whoever reads it."""
    encodings = dict(sorted({KEY: "str", LABEL: "json", **dict.fromkeys(layers, "bytes")}.items()))
    return {"column_encodings": [*encodings.values()], "column_names": [*encodings],
            "column_sizes": [None] * len(encodings), "compression": None, "format": "mds", "hashes": ["sha256"],
            "size_limit": FILE_BYTES, "version": 2}


def _pieces(shard: SourceShard) -> Iterator[list[ExampleRecord]]:
    piece, size = list[ExampleRecord](), 0
    for example in shard.index.examples:
        more = _size(shard, example)
        if piece and size + more > FILE_BYTES:
            yield piece
            piece, size = [], 0
        piece.append(example)
        size += more
    yield piece


def _size(shard: SourceShard, example: ExampleRecord) -> int:
    """Bytes of a sample: what it holds, and a word for the size of each column."""
    sizes = [one.size for suffix, one in shard.members(example).items() if suffix != PREVIEW]
    return len(example.key) + sum(sizes) + WORD.itemsize * (1 + len(sizes))


def _chunks(shard: SourceShard, examples: Sequence[ExampleRecord]) -> Iterator[bytes]:
    text = json.dumps(_columns(shard.layers), sort_keys=True).encode()
    begin = WORD.itemsize * (2 + len(examples)) + len(text)
    offsets = [*accumulate((_size(shard, example) for example in examples), initial=begin)]
    if offsets[-1] > MOST_BYTES:
        rule = f"expected examples of less than {MOST_BYTES:,} bytes, as MDS can hold them, got {offsets[-1]:,}"
        raise ShardError([Problem(where=shard.tar.name, path=examples[0].key, rule=rule, hint="choose fewer layers")])
    yield _words([len(examples), *offsets]) + text
    for row in shard.rows(examples):
        yield b"".join(_sample(row))


def _sample(row: SourceRow) -> Iterator[bytes]:
    values = {KEY: row.example.key.encode(), LABEL: row.label, **row.layers}
    found = [values[name] for name in sorted(values)]
    yield _words(map(len, found))
    yield from found


def _words(numbers: Iterable[int]) -> bytes:
    return np.array([*numbers], WORD).tobytes()
