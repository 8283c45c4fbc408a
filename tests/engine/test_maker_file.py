"""What a build remembers: by maker, and as nothing where it is damaged."""

from pathlib import Path

import pytest

from dataset_builder.engine.maker_file import MakerFile
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
