"""OpenEXR files as textures: values as they stand, whatever the caller takes colours for."""

import io

import numpy as np
import OpenEXR
import pytest

from dataset_builder.assets.exr_picture import exr_size, is_exr, read_exr
from dataset_builder.assets.image_maps import ImageFile, check_image, read_texels
from dataset_builder.errors import UserError
from dataset_builder.seeding import rng

COLOURS = rng(1, "colours").uniform(0, 1, (6, 8, 3)).astype(np.float32)
ALPHA = rng(1, "alpha").uniform(0, 1, (6, 8)).astype(np.float32)


def exr(**planes: np.ndarray) -> bytes:
    stream = io.BytesIO()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {name: np.ascontiguousarray(plane) for name, plane in planes.items()}).write(stream)
    return stream.getvalue()


def coloured(pixels: np.ndarray = COLOURS, **more: np.ndarray) -> bytes:
    return exr(**{name: pixels[..., k] for k, name in enumerate("RGB")}, **more)


def texels(content: bytes, *, srgb: bool = False, max_size: int = 64, opaque: bool = False) -> np.ndarray:
    return read_texels(ImageFile(name="a.exr", content=content), srgb=srgb, max_size=max_size, opaque=opaque)


@pytest.mark.parametrize("srgb", [False, True])
def test_floats_are_as_they_stand(srgb: bool) -> None:
    found = texels(coloured(), srgb=srgb)
    np.testing.assert_array_equal(found[..., :3], COLOURS)
    assert (found[..., 3] == 1).all()


def test_halves_and_a_single_channel() -> None:
    found = texels(exr(Y=ALPHA.astype(np.float16)))
    np.testing.assert_array_equal(found[..., 1], ALPHA.astype(np.float16).astype(np.float32))
    assert (found[..., 0] == found[..., 2]).all()


def test_coverage_is_read_beside_colours() -> None:
    np.testing.assert_array_equal(texels(coloured(A=ALPHA))[..., 3], ALPHA)
    assert (texels(coloured(A=ALPHA), opaque=True)[..., 3] == 1).all()
    named = exr(**{f"wood.{name}": COLOURS[..., k] for k, name in enumerate("RGB")}, **{"wood.A": ALPHA})
    np.testing.assert_array_equal(read_exr(named).alpha, ALPHA)


def test_large_ones_shrink_to_means() -> None:
    found = texels(coloured(), max_size=4)
    assert found.shape == (3, 4, 4)
    np.testing.assert_allclose(found[..., :3], COLOURS.reshape(3, 2, 4, 2, 3).mean(axis=(1, 3)), rtol=1e-6)


def test_the_size_is_in_the_header() -> None:
    content = coloured()
    assert is_exr(content) and exr_size(content) == (8, 6)
    assert check_image(ImageFile(name="a.exr", content=content)) == (8, 6)


@pytest.mark.parametrize("value", [1.5, -0.25, np.nan, np.inf])
def test_what_no_texel_can_be_is_refused(value: float) -> None:
    pixels = COLOURS.copy()
    pixels[2, 3, 1] = value
    with pytest.raises(UserError, match=rf"the value {value:g}, where floats are to be in \[0, 1\]"):
        texels(coloured(pixels))


def test_damaged_files_are_refused() -> None:
    content = coloured()
    for size in range(4, len(content) - 1, 37):
        with pytest.raises(UserError, match="expected a readable image"):
            texels(content[:size])
