"""Processes share the texels of large images: equal with and without, whatever became of the store."""

import threading
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets import image_maps
from dataset_builder.assets.image_maps import read_texels
from dataset_builder.assets.texel_memory import TexelMemory, sharing_texels
from dataset_builder.byte_store import ByteStore
from dataset_builder.errors import OutputError, UserError
from tests.assets.test_image_maps import image


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setattr(image_maps, "LARGE", 100)
    return image(np.random.default_rng(3).integers(0, 256, (20, 30, 4), dtype=np.uint8))


@pytest.fixture
def decoded(monkeypatch):
    """How often an image was decoded."""
    times, real = [], image_maps.reduced

    def counted(*given, **named):
        times.append(1)
        return real(*given, **named)

    monkeypatch.setattr(image_maps, "reduced", counted)
    return times


def memory(folder: Path, limit: int = 1 << 20, made_by: str = "a") -> TexelMemory:
    return TexelMemory(store=ByteStore(folder / "store", limit), lock=folder / "work" / "lock", made_by=made_by)


def test_what_one_process_read_the_others_find(tmp_path, found, decoded):
    alone = read_texels(found, srgb=True, max_size=8)
    for _ in range(2):
        with sharing_texels(memory(tmp_path)):
            shared = read_texels(found, srgb=True, max_size=8)
        assert shared.dtype == alone.dtype and shared.tobytes() == alone.tobytes() and shared.flags.writeable
    assert len(decoded) == 2
    read_texels(found, srgb=True, max_size=8)
    assert len(decoded) == 3


def test_another_way_of_reading_is_another_entry(tmp_path, found, decoded):
    ways = [{}, {"srgb": False}, {"max_size": 9}, {"opaque": True}]
    plain = {"srgb": True, "max_size": 8}
    for _ in range(2):
        with sharing_texels(memory(tmp_path)):
            shared = [read_texels(found, **plain | way) for way in ways]
    with sharing_texels(memory(tmp_path, made_by="b")):
        read_texels(found, **plain)
    assert len(decoded) == len(ways) + 1
    for texels, way in zip(shared, ways, strict=True):
        assert texels.tobytes() == read_texels(found, **plain | way).tobytes()


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data[:-4] + b"abcd", lambda data: b""])
def test_damaged_entries_are_read_anew(tmp_path, found, decoded, damage):
    with sharing_texels(memory(tmp_path)):
        first = read_texels(found, srgb=True, max_size=8)
        entry, = [path for path in (tmp_path / "store").glob("*/*") if path.is_file()]
        entry.write_bytes(damage(entry.read_bytes()))
        assert read_texels(found, srgb=True, max_size=8).tobytes() == first.tobytes()
    assert len(decoded) == 2


class Odd:
    """A store that is not what it should be."""

    def __init__(self, value: bytes | None):
        self.value = value

    def get(self, key: str) -> bytes | None:
        return self.value

    def put(self, key: str, value: bytes) -> None:
        raise OutputError("full")


@pytest.mark.parametrize("value", [None, b"", bytes(12), bytes(13), b"\1\0\0\0" * 3 + bytes(8)])
def test_a_full_disk_and_odd_bytes_stop_nobody(tmp_path, found, value):
    alone = read_texels(found, srgb=True, max_size=8)
    (tmp_path / "file").write_bytes(b"")
    with sharing_texels(TexelMemory(store=Odd(value), lock=tmp_path / "file" / "lock", made_by="")):
        shared = read_texels(found, srgb=True, max_size=8)
    assert shared.tobytes() == alone.tobytes()


def test_small_images_are_not_kept(tmp_path, monkeypatch):
    with sharing_texels(memory(tmp_path)):
        read_texels(image(np.zeros((4, 4), np.uint8)), srgb=True, max_size=8)
    assert not (tmp_path / "store").exists()


def test_large_images_are_read_one_at_a_time(tmp_path, found):
    """Whoever comes second waits, and finds what the first one kept."""
    inside, go, done = threading.Event(), threading.Event(), threading.Event()
    real = image_maps.reduced
    alone = read_texels(found, srgb=True, max_size=8)
    results = []

    def slow(*given, **named):
        inside.set()
        assert go.wait(10)
        return real(*given, **named)

    def work():
        with sharing_texels(memory(tmp_path)):
            results.append(read_texels(found, srgb=True, max_size=8))
        done.set()

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(image_maps, "reduced", slow)
        first = threading.Thread(target=work)
        first.start()
        assert inside.wait(10)
        patched.setattr(image_maps, "reduced", lambda *given, **named: pytest.fail("read twice"))
        second = threading.Thread(target=work)
        second.start()
        assert not done.wait(0.2)
        go.set()
        first.join(10)
        second.join(10)
    assert [texels.tobytes() for texels in results] == [alone.tobytes()] * 2


def test_a_damaged_image_is_refused_and_lets_the_next_one_in(tmp_path, found):
    cut = image_maps.ImageFile(name="cut.png", content=found.content[:-400])
    with sharing_texels(memory(tmp_path)):
        with pytest.raises(UserError, match=r"cut\.png: expected a readable image"):
            read_texels(cut, srgb=True, max_size=8)
        read_texels(found, srgb=True, max_size=8)
