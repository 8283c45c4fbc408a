"""A finished dataset from a folder to where others pull it: names never change their content, `dataset.json` is last.

Until it is there nobody sees the new release, and the old one, if there was one, stays whole.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import monotonic

from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import Problem, ShardError
from dataset_builder.remote.open_place import place_of
from dataset_builder.remote.place import ByteRange
from dataset_builder.remote.upload import FolderShelf, Shelf, shelf_of
from dataset_builder.shards.example import LABEL
from dataset_builder.shards.folder import MANIFEST, MOST_BYTES
from dataset_builder.shards.manifest import Manifest, from_json
from dataset_builder.transfer.fetching import TransferProgress
from dataset_builder.transfer.origin import TEXTS, Origin, open_origin
from dataset_builder.transfer.outgoing import (
    Pushed,
    SentFile,
    left_over_there,
    other_content,
    outgoing,
    require_outside,
    require_room,
)
from dataset_builder.transfer.push_hub import push_to_hub

SMALL = 2**20
"""Bytes up to which a file that is there already is compared by content; larger ones by size, since their names hold
digests of what is in them."""

STREAMS = 4
"""Files that are sent at a time."""


def push(folder: Path, address: str | Path, *, replace: bool = False, prune: bool = False,
         told: Callable[[TransferProgress], None] = lambda progress: None) -> Pushed:
    """Send the dataset in `folder` to `address`, and read back what others will see.

    replace: another dataset or version there may make room; its shards stay. prune: shards and indexes that are not
    listed any more are removed afterwards. Raises ShardError where the dataset here is not what its sums say or the one
    there does not read back, OutputError where another one is there or a name has another content, UserError where the
    place cannot be written. What was sent is kept: the next run goes on.
    """
    origin, files = outgoing(folder)
    if str(address).lower().startswith("hf://"):
        return push_to_hub(origin, files, str(address), replace=replace, prune=prune, told=told)
    shelf = shelf_of(address)
    if isinstance(shelf, FolderShelf):
        require_outside(shelf.folder, folder, "expected a folder outside of the dataset to push")
    there = shelf.sizes()
    before = _manifest_there(shelf, there)
    require_room(shelf.title, before, origin, replace=replace)
    data = [file for file in files if "/" in file.name and not _is_there(shelf, there, file)]
    # What is not listed yet may be of a push that was cut short
    texts = [file for file in files if "/" not in file.name and not (
        there.get(file.name) == file.size and shelf.read(file.name, most=MOST_BYTES) == file.path.read_bytes())]
    _send(shelf, data, texts, told)
    left = left_over_there(shelf.sizes(), files)
    for name in left if prune else ():
        shelf.remove(name)
    _read_back(address, origin, files, shelf.sizes())
    sent = [*data, *texts]
    return Pushed(sha256=origin.sha256, files=len(sent), sent=sum(file.size for file in sent),
                  left=() if prune else left)


def _manifest_there(shelf: Shelf, there: Mapping[str, int]) -> Manifest | None:
    if MANIFEST not in there:
        return None
    return from_json(Manifest, shelf.read(MANIFEST, most=MOST_BYTES), where=f"{shelf.title}: {MANIFEST}")


def _is_there(shelf: Shelf, there: Mapping[str, int], file: SentFile) -> bool:
    """Whether a shard or an index was sent before. Raises OutputError where something else has its name."""
    if file.name not in there:
        return False
    same = there[file.name] == file.size
    if same and file.size <= SMALL:
        same = shelf.read(file.name, most=SMALL) == file.path.read_bytes()
    if not same:
        raise other_content(shelf.title, file.name)
    return True


def _send(shelf: Shelf, data: Sequence[SentFile], texts: Sequence[SentFile],
          told: Callable[[TransferProgress], None]) -> None:
    total, done, begun = sum(file.size for file in (*data, *texts)), 0, monotonic()
    with ThreadPoolExecutor(STREAMS) as pool:
        sending = {pool.submit(shelf.put, file.name, file.path): file for file in data}
        try:
            for future, file in sending.items():
                future.result()
                done += file.size
                told(TransferProgress(done=done, total=total, moved=done, seconds=monotonic() - begun))
        finally:
            pool.shutdown(cancel_futures=True)
    for file in texts:
        shelf.put(file.name, file.path)
        done += file.size
        told(TransferProgress(done=done, total=total, moved=done, seconds=monotonic() - begun))


def _read_back(address: str | Path, origin: Origin, files: Sequence[SentFile], there: Mapping[str, int]) -> None:
    """Raise ShardError where others would not see at `address` what was sent: sizes of all files, the small ones by
    hash, and a label by range."""
    seen = open_origin(place_of(address), sha256=origin.sha256)
    for name in TEXTS:
        seen.text(name)
    if wrong := [file.name for file in files if there.get(file.name) != file.size]:
        raise _unseen(seen, wrong[0], "expected it as it was sent, got another size")
    shard = seen.manifest.shards[0]
    data = seen.place.read(shard.index_file, most=MOST_BYTES)
    if sha256_bytes(data) != seen.sums[shard.index_file]:
        raise _unseen(seen, shard.index_file, "expected it as it was sent, its bytes differ")
    label = next(one for one in seen.index(shard, data).examples[0].members if one.suffix == LABEL)
    text, = seen.place.ranges([ByteRange(shard.tar_file, label.offset, label.size)])
    if sha256_bytes(text) != label.sha256:
        raise _unseen(seen, shard.tar_file, f"expected {label.name} as it was sent, its bytes differ")


def _unseen(seen: Origin, name: str, rule: str) -> ShardError:
    return ShardError([Problem(where=seen.place.title, path=name, rule=rule, hint="push again")])
