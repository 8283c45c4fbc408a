"""NVIDIA DALI's index of a tar, version 1.2: `STEM.idx`, so that `fn.readers.webdataset` need not read it first.

`v1.2 N`, then a line for each example: `EXT OFFSET SIZE NAME` of every file, EXT being all after the first dot of the
name and OFFSET that of the payload. https://github.com/NVIDIA/DALI, `tools/wds2idx.py` and `webdataset_loader.cc`
"""

from collections.abc import Iterator
from pathlib import Path

from dataset_builder.errors import ShardError
from dataset_builder.exporting.formats.source_shard import ExportFile, SourceShard, write_file
from dataset_builder.shards.structure import tar_problems

VERSION = "v1.2"


def write_shard(shard: SourceShard, out: Path) -> Iterator[ExportFile]:
    """The index of one shard, whatever its layers. Raises ShardError where the tar is not as our own index says.

    A file that an example shares with an earlier one is listed for both, so that DALI finds it where other readers of
    the tar do not.
    """
    if problems := tar_problems(shard.tar, shard.index):
        raise ShardError(problems)
    examples = shard.index.examples
    lines = [" ".join(f"{one.suffix} {one.offset} {one.size} {one.name}" for one in example.members)
             for example in examples]
    text = "\n".join([f"{VERSION} {len(examples)}", *lines, ""])
    yield write_file(out, f"{shard.index.shard.stem}.idx", [text.encode()], examples=len(examples))
