"""Whole shards and indexes of a dataset, brought to where the next set waits: side by side, and each byte once."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from time import monotonic

from dataset_builder.digest import open_regular, read_regular, sha256_bytes, sha256_file
from dataset_builder.errors import Problem, ShardError, UserError
from dataset_builder.files import output_errors, write_atomic
from dataset_builder.remote.coalesce import joined, pieces
from dataset_builder.remote.place import ByteRange
from dataset_builder.shards.folder import MOST_BYTES, WORK, next_of
from dataset_builder.shards.segment import BLOCK, end_blocks, header, padding
from dataset_builder.shards.shard_index import ShardIndex, ShardRecord
from dataset_builder.shards.structure import members_of, starts
from dataset_builder.shards.writer import index_path, shard_path
from dataset_builder.transfer.chunked_file import CHUNK_SIZE, ChunkedFile
from dataset_builder.transfer.origin import TRIES, Origin, unreadable

PULL = "pull"
"""Below `.build`: files that are not whole yet, and indexes that examples are chosen from."""

STREAMS = 8
"""Requests at a time."""


@dataclass(frozen=True, kw_only=True)
class TransferProgress:
    """How far a transfer is."""

    done: int
    """Bytes that are there, those of earlier runs among them."""
    total: int
    """Bytes that are wanted."""
    moved: int
    """Bytes that came over the wire in this run, and were needed or lay between such."""
    seconds: float
    """Since it began."""

    @property
    def rate(self) -> float:
        """Bytes a second, of this run."""
        return self.moved / self.seconds if self.seconds > 0 else 0.0

    @property
    def left(self) -> float:
        """Seconds that it will take at that rate."""
        return (self.total - self.done) / self.rate if self.rate else float("inf")


class Fetching:
    """Brings files of `origin` below `.build` of a folder. Raises UserError where bytes cannot be had, or are again and
    again not what was stated; OutputError where the disk refuses. What was finished is found again by the next run."""

    def __init__(self, origin: Origin, folder: Path, *,
                 told: Callable[[TransferProgress], None] = lambda progress: None, chunk_size: int = CHUNK_SIZE):
        self.origin, self.folder = origin, folder
        self.total = 0
        """Bytes that are wanted, for progress."""
        self._work, self._told, self._chunk_size = folder / WORK / PULL, told, chunk_size
        self._done, self._moved, self._begun, self._lock = 0, 0, monotonic(), Lock()

    def note(self, *, done: int = 0, moved: int = 0) -> None:
        """Tell that more bytes are there, and that more came over the wire."""
        with self._lock:
            self._done, self._moved = self._done + done, self._moved + moved
            seconds = monotonic() - self._begun
            self._told(TransferProgress(done=self._done, total=self.total, moved=self._moved, seconds=seconds))

    @property
    def moved(self) -> int:
        """Bytes of shards and indexes that came over the wire."""
        return self._moved

    def index(self, shard: ShardRecord) -> ShardIndex:
        """The index of a shard, checked; it is kept for the next time."""
        return self.origin.index(shard, self._index_data(shard))

    def indexes(self, shards: Iterable[ShardRecord]) -> None:
        """Fetch the indexes of some shards side by side, so that `index` finds them."""
        with _pool() as pool:
            waiting = deque[Future[bytes]]()
            for shard in shards:
                waiting.append(pool.submit(self._index_data, shard))
                if len(waiting) > STREAMS:
                    waiting.popleft().result()
            for future in waiting:
                future.result()

    def shards(self, shards: Sequence[ShardRecord]) -> None:
        """Fetch whole shards and their indexes to below `.build/next`."""
        # Before anything large is fetched
        self.indexes(shards)
        for shard in shards:
            self.index(shard)
        for _ in range(TRIES):
            shards = self._round(shards)
            if not shards:
                return
        rule, hint = f"its bytes differed {TRIES} times", "pull again, or tell whoever publishes it; the rest is kept"
        raise UserError(Problem(where=self.origin.place.title, path=shard.tar_file, hint=hint,
                                rule=f"expected SHA-256 {shard.sha256}, {rule}") for shard in shards)

    def pieces(self, wanted: Sequence[ByteRange], gap: int = 0) -> list[bytes]:
        """Pieces of one file, those up to `gap` bytes apart by one request."""
        if not wanted:
            return []
        try:
            found = pieces(self.origin.place, wanted, gap=gap)
        except (OSError, EOFError) as error:
            raise unreadable(self.origin.place, wanted[0].name, error) from error
        if [len(data) for data in found] != [piece.size for piece in wanted]:
            raise unreadable(self.origin.place, wanted[0].name, EOFError("it ends too early"))
        self.note(moved=sum(stretch.size for stretch in joined(wanted, gap=gap)))
        return found

    def _round(self, shards: Iterable[ShardRecord]) -> list[ShardRecord]:
        """Fetch what is missing of shards; those whose bytes were wrong, of which the wrong chunks are forgotten."""
        damaged, waiting = list[ShardRecord](), deque[tuple[Future[list[bytes]], ChunkedFile, int, ShardRecord]]()

        def settle() -> None:
            future, file, number, shard = waiting.popleft()
            data = future.result()[0]
            with output_errors(self.folder):
                file.put(number, data)
            self.note(done=len(data))
            finish(file, shard)

        def finish(file: ChunkedFile, shard: ShardRecord) -> None:
            if not file.missing:
                if not self._finish(file, shard):
                    damaged.append(shard)
                file.close()

        with ExitStack() as stack, _pool() as pool:
            for shard in shards:
                with output_errors(self.folder):
                    file = ChunkedFile(self._part(shard), shard.bytes, chunk_size=self._chunk_size)
                stack.callback(file.close)
                missing = file.missing
                self.note(done=shard.bytes - sum(file.span(number)[1] for number in missing))
                if not missing:
                    finish(file, shard)
                for number in missing:
                    piece = ByteRange(shard.tar_file, *file.span(number))
                    waiting.append((pool.submit(self.pieces, [piece]), file, number, shard))
                    if len(waiting) > STREAMS:
                        settle()
            while waiting:
                settle()
        return damaged

    def _finish(self, file: ChunkedFile, shard: ShardRecord) -> bool:
        part, target = self._part(shard), next_of(self.folder)
        data = self._index_data(shard)
        with output_errors(self.folder):
            if sha256_file(part) == shard.sha256:
                file.finish(shard_path(target, shard.stem))
                write_atomic(index_path(target, shard.stem), data)
                return True
        for first, last in _damage(part, self.origin.index(shard, data)) or [(0, shard.bytes)]:
            file.forget(first, last)
        self.note(done=-shard.bytes)
        return False

    def _index_data(self, shard: ShardRecord) -> bytes:
        """The file of an index, of this run or an earlier one."""
        name = shard.index_file
        wanted = self.origin.sums[name]
        kept = self._work / wanted
        try:
            data = read_regular(kept, most=MOST_BYTES)
        except OSError:
            data = b""
        if sha256_bytes(data) == wanted:
            return data
        for _ in range(TRIES):
            try:
                data = self.origin.place.read(name, most=MOST_BYTES)
            except (OSError, EOFError) as error:
                raise unreadable(self.origin.place, name, error) from error
            self.note(moved=len(data))
            if sha256_bytes(data) == wanted:
                write_atomic(kept, data)
                return data
        rule, hint = f"expected SHA-256 {wanted}, got {sha256_bytes(data)}", "pull again, or tell whoever publishes it"
        raise ShardError([Problem(where=self.origin.place.title, path=name, rule=rule, hint=hint)])

    def _part(self, shard: ShardRecord) -> Path:
        return self._work / f"{shard.sha256}.part"


@contextmanager
def _pool() -> Iterator[ThreadPoolExecutor]:
    """Threads that do nothing more once something went wrong."""
    pool = ThreadPoolExecutor(STREAMS)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _damage(path: Path, index: ShardIndex) -> list[tuple[int, int]]:
    """First byte and end of every member, or of the end blocks, that is not what the index says."""
    wrong = list[tuple[int, int]]()
    with open_regular(path) as stream:
        for member, start in zip(members_of(index), starts(index), strict=False):
            stream.seek(start)
            fill = padding(member.size)
            head, data, rest = stream.read(BLOCK), stream.read(member.size), stream.read(len(fill))
            if (head, sha256_bytes(data), rest) != (header(member.name, member.size), member.sha256, fill):
                wrong.append((start, start + BLOCK + member.size + len(fill)))
        end = starts(index)[-1]
        stream.seek(end)
        if stream.read() != end_blocks(end):
            wrong.append((end, index.shard.bytes))
    return wrong
