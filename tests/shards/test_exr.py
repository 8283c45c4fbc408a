import struct
import zlib
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import ShardError
from dataset_builder.seeding import rng
from dataset_builder.shards import exr


def picture(channels: int = 3, seed: int = 0) -> np.ndarray:
    return rng(seed, "picture").uniform(0, 30, (6, 8, channels)).astype(np.float32)


def encode(array: np.ndarray, layer: str = "i_s", dtype: exr.DType = "float32") -> bytes:
    return exr.encode(array, layer=layer, key="00000042", dtype=dtype)


@pytest.mark.parametrize(("layer", "channels"), [("i_s", 3), ("mask", 1), ("normal", 3)])
def test_float32_comes_back_bit_by_bit(layer: str, channels: int) -> None:
    array = picture(channels)
    array[0, 0, 0] = -0.0
    image = exr.read(encode(array, layer))
    assert image.pixels.tobytes() == array.tobytes() and image.pixels.shape == array.shape
    assert (image.layer, image.key, image.dtype) == (layer, "00000042", "float32")


def test_half_rounds_to_eleven_bits_and_says_so() -> None:
    array = picture()
    image = exr.read(encode(array, dtype="float16"))
    assert image.dtype == "float16"
    assert (np.abs(image.pixels - array) <= np.abs(array) * 2.0**-11).all()
    assert np.array_equal(image.pixels, exr.stored(array, layer="i_s", key="0", dtype="float16"))


def test_equal_pixels_give_equal_bytes() -> None:
    assert encode(picture()) == encode(picture().copy())
    assert encode(picture()) != encode(picture(seed=1))


@pytest.mark.parametrize("view", [
    lambda a: a[::-1], lambda a: a[:, ::-1], lambda a: a[::2, 1:], lambda a: np.asfortranarray(a),
    lambda a: a.transpose(1, 0, 2), lambda a: np.ascontiguousarray(a.transpose(2, 0, 1)).transpose(1, 2, 0),
    lambda a: a[:, :, ::-1],
], ids=["flip", "mirror", "slice", "fortran", "transpose", "chw", "bgr"])
def test_arrays_that_are_not_contiguous_are_written_right(view: Any) -> None:
    array = view(picture())
    assert np.array_equal(exr.decode(encode(array)), array)


@pytest.mark.parametrize(("array", "rule"), [
    (picture(1), "expected shape (H, W, 3), got (6, 8, 1)"),
    (picture(2), "got (6, 8, 2)"),
    (picture(5), "got (6, 8, 5)"),
    (picture()[..., 0], "got (6, 8)"),
    (picture()[:0], "got (0, 8, 3)"),
    (picture().astype(np.float64), "expected float32 pixels, got float64"),
    (picture().astype(np.float16), "got float16"),
    (picture().astype(">f4"), "got >f4"),
    (np.full((6, 8, 3), np.nan, np.float32), "got 144 that are NaN or Inf"),
    (np.full((6, 8, 3), -np.inf, np.float32), "NaN or Inf"),
], ids=str)
def test_what_cannot_be_stored_is_refused_by_name(array: np.ndarray, rule: str) -> None:
    with pytest.raises(ShardError) as error:
        encode(array)
    assert "example 00000042, layer i_s" in str(error.value) and rule in str(error.value)


def test_values_beyond_half_are_refused_never_clipped() -> None:
    array = picture()
    array[0, 0] = 70000.0
    with pytest.raises(ShardError, match=r"\|x\| <= 65504 to store as float16, got 70000"):
        encode(array, dtype="float16")
    assert exr.decode(encode(array)).max() == 70000.0
    array[0, 0] = 65504.0
    assert exr.decode(encode(array, dtype="float16")).max() == 65504.0


def test_a_file_cut_anywhere_is_refused() -> None:
    data = encode(picture())
    for size in range(0, len(data), 7):
        with pytest.raises(ShardError, match=r"^data: expected (an EXR file, got \d+ bytes|one part, got 0)"):
            exr.decode(data[:size], where="data")


def test_files_of_others_are_refused() -> None:
    for data in (b"", b"no picture", zlib.compress(b"x" * 999)):
        with pytest.raises(ShardError, match="expected an EXR file"):
            exr.decode(data)


def test_a_window_that_would_take_all_memory_is_refused_first() -> None:
    data = bytearray(encode(picture()))
    where = data.index(b"dataWindow\0box2i\0") + len("dataWindow\0box2i\0") + 4
    data[where:where + 16] = struct.pack("<4i", 0, 0, 19999, 5)
    with pytest.raises(ShardError, match="expected sides of at most 16384"):
        exr.decode(bytes(data))


def test_a_part_of_a_picture_is_not_taken_for_the_whole() -> None:
    """Of a crop the pixels would lie elsewhere."""
    data = bytearray(encode(picture()))
    where = data.index(b"displayWindow\0box2i\0") + len("displayWindow\0box2i\0") + 4
    data[where:where + 16] = struct.pack("<4i", -1, 0, 6, 5)
    with pytest.raises(ShardError, match=r"whole picture \(\(-1, 0\), \(6, 5\)\), .*window \(\(0, 0\), \(7, 5\)\)"):
        exr.decode(bytes(data))


def test_channels_that_a_renderer_adds_are_told_with_a_remedy() -> None:
    data = encode(picture()).replace(b"B\0\x02\0\0\0", b"A\0\x02\0\0\0", 1)
    with pytest.raises(ShardError, match=r"expected channels R, G, B or Y, got A, G, R \(save .*without alpha"):
        exr.decode(data)


def test_nothing_in_a_file_tells_when_or_where_it_was_made() -> None:
    data = encode(picture())
    header = data[:data.index(b"screenWindowWidth")]
    for name in (b"capDate", b"owner", b"comments", b"hostname", b"software"):
        assert name not in header
    assert b"lin_rec709_scene" in header and b"chromaticities" in header
    assert b"chromaticities" not in encode(picture(), "normal") and b"data" in encode(picture(), "normal")


def test_pictures_that_are_no_layers_come_back_and_say_what_they_are() -> None:
    array = picture()
    array[0, 0] = -1.0
    data = exr.encode_picture(array, name="composite")
    image = exr.read(data)
    assert image.pixels.tobytes() == array.tobytes()
    assert (image.layer, image.key, image.dtype) == ("composite", "", "float32")
    assert b"lin_rec709_scene" in data and data == exr.encode_picture(array.copy(), name="composite")


@pytest.mark.parametrize(("array", "rule"), [
    (picture(1), r"got \(6, 8, 1\)"), (np.full((6, 8, 3), np.nan, np.float32), "NaN or Inf"),
], ids=["scalar", "nan"])
def test_pictures_that_cannot_be_stored_are_refused_by_name(array: np.ndarray, rule: str) -> None:
    with pytest.raises(ShardError, match=f"picture composite: .*{rule}"):
        exr.encode_picture(array, name="composite")
