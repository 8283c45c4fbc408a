"""Images of a mesh file -> the texel arrays of a Texture: linear, equally large, and within a size limit."""

import numpy as np
from PIL import Image

from dataset_builder.assets.asset import Texture


def linear_from_srgb(values: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def make_texture(*, base_color: Image.Image | None, metallic_roughness: Image.Image | None = None,
                 normal: Image.Image | None = None, max_size: int = 1024) -> Texture | None:
    """Texture of glTF's images: sRGB base colour, metallic (blue) and roughness (green), tangent-space normals.

    Every map takes the size of the base colour, or of the first map there is, scaled down as a whole where a side
    exceeds `max_size` texels. None where there is no image. Alpha is not used.
    """
    images = [image for image in (base_color, metallic_roughness, normal) if image is not None]
    if not images:
        return None
    size = limited_size(images[0].size, max_size)
    color = np.ones((size[1], size[0], 3)) if base_color is None else linear_from_srgb(_texels(base_color))
    surface = None if metallic_roughness is None else resized(_texels(metallic_roughness), size)
    return Texture(
        base_color=_unit_range(resized(color, size)),
        roughness=None if surface is None else _unit_range(surface[..., 1]),
        metallic=None if surface is None else _unit_range(surface[..., 2]),
        normal=None if normal is None else _unit_vectors(resized(2 * _texels(normal) - 1, size)),
    )


def limited_size(size: tuple[int, int], max_size: int) -> tuple[int, int]:
    """(width, height) scaled down to sides of at most `max_size`, proportions kept, never below one texel."""
    factor = min(1.0, max_size / max(size))
    return max(1, round(size[0] * factor)), max(1, round(size[1] * factor))


def resized(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) texels at (width, height) `size`: area means where it shrinks, bilinear where it grows; in linear
    values."""
    if (texels.shape[1], texels.shape[0]) == size:
        return texels
    grows = size[0] > texels.shape[1] or size[1] > texels.shape[0]
    method = Image.Resampling.BILINEAR if grows else Image.Resampling.BOX
    channels = [np.asarray(Image.fromarray(channel.astype(np.float32)).resize(size, method))
                for channel in np.moveaxis(texels, 2, 0)]
    return np.stack(channels, axis=2)


def _texels(image: Image.Image) -> np.ndarray:
    """(H, W, 3) float64 in [0, 1]; a single channel fills all three, 16 bits are kept."""
    if image.mode.startswith(("I", "F")):
        return np.repeat(np.asarray(image, dtype=np.float64)[..., None] / 65535, 3, axis=2)
    return np.asarray(image.convert("RGB"), dtype=np.float64) / 255


def _unit_range(texels: np.ndarray) -> np.ndarray:
    return np.clip(texels, 0, 1).astype(np.float32)


def _unit_vectors(texels: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(texels, axis=2, keepdims=True)
    upright = np.broadcast_to((0.0, 0.0, 1.0), texels.shape)
    return np.where(length > 1e-6, texels / np.maximum(length, 1e-6), upright).astype(np.float32)
