"""Text and pictures of a dataset that are made to harm who looks at it."""

import resource
import struct
import zlib
from pathlib import Path
from time import perf_counter

import pytest

from dataset_builder.cli.main import main
from dataset_builder.errors import ShardError
from dataset_builder.shards.example import decode_png
from dataset_builder.shards.folder import MANIFEST
from dataset_builder.shards.label_text import encode_label
from dataset_builder.shards.reader import open_dataset
from tests.shards.replaced import replace_members
from tests.shards.test_hostile import GROWTH, SECONDS, put
from tests.shards.test_verify import STEM, edit, found
from tests.shards.tiny_dataset import index_path


def test_nothing_that_a_dataset_says_steers_the_terminal(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither clears it, nor hides a line, nor writes one of its own."""
    wicked = "x\x1b[2J\x9b1m\r\u202e\x07\n0 problems"
    edit(dataset / MANIFEST, lambda manifest: manifest.update(
        title=wicked, rejected=[{"key": "00000009", "view": wicked, "gate": wicked, "reason": wicked}]))
    edit(index_path(dataset, STEM), put("shard", "split", value=wicked))
    edit(index_path(dataset, STEM), put("examples", 0, "members", 0, "name", value=f"00000000.{wicked}"))
    assert main(["verify", str(dataset)]) == 1
    out = capsys.readouterr().out
    assert "\\x1b[2J\\x9b1m\\r\\u202e\\x07\\n0 problems" in out
    assert all(line.startswith("wrong: ") for line in out.splitlines()[:-1])
    assert all(map(str.isprintable, out.split("\n")))


def test_nothing_that_a_label_says_steers_the_terminal(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    label = open_dataset(dataset, layers=[])["00000000"]["meta"]
    label["plan"]["target"]["object"]["category"] = "chair\x1b[2J"
    replace_members(dataset, {"00000000.json": encode_label(label)})
    edit(dataset / MANIFEST, lambda manifest: manifest.update(
        title="x\x1b[1m", rejected=[{"key": "9", "view": "v", "gate": "g\x1b]0;", "reason": "r"}], totals={
            **manifest["totals"], "rejected": 1}))
    assert main(["inspect", str(dataset), "--sheet", str(dataset.parent / "sheet.png")]) == 0
    out = capsys.readouterr().out
    assert "chair\\x1b[2J" in out and "\\x1b]0;" in out and "x\\x1b[1m" in out and "\x1b" not in out


def test_a_picture_that_would_take_all_memory_is_not_decoded(dataset: Path) -> None:
    """A few bytes of PNG that say they are 60,000 x 60,000 pixels."""
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)
    body = chunk(b"IDAT", zlib.compress(bytes(99_999)))
    bomb = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + body + chunk(b"IEND", b"")
    with pytest.raises(ShardError, match="expected a PNG file, got sides of 60000 and 60000, more than 32768"):
        decode_png(bomb)
    replace_members(dataset, {"00000001.preview.png": bomb})
    begin, before = perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "00000001.preview.png: expected a PNG file, got sides of 60000 and 60000, more than 32" in found(dataset)
    assert perf_counter() - begin < SECONDS
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < GROWTH
