"""Images become texels: linear light, sizes, and maps of one size."""

import io

import numpy as np
from PIL import Image

from dataset_builder.assets.image_maps import ImageFile, limited_size, linear_from_srgb, read_texels


def image(texels):
    stream = io.BytesIO()
    Image.fromarray(texels).save(stream, "PNG")
    return ImageFile(name="a.png", content=stream.getvalue())


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
