import io
import tarfile

import pytest

from dataset_builder.errors import ShardError
from dataset_builder.shards.example import Member
from dataset_builder.shards.segment import BLOCK, end_blocks, header, segment, segment_size
from dataset_builder.shards.segment_members import members_of


def member(name: str, data: bytes) -> Member:
    return Member(name=name, data=data, pixel_digest="")


MEMBERS = [member("00000001.d.exr", b"x" * 700), member("00000001.json", b""), member("00000001.mask.exr", b"y" * 512)]


def test_the_standard_library_reads_what_was_written() -> None:
    data = segment(MEMBERS)
    with tarfile.open(fileobj=io.BytesIO(data + end_blocks(len(data)))) as tar:
        infos = tar.getmembers()
        assert [(info.name, tar.extractfile(info).read()) for info in infos] == [(m.name, m.data) for m in MEMBERS]
    assert {(info.mtime, info.uid, info.gid, info.uname, info.gname, info.mode) for info in infos} == {
        (0, 0, 0, "", "", 0o444)}
    assert not any(info.pax_headers for info in infos)


def test_a_shard_is_the_concatenation_of_its_segments() -> None:
    other = [member("00000002.json", b"{}")]
    assert segment(MEMBERS) + segment(other) == segment([*MEMBERS, *other])


def test_offsets_point_at_payloads() -> None:
    data, sizes = segment(MEMBERS), [len(m.data) for m in MEMBERS]
    assert len(data) == segment_size(sizes)
    for number, m in enumerate(MEMBERS):
        offset = segment_size(sizes[:number]) + BLOCK
        assert data[offset:offset + len(m.data)] == m.data


@pytest.mark.parametrize("size", [0, 512, 9216, 9728, 10240])
def test_end_blocks_fill_a_record_with_at_least_two_blocks(size: int) -> None:
    assert (size + len(end_blocks(size))) % 10240 == 0
    assert len(end_blocks(size)) >= 1024 and not any(end_blocks(size))


@pytest.mark.parametrize("name", ["1.d.exr", "00000001.D.exr", "00000001", "a/00000001.d.exr", "00000001.d'.exr",
                                  "00000001.é.exr", "00000001." + "x" * 92])
def test_names_that_readers_would_misread_are_refused(name: str) -> None:
    with pytest.raises(ShardError, match="expected a name"):
        header(name, 1)


def test_the_longest_name_and_the_largest_size_fit() -> None:
    assert len(header("00000001." + "x" * 91, 8**11 - 1)) == 512
    with pytest.raises(ShardError, match="bytes, got"):
        header("00000001.json", 8**11)


def test_the_files_of_a_segment_come_back_and_damage_is_named() -> None:
    data = segment(MEMBERS)
    assert [*members_of(data)] == [(m.name, m.data) for m in MEMBERS]
    with pytest.raises(ShardError, match="expected the files of an example"):
        list(members_of(b"\x01" + data[1:]))
