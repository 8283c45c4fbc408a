"""Images of mesh files -> texels -> Texture: decoded, made linear, and brought to one size of bounded sides."""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from dataset_builder.assets.asset import Texture, Wrap
from dataset_builder.errors import Problem, UserError


@dataclass(frozen=True, kw_only=True)
class ImageFile:
    """An encoded image, not yet read."""

    name: str
    """What messages call it: its path, or `images[3] of chair.glb`."""
    content: bytes | Path


def linear_from_srgb(values: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def read_texels(image: ImageFile, *, srgb: bool, max_size: int) -> np.ndarray:
    """(H, W, 4) float32 in [0, 1]: colour and coverage, which is 1 where the image has none.

    srgb: whether colours are encoded, and to be made linear; coverage never is. Sides longer than `max_size` texels are
    shrunk together by area means, in linear light. A single channel fills three; 16 bits are kept. Raises UserError for
    what is no image, or too large.
    """
    try:
        with Image.open(io.BytesIO(image.content) if isinstance(image.content, bytes) else image.content) as opened:
            opened.load()
            texels = _texels(opened)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        problem = Problem(where=image.name, path="", rule=f"expected a readable image, got: {error}")
        raise UserError([problem]) from error
    if srgb:
        texels[..., :3] = linear_from_srgb(texels[..., :3])
    return resized(texels, limited_size((texels.shape[1], texels.shape[0]), max_size)).astype(np.float32)


def make_texture(maps: Mapping[str, np.ndarray], *, wrap: tuple[Wrap, Wrap] = ("repeat", "repeat"),
                 nearest: bool = False) -> Texture | None:
    """Texture of maps by their names there, (H, W) or (H, W, C); normals as they are encoded, in [0, 1]. None of none.

    All take the size of `base_color`, or of the first map that there is.
    """
    if not maps:
        return None
    first = maps.get("base_color", next(iter(maps.values())))
    size = first.shape[1], first.shape[0]
    made = {name: resized(np.atleast_3d(values), size) for name, values in maps.items()}
    if "normal" in made:
        made["normal"] = _unit_vectors(2 * made["normal"] - 1)
    shaped = {name: values if maps[name].ndim == 3 else values[..., 0] for name, values in made.items()}
    shaped.setdefault("base_color", np.ones((size[1], size[0], 3)))
    low = {"normal": -1.0}
    clipped: dict[str, Any] = {name: np.clip(values, low.get(name, 0.0), 1).astype(np.float32)
                               for name, values in shaped.items()}
    return Texture(wrap=wrap, nearest=nearest, **clipped)


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
    """(H, W, 4) float64 in [0, 1] as encoded."""
    if image.mode.startswith(("I", "F")):
        grey = np.asarray(image, dtype=np.float64)[..., None] / 65535
        return np.concatenate([np.repeat(grey, 3, axis=2), np.ones_like(grey)], axis=2)
    return np.asarray(image.convert("RGBA"), dtype=np.float64) / 255


def _unit_vectors(texels: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(texels, axis=2, keepdims=True)
    upright = np.broadcast_to((0.0, 0.0, 1.0), texels.shape)
    return np.where(length > 1e-6, texels / np.maximum(length, 1e-6), upright)
