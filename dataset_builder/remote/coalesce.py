"""Pieces of files by few requests: neighbours are asked for at once."""

from collections.abc import Iterator, Sequence

from dataset_builder.remote.place import ByteRange, Place

GAP = 1 << 14
"""Bytes that are fetched for nothing rather than asked around: at 20 ms per request, what 1 MB/s brings meanwhile."""
LONGEST = 1 << 24
"""Bytes of one request, where pieces are no larger."""


def joined(wanted: Sequence[ByteRange], *, gap: int = GAP) -> list[ByteRange]:
    """Stretches that hold all pieces that are not empty, sorted: pieces of a file up to `gap` bytes apart are one.

    >>> joined([ByteRange("a", 600, 10), ByteRange("a", 0, 88)], gap=512)
    [ByteRange(name='a', start=0, size=610)]
    """
    found = list[ByteRange]()
    for piece in sorted({piece for piece in wanted if piece.size}):
        last = found[-1] if found else None
        if last and last.name == piece.name and piece.start <= last.start + last.size + gap:
            size = max(last.size, piece.start + piece.size - last.start)
            if size <= max(LONGEST, last.size):
                found[-1] = last._replace(size=size)
                continue
        found.append(piece)
    return found


def pieces(place: Place, wanted: Sequence[ByteRange], *, gap: int = GAP) -> list[bytes]:
    """The pieces, in the order that they are asked for, by few requests. Raises as `Place.ranges` does; EndedError
    names the stretch that a piece is in."""
    stretches = joined(wanted, gap=gap)
    data = dict(zip(stretches, place.ranges(stretches), strict=True))
    homes = {piece: home for piece, home in _homes(wanted, stretches)}
    return [_cut(data[homes[piece]], piece.start - homes[piece].start, piece.size) if piece.size else b""
            for piece in wanted]


def _cut(data: bytes, start: int, size: int) -> bytes:
    return data if (start, size) == (0, len(data)) else data[start:start + size]


def _homes(wanted: Sequence[ByteRange], stretches: Sequence[ByteRange]) -> Iterator[tuple[ByteRange, ByteRange]]:
    """Each piece with the stretch that holds it."""
    number = 0
    for piece in sorted({piece for piece in wanted if piece.size}):
        while not (stretches[number].name == piece.name
                   and stretches[number].start + stretches[number].size >= piece.start + piece.size):
            number += 1
        yield piece, stretches[number]
