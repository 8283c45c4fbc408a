"""Decoded images -> linear texels: sRGB made linear, and means over exact areas, strip by strip."""

import numpy as np
from PIL import Image

MAX_SIDE, MAX_PIXELS = 16384, 1 << 28
"""The largest image that is decoded."""
STRIP = 1 << 21
"""Pixels that are made linear at a time."""
BARELY = 1e-9
"""Weight of a colour without coverage: it counts only where there is no other."""
WIDE = ("I;16", "I;16L", "I;16B", "I;16N")
"""Modes of 16 bits."""


def linear_from_srgb(values: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] of sRGB-encoded values in [0, 1] (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def linear_rgba(colors: np.ndarray) -> np.ndarray:
    """(N, 4) float32 linear colours and coverage, 1 without any, of (N, 3 or 4) sRGB ones in [0, 1]."""
    rgba = np.ones((len(colors), 4), np.float32)
    rgba[:, :colors.shape[1]] = colors
    rgba[:, :3] = linear_from_srgb(rgba[:, :3])
    return rgba


def reduced(image: Image.Image, size: tuple[int, int], *, srgb: bool, opaque: bool) -> np.ndarray:
    """(H, W, 4) float32 of a decoded image at (width, height) `size`, made linear and averaged strip by strip."""
    covered = image.has_transparency_data and not opaque
    if (image.mode in (*WIDE, "F") and covered) or image.mode == "I":
        raise ValueError(f"pixels of kind {image.mode}{' with transparency' * covered}, which are not read")
    weighted = covered and srgb
    levels = np.arange(65536 if image.mode in WIDE else 256)
    table = levels / levels[-1]
    table = (linear_from_srgb(table) if srgb else table).astype(np.float32)
    rows, columns = _edges(image.height, size[1]), _edges(image.width, size[0])
    step = max(1, STRIP * size[1] // (image.width * image.height))
    strips = []
    for top in range(0, size[1], step):
        chosen = rows[top:top + step + 1]
        first = int(chosen[0])
        strip = _linear(image.crop((0, first, image.width, int(np.ceil(chosen[-1])))), table, covered)
        if weighted:
            strip[..., :3] *= strip[..., 3:] + BARELY
        strips.append(_area_means(_area_means(strip, chosen - first, 0), columns, 1))
    texels = np.concatenate(strips)
    if weighted:
        texels[..., :3] /= texels[..., 3:] + BARELY
    whole = np.ones((size[1], size[0], 4), dtype=np.float32)
    whole[..., :4 if covered else 3] = np.clip(texels, 0, 1)
    return whole


def _linear(strip: Image.Image, table: np.ndarray, covered: bool) -> np.ndarray:
    """(H, W, 1, 3 or 4) float32 of some rows; colours by `table`, coverage as it is. Raises ValueError for floats that
    are not in [0, 1]."""
    if strip.mode == "F":
        return in_range(np.asarray(strip)[..., None])
    if strip.mode in WIDE:
        return np.take(table, np.asarray(strip))[..., None]
    mode = "RGBA" if covered else "L" if strip.mode in ("1", "L") else "RGB"
    values = np.asarray(strip if strip.mode == mode else strip.convert(mode))
    colours = np.take(table, np.atleast_3d(values)[..., :3])
    return np.concatenate([colours, values[..., 3:] / np.float32(255)], axis=2) if covered else colours


def reduced_floats(texels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(H, W, C) float32 means over areas of linear texels, at (width, height) `size`. Raises ValueError for values that
    are not in [0, 1]."""
    columns = _area_means(in_range(texels), _edges(texels.shape[0], size[1]), 0)
    return _area_means(columns, _edges(texels.shape[1], size[0]), 1)


def in_range(values: np.ndarray) -> np.ndarray:
    """The values. Raises ValueError for any that are not in [0, 1]."""
    wrong = values[~((values >= 0) & (values <= 1))]
    if len(wrong):
        raise ValueError(f"the value {wrong[0]:g}, where floats are to be in [0, 1]")
    return values


def _edges(pixels: int, texels: int) -> np.ndarray:
    """(texels + 1,) float64: where texels begin and end, in pixels."""
    return np.arange(texels + 1) * pixels / texels


def _area_means(values: np.ndarray, edges: np.ndarray, axis: int) -> np.ndarray:
    """Means between neighbouring `edges` along an axis, at least a pixel apart; pixels that one divides count in
    part."""
    if len(edges) == values.shape[axis] + 1:
        return values
    shape = [-1 if each == axis else 1 for each in range(values.ndim)]
    whole = np.floor(edges).astype(np.intp)
    part = (edges - whole).astype(np.float32)
    inside, step = values[(slice(None),) * axis + (slice(whole[-1]),)], whole[1] - whole[0]
    if not part.any() and (np.diff(whole) == step).all():
        # Ten times as fast
        sums = inside.reshape(*values.shape[:axis], -1, step, *values.shape[axis + 1:]).sum(axis=axis + 1)
    else:
        sums = np.add.reduceat(inside, whole[:-1], axis)
        cut = values.take(np.minimum(whole, values.shape[axis] - 1), axis) * part.reshape(shape)
        sums += np.diff(cut, axis=axis)
    return sums / np.diff(edges).astype(np.float32).reshape(shape)
