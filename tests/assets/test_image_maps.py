"""Images become texels: linear light, coverage, sizes, and maps of one size; and what is no image is refused."""

import io
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from dataset_builder.assets import linear_texels
from dataset_builder.assets.image_maps import ImageFile, check_image, limited_size, read_texels
from dataset_builder.assets.linear_texels import linear_from_srgb
from dataset_builder.errors import UserError


def image(texels, kind="PNG", mode=None, **options):
    stream = io.BytesIO()
    made = texels if isinstance(texels, Image.Image) else Image.fromarray(texels)
    (made.convert(mode) if mode else made).save(stream, kind, **options)
    return ImageFile(name=f"a.{kind.lower()}", content=stream.getvalue())


def png(width, height, depth, colour, rows):
    """A PNG file of its parts, which need not fit."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    packed = zlib.compress(b"".join(b"\0" + row for row in rows))
    content = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    return ImageFile(name="made.png", content=content)


def read(found, *, srgb=False, max_size=64, **more):
    return read_texels(found, srgb=srgb, max_size=max_size, **more)


def test_srgb_is_made_linear():
    linear = linear_from_srgb(np.array([0, 0.04045, 0.5, 1]))
    np.testing.assert_allclose(linear, [0, 0.0031308, 0.2140411, 1], atol=1e-6)
    texels = read_texels(image(np.full((2, 2, 3), 128, np.uint8)), srgb=True, max_size=8)
    np.testing.assert_allclose(texels, np.broadcast_to((0.2158605, 0.2158605, 0.2158605, 1), (2, 2, 4)), rtol=1e-5)


def test_large_textures_shrink_in_linear_light():
    checks = np.tile(np.array([[0, 255], [255, 0]], np.uint8), (16, 32))
    texels = read_texels(image(checks), srgb=True, max_size=16)
    assert texels.shape == (8, 16, 4)
    np.testing.assert_allclose(texels[..., :3], 0.5, atol=1e-6)
    assert limited_size((4096, 1), 1024) == (1024, 1)
    assert limited_size((30, 20), 1024) == (30, 20)


def test_a_pixel_that_two_texels_share_counts_for_both():
    """Three pixels in two texels: each takes one and a half."""
    texels = read(image(np.array([[0, 60, 240]], np.uint8)), max_size=2)
    np.testing.assert_allclose(texels[0, :, 0] * 255, [20, 180], rtol=1e-6)


@pytest.mark.parametrize(("size", "most"), [((37, 23), 10), ((64, 48), 16), ((50, 3), 7), ((5, 90), 4)])
def test_strips_make_no_difference_and_the_mean_is_kept(monkeypatch, size, most):
    found = image(np.random.default_rng(3).integers(0, 256, (size[1], size[0], 4), dtype=np.uint8))
    whole = read(found, max_size=most)
    monkeypatch.setattr(linear_texels, "STRIP", 1)
    np.testing.assert_array_equal(read(found, max_size=most), whole)
    with Image.open(io.BytesIO(found.content)) as opened:
        np.testing.assert_allclose(whole.mean(axis=(0, 1)), np.asarray(opened).mean(axis=(0, 1)) / 255, rtol=1e-5)


def test_colours_count_by_their_coverage():
    """Half a texel is red of a third of the coverage, half is covered blue: three quarters blue, two thirds there."""
    found = image(np.array([[[255, 0, 0, 85], [0, 0, 255, 255]]], np.uint8))
    np.testing.assert_allclose(read(found, srgb=True, max_size=1)[0, 0], [0.25, 0, 0.75, 2 / 3], rtol=1e-6)
    np.testing.assert_allclose(read(found, srgb=True, max_size=1, opaque=True)[0, 0], [0.5, 0, 0.5, 1], rtol=1e-6)
    np.testing.assert_allclose(read(found, max_size=1)[0, 0], [0.5, 0, 0.5, 2 / 3], rtol=1e-6)
    nothing = image(np.array([[[255, 0, 0, 0], [0, 0, 255, 0]]], np.uint8))
    np.testing.assert_allclose(read(nothing, srgb=True, max_size=1)[0, 0], [0.5, 0, 0.5, 0], rtol=1e-6)


@pytest.mark.parametrize(("kind", "mode", "expected"), [
    ("PNG", "1", (1, 1, 1, 1)), ("PNG", "L", (0.8, 0.8, 0.8, 1)), ("PNG", "LA", (0.8, 0.8, 0.8, 0.4)),
    ("PNG", "P", (1, 0.8, 0.6, 0.4)), ("TGA", "RGBA", (1, 0.8, 0.6, 0.4)), ("BMP", "RGB", (1, 0.8, 0.6, 1)),
    ("GIF", "RGB", (1, 0.8, 0.6, 1)), ("TIFF", "CMYK", (1, 0.8, 0.6, 1)), ("JPEG", "RGB", (1, 0.8, 0.6, 1)),
    ("JPEG", "CMYK", (1, 0.8, 0.6, 1))])
def test_every_kind_of_pixel_is_read(kind, mode, expected):
    colour = {"1": (255,) * 4, "L": (204, 204, 204, 102), "LA": (204, 204, 204, 102)}.get(mode, (255, 204, 153, 102))
    colours = Image.new("RGBA", (16, 16), colour)
    texels = read(image(colours, kind, None if mode == "RGBA" else mode))
    np.testing.assert_allclose(texels, np.broadcast_to(expected, texels.shape), atol=2.1 / 255)


def test_webp_and_the_first_of_many_frames_are_read():
    first, second = (Image.new("RGBA", (4, 4), colour) for colour in ((0, 255, 0, 51), (255, 0, 0, 255)))
    for kind in ("WEBP", "PNG"):
        options = {"lossless": True} if kind == "WEBP" else {}
        found = image(first, kind, save_all=True, append_images=[second], **options)
        np.testing.assert_allclose(read(found), np.broadcast_to((0, 1, 0, 0.2), (4, 4, 4)), atol=1e-6)


def test_a_transparent_colour_of_a_palette_is_not_there():
    palette = Image.new("P", (2, 1))
    palette.putpalette([255, 0, 0, 0, 255, 0])
    palette.putpixel((1, 0), 1)
    np.testing.assert_allclose(read(image(palette, transparency=0))[0], [[1, 0, 0, 0], [0, 1, 0, 1]], atol=1e-6)


def test_sixteen_bits_of_grey_are_kept_and_the_upper_eight_of_a_colour():
    grey = image(np.array([[0x8001, 0xffff]], np.uint16))
    np.testing.assert_allclose(read(grey)[0, :, 0], [0x8001 / 65535, 1], rtol=1e-7)
    np.testing.assert_allclose(read(grey, max_size=1)[0, 0, :3], (0x8001 + 0xffff) / 2 / 65535, rtol=1e-6)
    colour = png(1, 1, 16, 2, [struct.pack(">3H", 0x12ff, 0x80ff, 0xff00)])
    np.testing.assert_allclose(read(colour)[0, 0, :3], np.array([0x12, 0x80, 0xff]) / 255, rtol=1e-6)


def test_floats_are_linear_already_and_stay_within_their_range():
    values = np.array([[0.25, 0.5]], np.float32)
    np.testing.assert_array_equal(read(image(values, "TIFF"), srgb=True)[0, :, 0], [0.25, 0.5])
    for wrong in (1.5, -0.1, np.nan, np.inf):
        values[0, 1] = wrong
        with pytest.raises(UserError, match=rf"a\.tiff: expected a readable image .*the value {wrong:g}, where"):
            read(image(values, "TIFF"), srgb=True)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
def test_orientations_beside_the_pixels_are_ignored(kind):
    made = Image.new("RGB", (4, 2))
    turned = made.getexif()
    turned[0x0112] = 6
    assert read(image(made, kind, exif=turned)).shape == (2, 4, 4)


@pytest.mark.parametrize(("width", "height"), [(50_000, 50_000), (16_385, 1)])
def test_what_is_too_large_is_refused_before_it_is_decoded(width, height):
    tracemalloc.start()
    try:
        said = rf"made\.png: expected an image of at most 16384 pixels a side, got one of {width} x {height}"
        for asked in (check_image, read):
            with pytest.raises(UserError, match=said):
                asked(png(width, height, 8, 2, [b""]))
        assert tracemalloc.get_traced_memory()[1] < 1 << 22
    finally:
        tracemalloc.stop()


def test_a_header_that_promises_more_than_the_file_can_hold_is_refused():
    with pytest.raises(UserError, match=r"made\.png: .*16384 x 16384, got \d+ bytes, which cannot hold them"):
        check_image(png(16384, 16384, 8, 2, [b""]))
    assert check_image(png(1, 4096, 1, 0, [b"\0"] * 4096)) == (1, 4096)


def test_large_images_need_no_more_than_pillow_and_warn_of_nothing():
    """Pillow by itself warns of more than 89 million pixels, and a warning is an error here."""
    large = png(16384, 6000, 1, 0, [b"\xff" * 2048] * 6000)
    np.testing.assert_array_equal(read(large, max_size=16), np.ones((6, 16, 4)))
    assert Image.MAX_IMAGE_PIXELS is not None


@pytest.mark.parametrize("content", [b"", b"no image", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n",
                                     "gone.png"])
def test_what_is_no_image_is_refused(tmp_path, content):
    found = ImageFile(name="chair.png", content=tmp_path / content if isinstance(content, str) else content)
    for asked in (check_image, read):
        with pytest.raises(UserError, match=r"chair\.png: expected a readable image"):
            asked(found)


SAMPLES = [image(np.random.default_rng(7).integers(0, 256, (9, 7, 3), dtype=np.uint8), kind).content
           for kind in ("PNG", "JPEG", "WEBP", "TGA", "BMP", "TIFF", "GIF", "DDS", "AVIF")]


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(SAMPLES), st.lists(st.tuples(st.integers(0, 600), st.integers(0, 255)), max_size=6),
       st.integers(1, 2000))
def test_damaged_images_are_read_or_refused(sample, changes, length):
    content = bytearray(sample[:length])
    for place, value in changes:
        content[place % len(content)] = value
    try:
        texels = read(ImageFile(name="damaged", content=bytes(content)), srgb=True, max_size=8)
    except UserError as error:
        assert str(error).startswith("damaged: expected")
    else:
        assert texels.shape[2] == 4 and texels.min() >= 0 and texels.max() <= 1
