"""Four depths, splits, several processes, interrupted runs: what each looks at, and that all say the same."""

import os
import shutil
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.byte_store import ByteStore
from dataset_builder.cli.main import main
from dataset_builder.cli.rate_line import RateLine, rate_text
from dataset_builder.errors import OutputError, UserError
from dataset_builder.shards import verify_shard
from dataset_builder.shards.reader import load_manifest
from dataset_builder.shards.verify import Depth, verify
from dataset_builder.shards.verify_shard import AcrossShards, Known, Look, ShardFacts
from tests.shards.replaced import exr_of, replace_members
from tests.shards.test_verify import STEM, load_index
from tests.shards.tiny_dataset import build, default_examples, index_path, make_example, make_layers, shard_path

DEPTHS: tuple[Depth, ...] = ("size", "shard", "member", "pixels")


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 4
    path.write_bytes(data)


def seen(folder: Path) -> list[bool]:
    """Whether each depth finds something."""
    return [bool(verify(folder, depth=depth)) for depth in DEPTHS]


def test_each_depth_sees_what_the_one_before_does_not(tmp_path: Path) -> None:
    build(tmp_path / "good")
    assert seen(tmp_path / "good") == [False] * 4
    shutil.copytree(tmp_path / "good", tmp_path / "longer")
    with shard_path(tmp_path / "longer", STEM).open("ab") as stream:
        stream.write(bytes(512))
    assert seen(tmp_path / "longer") == [True] * 4
    shutil.copytree(tmp_path / "good", tmp_path / "flipped")
    flip(shard_path(tmp_path / "flipped", STEM), load_index(tmp_path / "flipped").examples[0].members[0].offset + 9)
    assert seen(tmp_path / "flipped") == [False, True, True, True]
    # Examples of two shards whose view has other pixels in each: only indexes tell
    apart = default_examples() | {2: make_example(2, view="train/000000", layers=make_layers("another"))}
    build(tmp_path / "apart", apart)
    assert seen(tmp_path / "apart") == [False, False, True, True]
    assert "00000002 and 00000000: shared: expected the same pixels" in "\n".join(map(str, verify(tmp_path / "apart")))
    bad = exr_of(np.full((6, 8, 3), np.nan, np.float32), layer="i_t", key="00000002")
    shutil.copytree(tmp_path / "good", tmp_path / "nan")
    replace_members(tmp_path / "nan", {"00000002.i_t.exr": bad})
    assert seen(tmp_path / "nan") == [False, False, False, True]


