"""The files of one example, read back from its piece of a shard."""

import tarfile
from collections.abc import Iterator
from io import BytesIO

from dataset_builder.errors import Problem, ShardError
from dataset_builder.shards.segment import end_blocks


def members_of(segment: bytes) -> Iterator[tuple[str, bytes]]:
    """Name and payload of every file that `segment` made a piece of, in its order. Raises ShardError where the bytes
    are damaged."""
    try:
        with tarfile.open(fileobj=BytesIO(segment + end_blocks(len(segment)))) as archive:
            for member in archive:
                if data := archive.extractfile(member):
                    yield member.name, data.read()
    except tarfile.TarError as error:
        raise ShardError([Problem(where="staged", path="", rule=f"expected the files of an example ({error})",
                                  hint="build again")]) from error
