"""Pieces by few requests: the same bytes, and little more than them."""

from itertools import pairwise
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.remote.coalesce import joined, pieces
from dataset_builder.remote.place import ByteRange, FolderPlace

SIZE = 400
FILES = {name: bytes((number + 7 * place) % 256 for place in range(SIZE)) for number, name in enumerate("ab")}
PIECES = st.lists(st.builds(ByteRange, st.sampled_from("ab"), st.integers(0, SIZE - 60), st.integers(0, 60)))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(wanted=PIECES, gap=st.integers(0, 100))
def test_pieces_are_what_they_are_alone(wanted: list[ByteRange], gap: int, tmp_path: Path) -> None:
    for name, data in FILES.items():
        (tmp_path / name).write_bytes(data)
    assert pieces(FolderPlace(tmp_path), wanted, gap=gap) == [FILES[name][start:start + size]
                                                              for name, start, size in wanted]


@settings(deadline=None)
@given(wanted=PIECES, gap=st.integers(0, 100))
def test_stretches_lie_more_than_a_gap_apart_and_hold_no_larger_one(wanted: list[ByteRange], gap: int) -> None:
    stretches = joined(wanted, gap=gap)
    for one, other in pairwise(stretches):
        assert one.name < other.name or one.start + one.size + gap < other.start
    inside = {(piece.name, byte) for piece in wanted for byte in range(piece.start, piece.start + piece.size)}
    edges = {(one.name, byte) for one in stretches for byte in (one.start, one.start + one.size - 1)}
    assert edges <= inside
    for one in stretches:
        idle = 0
        for byte in range(one.start, one.start + one.size):
            idle = 0 if (one.name, byte) in inside else idle + 1
            assert idle <= gap


def test_long_stretches_are_cut() -> None:
    half = 1 << 23
    wanted = [ByteRange("a", number * half, half) for number in range(5)]
    assert [piece.size // half for piece in joined(wanted)] == [2, 2, 1]