def test_a_full_disk_costs_what_is_known_and_no_more(dataset: Path, tmp_path: Path,
                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    def full(store: ByteStore, key: str, value: bytes) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(ByteStore, "put", full)
    assert verify(dataset, known=Known(store=ByteStore(tmp_path / "state", 2**20), code="a"), workers=1) == []


def test_any_number_of_processes_says_the_same_in_the_same_order(tmp_path: Path) -> None:
    examples = default_examples() | {1: make_example(1, view="train/000000", light=1, layers=make_layers("x", 1))}
    build(tmp_path, examples)
    for slot in (STEM, "tiny-v1-test-000000"):
        flip(shard_path(tmp_path, slot), 700)
    index_path(tmp_path, "tiny-v1-train-000001").write_text("{")
    (tmp_path / "more").write_text("x")
    told = list[tuple[int, int]]()
    alone = verify(tmp_path)
    assert len(alone) >= 10 and verify(tmp_path, workers=2, told=lambda done, of: told.append((done, of))) == alone
    assert told[0][0] == 0 and told[-1][0] == told[-1][1] == load_manifest(tmp_path).totals.bytes


def test_a_split_alone(dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    flip(shard_path(dataset, STEM), 700)
    assert verify(dataset, splits=["test"]) == [] and verify(dataset, splits=["test", "train"]) == verify(dataset)
    assert main(["verify", str(dataset), "--split", "test", "--depth", "member", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "not looked at: shards of train" in said and "not looked at, with --depth member: pixels and" in said
    assert main(["verify", str(dataset), "--split", "train", "--workers", "1"]) == 1
    assert main(["verify", str(dataset), "--split", "tset"]) == 2
    with pytest.raises(UserError, match="expected one of size"):
        verify(dataset, depth="deep")  # type: ignore[arg-type]


def test_an_interrupted_run_goes_on_and_looks_again_at_what_changed(dataset: Path, tmp_path: Path,
                                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    inside, looked = Look._inside, list[str]()

    def counted(self: Look, shard: verify_shard.ShardRecord, *args: object) -> ShardFacts:
        if len(looked) == 2:
            raise KeyboardInterrupt
        looked.append(shard.slot)
        return inside(self, shard, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(Look, "_inside", counted)
    known = Known(store=ByteStore(tmp_path / "state", 2**20), code="a")
    with pytest.raises(KeyboardInterrupt):
        verify(dataset, known=known)
    assert looked == ["tiny-v1-train-000000", "tiny-v1-train-000001"]
    # Same size, and the time of the last change put back: only its bytes tell
    path = shard_path(dataset, "tiny-v1-train-000001")
    times = path.stat()
    flip(path, 700)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    looked.clear()
    assert "expected SHA-256" in "\n".join(map(str, verify(dataset, known=known)))
    assert looked == ["tiny-v1-train-000001", "tiny-v1-test-000000"]
    looked.clear()
    assert verify(dataset, known=known) == verify(dataset, known=known) and looked == []
    for file in (tmp_path / "state").rglob("*"):
        if file.is_file():
            flip(file, 50)
    monkeypatch.undo()
    assert verify(dataset, known=known) == verify(dataset)


def test_the_command_keeps_its_state_until_it_ends(dataset: Path, tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    state = tmp_path / "cache" / "3df-lighting"

    def cut(self: AcrossShards) -> None:
        assert len([path for path in state.rglob("*") if path.is_file()]) == 3
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(AcrossShards, "summary", cut)
        assert main(["verify", str(dataset), "--workers", "1"]) == 130
    assert state.is_dir()
    assert main(["verify", str(dataset), "--workers", "1"]) == 0 and not state.exists()


def test_what_is_kept_of_an_example_is_small(dataset: Path) -> None:
    """Ten thousand examples, each of a view of its own."""
    per_shard, shards = 250, 40
    agreement = AcrossShards(load_manifest(dataset))
    tracemalloc.start()
    try:
        for number in range(shards):
            keys = range(number * per_shard, (number + 1) * per_shard)
            views = tuple((f"{key:032x}", "0" * 32, key) for key in keys)
            assert list(agreement.add(0, ShardFacts(keys=tuple(keys), views=views), 1)) == []
        held, _ = tracemalloc.get_traced_memory()
        assert list(agreement.summary()) == []
    finally:
        tracemalloc.stop()
    assert held / (per_shard * shards) < 90


def test_how_far_it_is() -> None:
    assert rate_text(0, 5 * 10**6, 0.0) == "0 bytes of 4.8 MiB, 0 bytes/s, looking"
    assert rate_text(10**9, 3 * 10**9, 250e6) == "953.7 MiB of 2.8 GiB, 238.4 MiB/s, 0:00:08 left"


@pytest.mark.parametrize(("terminal", "shown"), [(True, "\r{}"), (False, "{}\n")])
def test_lines_replace_each_other_on_a_terminal_and_are_few_elsewhere(
        terminal: bool, shown: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal)
    line = RateLine()
    line.told(10**6, 2 * 10**6)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("dataset_builder.cli.rate_line.monotonic", lambda: line._begun + 100)
    line.told(10**6, 2 * 10**6)
    line.told(2 * 10**6, 2 * 10**6)
    text = "976.6 KiB of 1.9 MiB, 9.8 KiB/s, 0:01:40 left"
    assert capsys.readouterr().err == shown.format(f"{text:<70}" if terminal else text)
    line.close()
    assert capsys.readouterr().err == f"\r{'':<70}\r" * terminal
