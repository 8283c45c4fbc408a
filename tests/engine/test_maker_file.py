"""What a build remembers: by maker, and as nothing where it is damaged."""

from pathlib import Path

import pytest

from dataset_builder.engine.maker_file import MakerFile
from dataset_builder.errors import OutputError
from dataset_builder.shards.folder import WORK
from dataset_builder.shards.manifest import Rejected

REJECTED = Rejected(key="00000001", view="train/000000", gate="coverage", reason="expected more")


def remembered(folder: Path, spec: str = "spec", numpy: str = "2.0") -> MakerFile[Rejected]:
    return MakerFile(folder, "rejected", Rejected, spec, {"numpy": numpy})


def test_what_was_written_is_read_by_the_same_maker_alone(tmp_path: Path) -> None:
    remembered(tmp_path).write([REJECTED])
    assert remembered(tmp_path).read() == (REJECTED,)
    assert remembered(tmp_path, spec="another").read() == remembered(tmp_path, numpy="2.1").read() == ()


@pytest.mark.parametrize("change", [
    lambda text: "", lambda text: "{", lambda text: "[]", lambda text: '{"maker": 1}',
    lambda text: text.replace('"rejected"', '"other"'), lambda text: text.replace('"gate"', '"door"'),
    lambda text: text.replace('"maker":"', '"maker":"0')])
def test_damage_is_nothing(tmp_path: Path, change: object) -> None:
    remembered(tmp_path).write([REJECTED])
    file, = (tmp_path / WORK).glob("rejected.*.json")
    text = file.read_text()
    assert callable(change) and change(text) != text
    file.write_text(change(text))
    assert remembered(tmp_path).read() == ()


def test_a_flipped_bit_anywhere_is_nothing(tmp_path: Path) -> None:
    remembered(tmp_path).write([REJECTED])
    file, = (tmp_path / WORK).glob("rejected.*.json")
    whole = file.read_bytes()
    for at in range(len(whole)):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << at % 8]) + whole[at + 1:])
        assert remembered(tmp_path).read() == ()


def numbered(index: int) -> Rejected:
    return REJECTED.model_copy(update={"key": f"{index:08d}"})


def test_a_journal_is_read_in_order_by_the_same_maker_alone(tmp_path: Path) -> None:
    for items in ([1], [2, 3], [4]):
        remembered(tmp_path).append(map(numbered, items))
    assert list(remembered(tmp_path).journal()) == list(map(numbered, [1, 2, 3, 4]))
    assert list(remembered(tmp_path, spec="another").journal()) == []


def test_a_journal_adds_what_is_new_and_nothing_else(tmp_path: Path) -> None:
    """Each line costs what it holds, whatever lies before it."""
    sizes = []
    for index in range(1, 20):
        remembered(tmp_path).append([numbered(index)])
        file, = (tmp_path / WORK).iterdir()
        sizes.append(file.stat().st_size)
    assert sizes == [sizes[0] * count for count in range(1, 20)]


def test_a_line_that_was_cut_short_costs_itself_alone(tmp_path: Path) -> None:
    for index in (1, 2):
        remembered(tmp_path).append([numbered(index)])
    file, = (tmp_path / WORK).iterdir()
    whole = file.read_bytes()
    for end in range(whole.rindex(b"\n") + 2, len(whole), 23):
        file.write_bytes(whole[:end])
        remembered(tmp_path).append([numbered(3)])
        assert list(remembered(tmp_path).journal()) == [numbered(1), numbered(3)]


def test_a_journal_is_never_written_through_a_link(tmp_path: Path) -> None:
    remembered(tmp_path).append([REJECTED])
    file, = (tmp_path / WORK).iterdir()
    file.rename(tmp_path / "elsewhere")
    file.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError):
        remembered(tmp_path).append([REJECTED])
