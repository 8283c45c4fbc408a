"""Pictures for lights become linear Rec.709, or are refused by what they are."""

import struct

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.light_pictures import read_picture, rgbe_pixels
from dataset_builder.assets.primaries import REC709, rec709_from_rgb, xyz_from_rgb
from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError
from dataset_builder.rendering.scene.images import read_image
from tests.assets.test_primaries import AP0, REC2020

RED = np.tile(np.float32([1, 0, 0]), (4, 8, 1))


def exr(path, channels, **header):
    OpenEXR.File({"type": OpenEXR.scanlineimage, **header}, channels).write(str(path))
    return path


def plain_exr(path, planes, steps):
    """An uncompressed file of float32 planes of which some have every `steps`-th row and column, which OpenEXR's own
    binding reads and does not write (openexr.com, "OpenEXR File Layout")."""
    height, width = planes["Y"].shape

    def attribute(name, kind, data):
        return f"{name}\0{kind}\0".encode() + struct.pack("<i", len(data)) + data

    channels = b"".join(f"{name}\0".encode() + struct.pack("<iiii", 2, 0, steps[name], steps[name])
                        for name in sorted(planes)) + b"\0"
    box, one = struct.pack("<4i", 0, 0, width - 1, height - 1), struct.pack("<f", 1)
    head = struct.pack("<ii", 20000630, 2) + b"".join(attribute(*each) for each in (
        ("channels", "chlist", channels), ("compression", "compression", b"\0"), ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box), ("lineOrder", "lineOrder", b"\0"), ("pixelAspectRatio", "float", one),
        ("screenWindowCenter", "v2f", bytes(8)), ("screenWindowWidth", "float", one))) + b"\0"
    rows = []
    for y in range(height):
        data = b"".join(planes[name][y // steps[name]].astype("<f4").tobytes() for name in sorted(planes)
                        if y % steps[name] == 0)
        rows.append(struct.pack("<ii", y, len(data)) + data)
    starts = np.cumsum([len(head) + 8 * height, *map(len, rows[:-1])])
    path.write_bytes(head + starts.astype("<u8").tobytes() + b"".join(rows))
    return path


def radiance(path, *lines, pixels=b"\x80\x40\x20\x81" * 128):
    """16 x 8 pixels; 128/256 * 2, 64/256 * 2 and 32/256 * 2 unless they are given."""
    header = "\n".join(["#?RADIANCE", "FORMAT=32-bit_rle_rgbe", *lines, "", "-Y 8 +X 16", ""])
    path.write_bytes(header.encode() + pixels)
    return path


def colours(path):
    return read_image(path, sha256_file(path), (path.suffix,))


@pytest.mark.parametrize("chromaticities", [AP0, REC2020])
def test_primaries_in_the_header_are_honoured(tmp_path, chromaticities):
    """White stays, half-grey red becomes what the matrix says, and what Rec.709 does not have is cut at 0."""
    pixels = np.tile(np.float32([[1, 1, 1], [0.5, 0.25, 0.25]]), (4, 4, 1))
    found = colours(exr(tmp_path / "a.exr", {"RGB": pixels}, chromaticities=chromaticities))
    assert found[0, 0] == pytest.approx(np.ones(3), rel=1e-5)
    assert found[0, 1] == pytest.approx(rec709_from_rgb(chromaticities) @ [0.5, 0.25, 0.25], rel=1e-5)
    pure = colours(exr(tmp_path / "b.exr", {"RGB": RED}, chromaticities=chromaticities))
    assert pure[0, 0, 0] > 1.5 and pure[0, 0, 1] == pure[0, 0, 2] == 0


def test_files_of_rec709_keep_every_bit(tmp_path):
    pixels = np.random.default_rng(2).random((4, 8, 3), dtype=np.float32)
    for name, header in (("a", {}), ("b", {"chromaticities": REC709})):
        assert colours(exr(tmp_path / f"{name}.exr", {"RGB": pixels}, **header)).tobytes() == pixels.tobytes()


def test_luminance_and_chroma_become_colours(tmp_path):
    """Chroma of every second pixel, linear over the picture: exact wherever it lies between two of them."""
    y, x = np.mgrid[0:6, 0:10] / 10
    rgb = np.stack([1 + x, 1 + y, 2 - x], axis=-1)
    weights = xyz_from_rgb(REC709)[1]
    luminance = rgb @ weights
    for step in (1, 2):
        even = np.ones_like(luminance) if step == 2 else luminance
        chroma = {name: (rgb[..., k] - luminance if step == 2 else rgb[..., k] / luminance - 1)[::step, ::step]
                  for name, k in (("RY", 0), ("BY", 2))}
        steps = {"Y": 1, "RY": step, "BY": step}
        found = colours(plain_exr(tmp_path / "a.exr", {"Y": even, **chroma}, steps))
        red, blue = (even * (1 + rgb[..., k] - luminance) if step == 2 else rgb[..., k] for k in (0, 2))
        inner = (slice(0, 5), slice(0, 9))
        assert found[..., 0][inner] == pytest.approx(red[inner], rel=1e-5)
        assert found[..., 2][inner] == pytest.approx(blue[inner], rel=1e-5)
        assert found @ weights == pytest.approx(even, rel=1e-5)


def test_luminance_alone_is_grey_and_alpha_is_passed_over(tmp_path):
    grey = np.full((4, 8), 0.25, np.float32)
    assert (colours(exr(tmp_path / "a.exr", {"Y": grey}, chromaticities=AP0)) == 0.25).all()
    found = colours(exr(tmp_path / "b.exr", {"RGBA": np.dstack([RED + 1, grey])}))
    assert (found == RED + 1).all()


@pytest.mark.parametrize(("names", "taken"), [
    (["diffuse.R", "diffuse.G", "diffuse.B", "depth.Z"], True), (["a.b.R", "a.b.G", "a.b.B", "a.b.A"], True),
    (["R", "G", "B", "other.R", "other.G", "other.B"], True), (["sky.Y"], True)])
def test_the_only_layer_with_colours_is_taken(tmp_path, names, taken):
    planes = {name: np.full((4, 8), "RGB".find(name[-1]) + 2 + ("other" in name), np.float32) for name in names}
    expected = [1, 1, 1] if names == ["sky.Y"] else [2, 3, 4]
    assert (colours(exr(tmp_path / "a.exr", planes)) == expected).all()


@pytest.mark.parametrize(("names", "said"), [
    (["a.R", "a.G", "a.B", "b.R", "b.G", "b.B"], r"layers a, b, where one is to have colours"),
    (["X", "Y", "Z"], r"channels X, Y, Z, none of them R, G, B or Y"),
    (["R", "G", "depth.Z"], r"channels G, R, depth\.Z, none of them R, G, B or Y")])
def test_other_channels_are_refused_by_name(tmp_path, names, said):
    with pytest.raises(PlanError, match=rf"a\.exr: expected an image of colours, got: {said}"):
        colours(exr(tmp_path / "a.exr", {name: np.ones((4, 8), np.float32) for name in names}))


def test_of_several_parts_the_first_is_read_or_they_are_refused(tmp_path):
    def parts(*planes):
        made = [OpenEXR.Part({"name": f"part{k}", "type": OpenEXR.scanlineimage}, each)
                for k, each in enumerate(planes)]
        OpenEXR.File(made).write(str(tmp_path / "a.exr"))
        return colours(tmp_path / "a.exr")

    assert (parts({"RGB": RED}, {"RGB": RED + 1}) == RED).all()
    with pytest.raises(PlanError, match=r"got: 2 parts, the first with channels Z, none of them R, G, B or Y"):
        parts({"Z": np.ones((4, 8), np.float32)}, {"RGB": RED})


def test_what_is_no_whole_flat_picture_is_refused(tmp_path):
    def corner(*values):
        return np.array(values, np.int32)

    cases = {"six faces of a cube": {"envmap": OpenEXR.ENVMAP_CUBE}, r"the window \(\(2, 1\), \(9, 4\)\)": {
        "dataWindow": (corner(2, 1), corner(9, 4)), "displayWindow": (corner(0, 0), corner(15, 7))}}
    for said, header in cases.items():
        with pytest.raises(PlanError, match=said):
            colours(exr(tmp_path / "a.exr", {"RGB": RED}, **header))
    with pytest.raises(PlanError, match="channels of uint32, where colours are float16 or float32"):
        colours(exr(tmp_path / "b.exr", {name: np.ones((4, 8), np.uint32) for name in "RGB"}))


def test_a_window_of_an_impossible_size_is_refused_before_it_is_decoded(tmp_path):
    content = exr(tmp_path / "a.exr", {"RGB": RED}).read_bytes()
    low, high = (struct.pack("<4i", 0, 0, last, 3) for last in (7, 49_999))
    (tmp_path / "a.exr").write_bytes(content.replace(low, high))
    with pytest.raises(PlanError, match=r"a\.exr: .*50000 x 4 pixels, more than 16384 a side"):
        colours(tmp_path / "a.exr")


def test_corrections_in_a_radiance_header_are_undone(tmp_path):
    plain = colours(radiance(tmp_path / "a.hdr"))
    assert plain[0, 0] == pytest.approx([1.0, 0.5, 0.25], rel=0.02)
    corrected = colours(radiance(tmp_path / "b.hdr", "COLORCORR= 2 1 0.5", "COLORCORR= 1 2 1", "EXPOSURE=3"))
    assert corrected / plain == pytest.approx(np.broadcast_to([0.5, 0.5, 2], plain.shape), rel=1e-6)
    wide = colours(radiance(tmp_path / "c.hdr", "PRIMARIES= " + " ".join(map(str, REC2020))))
    assert wide[0, 0] == pytest.approx(np.maximum(rec709_from_rgb(REC2020) @ plain[0, 0], 0), rel=1e-5)


@pytest.mark.parametrize(("line", "said"), [
    ("FORMAT=32-bit_rle_xyze", "FORMAT=32-bit_rle_xyze, where 32-bit_rle_rgbe is read"),
    ("GAMMA=2.2", "GAMMA=2.2, where values are to be linear"), ("COLORCORR=1 2", "COLORCORR=1 2, where 3 numbers"),
    ("COLORCORR=1 0 1", "COLORCORR=1 0 1, where 3 numbers"), ("PRIMARIES=0 0 0 0 0 0 0 0", "span no colours"),
    ("PRIMARIES=red", "could not convert string to float")])
def test_headers_that_are_not_understood_are_refused(tmp_path, line, said):
    with pytest.raises(PlanError, match=said):
        colours(radiance(tmp_path / "a.hdr", line))


def test_other_radiance_files_are_refused(tmp_path):
    path = radiance(tmp_path / "a.hdr")
    whole = path.read_bytes()
    for content, said in ((whole.replace(b"-Y", b"+Y"), "-Y height"),
                          (whole[:100], "bytes of pixels, where 16 x 8 take 512"),
                          (b"P6 4 4 255\n", "no header of a Radiance"),
                          (whole.replace(b"X 16", b"X 50000"), "50000 x 8 pixels, more than 16384 a side")):
        path.write_bytes(content)
        with pytest.raises(PlanError, match=said):
            colours(path)


def test_a_picture_too_large_is_refused(tmp_path):
    from tests.assets.test_image_maps import png

    (tmp_path / "a.png").write_bytes(png(50_000, 50_000, 8, 2, [b""]).content)
    with pytest.raises(PlanError, match="expected an image of at most 16384 pixels a side, got one of 50000 x 50000"):
        colours(tmp_path / "a.png")


@pytest.mark.parametrize(("width", "tall"), [(16, 1), (300, 40), (7, 1)])
def test_pixels_are_those_that_mitsuba_reads(tmp_path, width, tall):
    """Noise, long runs in rows, and rows too short for runs."""
    pixels = np.random.default_rng(4).gamma(0.5, 1.0, (8, width // tall + 1, 3)).astype(np.float32)
    pixels = np.ascontiguousarray(np.repeat(pixels, tall, axis=1)[:, :width])
    mi.Bitmap(pixels).write(str(tmp_path / "a.hdr"))
    bitmap = mi.Bitmap(str(tmp_path / "a.hdr"))
    theirs = np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))
    assert read_picture(tmp_path / "a.hdr").pixels.tobytes() == theirs.tobytes()


def test_runs_of_the_oldest_kind_are_refused():
    with pytest.raises(ValueError, match="runs of the oldest kind"):
        rgbe_pixels(b"\x80\x80\x80\x80\1\1\1\7" + bytes(8), 4, 1)


@settings(max_examples=150, deadline=None,
          suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
@given(st.sampled_from([".exr", ".hdr"]), st.lists(st.tuples(st.integers(0, 700), st.integers(0, 255)), max_size=6),
       st.integers(1, 2000))
def test_damaged_files_are_read_or_refused(tmp_path, suffix, changes, length):
    path = tmp_path / f"a{suffix}"
    pixels = np.random.default_rng(5).random((4, 16, 3), dtype=np.float32)
    content = exr(path, {"RGB": pixels}).read_bytes() if suffix == ".exr" else radiance(
        path, "PRIMARIES= " + " ".join(map(str, REC2020)), pixels=(b"\2\2\0\x10" + b"\x90\x55" * 4) * 8).read_bytes()
    content = bytearray(content[:length])
    for place, value in changes:
        content[place % len(content)] = value
    path.write_bytes(content)
    try:
        found = colours(path)
    except PlanError as error:
        assert str(error).startswith(f"{path}: expected")
    else:
        assert np.isfinite(found).all() and found.min() >= 0
