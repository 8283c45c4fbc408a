"""A store keeps what it was given, gives nothing damaged, and stays within its limit."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.byte_store import DIGEST_SIZE, ByteStore, require_store
from dataset_builder.digest import sha256_bytes
from dataset_builder.errors import OutputError


def key(number: int) -> str:
    return sha256_bytes(bytes([number]))


def files(folder: Path) -> list[Path]:
    return [path for path in sorted(folder.rglob("*")) if path.is_file()]


def test_values_are_found_again(tmp_path: Path) -> None:
    ByteStore(tmp_path, 10_000).put(key(1), b"one")
    store = ByteStore(tmp_path, 10_000)
    assert store.get(key(1)) == b"one" and store.get(key(2)) is None
    assert store.size() == 3 + DIGEST_SIZE


def test_no_flipped_bit_is_taken(tmp_path: Path) -> None:
    store, stream = ByteStore(tmp_path, 10_000), np.random.Generator(np.random.PCG64(1))
    value = stream.bytes(60)
    store.put(key(1), value)
    path, = files(tmp_path)
    whole = path.read_bytes()
    for bit in range(8 * len(whole)):
        spoilt = bytearray(whole)
        spoilt[bit // 8] ^= 1 << bit % 8
        path.write_bytes(spoilt)
        assert store.get(key(1)) is None
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        assert store.get(key(1)) is None
    store.put(key(1), value)
    assert store.get(key(1)) == value


def test_what_was_not_used_for_longest_goes_first(tmp_path: Path) -> None:
    size = 1000 - DIGEST_SIZE
    store = ByteStore(tmp_path, 16_000)
    for number in range(12):
        store.put(key(number), bytes(size))
        os.utime(store._path(key(number)), ns=(number, number))
    assert store.get(key(0)) is not None
    for number in range(12, 20):
        store.put(key(number), bytes(size))
        time.sleep(0.002)
    kept = [number for number in range(20) if store._path(key(number)).exists()]
    assert store.size() <= 16_000
    assert 0 in kept and 1 not in kept and kept == sorted([0, *range(kept[1], 20)])


@pytest.mark.parametrize("limit", [0, 100, 999])
def test_what_does_not_fit_is_not_kept(tmp_path: Path, limit: int) -> None:
    store = ByteStore(tmp_path, limit)
    store.put(key(1), bytes(1000))
    assert files(tmp_path) == [] and store.get(key(1)) is None


def test_a_store_never_outgrows_its_limit(tmp_path: Path) -> None:
    stream, store = np.random.Generator(np.random.PCG64(2)), ByteStore(tmp_path, 20_000)
    for number in range(200):
        store.put(key(number), bytes(int(stream.integers(1, 4000))))
        assert sum(path.stat().st_size for path in files(tmp_path)) <= 20_000


def test_a_disk_that_refuses_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        ByteStore(tmp_path / "file", 10_000).put(key(1), b"one")


def test_a_store_that_keeps_nothing_leaves_what_others_kept(tmp_path: Path) -> None:
    ByteStore(tmp_path, 10_000).put(key(1), b"one")
    nothing = ByteStore(tmp_path, 0)
    nothing.put(key(2), b"two")
    nothing.trim()
    assert ByteStore(tmp_path, 10_000).get(key(1)) == b"one" and len(files(tmp_path)) == 1


def test_a_value_is_none_of_another_key(tmp_path: Path) -> None:
    store = ByteStore(tmp_path, 10_000)
    store.put(key(1), b"one")
    store._path(key(2)).parent.mkdir()
    store._path(key(1)).rename(store._path(key(2)))
    assert store.get(key(2)) is None


def test_files_of_others_are_left_alone(tmp_path: Path) -> None:
    others = [tmp_path / name for name in ("ab/thesis.txt", f"ab/{'0' * 64}", "notes", "cd/x.tar")]
    for path in others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(bytes(5000))
        os.utime(path, ns=(1, 1))
    store = ByteStore(tmp_path, 10_000)
    for number in range(20):
        store.put(key(number), bytes(2000))
    assert all(path.is_file() for path in others) and store.size() <= 10_000


@pytest.mark.parametrize("name", ["out", "out/shards", "out/.build", "file", "file/below"])
def test_a_store_among_other_files_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="--cache: expected a folder"):
        require_store(tmp_path / name, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_store_is_made_where_it_is_missing(tmp_path: Path) -> None:
    require_store(tmp_path / "a" / "b", tmp_path / "out")
    assert (tmp_path / "a" / "b").is_dir()
